//! The key `frame` of `[rve]`: a frame of boundary grains [Liu2018] in place of a periodic cell.

use crate::error::DefinitionError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest |H| of one trial of a frame, dimensionless.
pub(crate) const LARGEST_FRAME_TARGET: f64 = 0.2;

/// Boundary conditions of a frame by keyword, from the stiffest to the softest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrameConstraint {
    /// `x_q = F X_q`, no rotation: a linear displacement of all boundary grains.
    Linear,
    /// `x+ - x- = F (X+ - X-)`, equal rotations of opposite grains, corners on their places: [Liu2018] eq. 12.
    #[default]
    Periodic,
    /// Boundary forces of one stress, `a_q = P A_q`, no moments; only the mean deformation is given.
    Traction,
    /// Plane tests between smooth platens and soft sides, in the table `[frame]` of RVE tests alone: the grains of the lower and the upper side keep
    /// `y_q = (F X_q)_y`, and all boundary grains bear the horizontal part of `a_q = P A_q`, with the shear `P_xy` that keeps the mean
    /// shear strain; `stress = { xy = 0 }` makes the platens free of it. The sides bear no vertical forces, and boundary grains turn freely.
    Platens,
}

protocol::keywords! {
    pub FrameConstraint {
        Linear => "linear",
        Periodic => "periodic",
        Traction => "traction",
        Platens => "platens",
    }
}

/// How opposite boundary grains are brought to cancelling loads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrameControl {
    /// Both move in every step along the sum of their loads, like one grain.
    #[default]
    Direct,
    /// They are held while the inner grains relax and corrected in between, as in [Liu2018] table 2.
    Servo {
        /// Correction over the sum of loads per contact stiffness of the pair, dimensionless; 1 converges slowly but surely, 1.8 was seen to diverge, and from 2 on it always does.
        #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        gain: f64,
    },
}

/// The frame behind a Gauss point. Accuracy, damping and step cap are those of `[rve]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CellFrame {
    /// Boundary condition.
    pub constraint: FrameConstraint,
    /// How opposite grains of a periodic frame are balanced.
    pub control: FrameControl,
    /// Contacts between two grains of one side count half, because the neighbouring frame has them as well; a periodic
    /// frame then is the periodic cell. [Liu2018] counts them whole.
    pub shared_sides: bool,
    /// Residual of opposite boundary loads over mean contact force; 1e-2 for servo and local damping, otherwise thirty times the force
    /// tolerance.
    #[schemars(extend("x-unit" = "-", "x-default" = "by `control` and `rve.damping`", "exclusiveMinimum" = 0))]
    pub servo_tolerance: Option<f64>,
    /// Most corrections of the servo in one trial.
    #[schemars(extend("x-default" = "500"), range(min = 1))]
    pub most_corrections: Option<u32>,
}

impl CellFrame {
    /// Refuses keys that have no effect with the others.
    ///
    /// # Errors
    /// The key and what it needs.
    pub(super) fn refuse_unused(&self) -> Result<(), DefinitionError> {
        let is_servo = matches!(self.control, FrameControl::Servo { .. });
        let is_periodic = self.constraint == FrameConstraint::Periodic;
        let unused = [
            (self.most_corrections.is_some() && !is_servo, "most_corrections", "control = { servo = { ... } }"),
            (is_servo && !is_periodic, "control = { servo = ... }", "constraint = \"periodic\""),
        ];
        match unused.iter().find(|(is_unused, ..)| *is_unused) {
            Some((_, key, needed)) => Err(DefinitionError(format!(
                "rve.frame.{key} has no effect without {needed}; leave it out, or write that"
            ))),
            None => Ok(()),
        }
    }
}
