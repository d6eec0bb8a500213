//! How a frame is solved.

use crate::definition::{Damping, FrameConstraint, FrameControl, RveOptions};
use crate::error::{DefinitionError, in_declared_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Damping of the grains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrameDamping {
    /// Velocities are steered towards the forces and reset when they oppose them; ends at a force tolerance.
    #[default]
    Fire,
    /// `f_d = -coefficient |f| sign(v)` per component; ends at a ratio of kinetic to stored energy, [Liu2018] eq. 31.
    Local {
        /// Coefficient; [Liu2018] uses 0.7.
        #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        coefficient: f64,
    },
}

/// How a frame is solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameOptions {
    /// Boundary condition.
    pub constraint: FrameConstraint,
    /// Copies of the packing along x and y, joined at their boundary grains; the outer ones bound all of them. Two by four of them are
    /// the larger simulation of all grains of [Liu2018].
    #[serde(default = "one_tile")]
    #[schemars(extend("x-default" = "[1, 1]"), inner(range(min = 1)))]
    pub tiles: [u32; 2],
    /// Contacts between two grains of one side count half, because the neighbouring frame has them as well; a periodic
    /// frame then is the periodic cell. [Liu2018] counts them whole.
    #[serde(default)]
    pub shared_sides: bool,
    /// How opposite grains are balanced.
    #[serde(default)]
    pub control: FrameControl,
    /// Damping.
    #[serde(default)]
    pub damping: FrameDamping,
    /// Strain per ramp step.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-6", "exclusiveMinimum" = 0))]
    pub strain_per_step: Option<f64>,
    /// Largest load left over mean normal contact force.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-3", "exclusiveMinimum" = 0))]
    pub tolerance: Option<f64>,
    /// Kinetic over stored energy at the end under local damping. The 1e-3 of [Liu2018] leaves motion.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-6", "exclusiveMinimum" = 0))]
    pub energy_tolerance: Option<f64>,
    /// Residual of opposite boundary loads over mean contact force; default 1e-2 for servo and local damping, otherwise
    /// thirty times the force tolerance.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "x-default" = "by `control` and `damping`", "exclusiveMinimum" = 0))]
    pub servo_tolerance: Option<f64>,
    /// Most relaxation steps of one hold.
    #[serde(default)]
    #[schemars(extend("x-default" = "50000"), range(min = 1))]
    pub max_steps: Option<u32>,
    /// Most corrections of the servo in one trial.
    #[serde(default)]
    #[schemars(extend("x-default" = "500"), range(min = 1))]
    pub most_corrections: Option<u32>,
}

/// Most copies: finding the places of grains takes the square of their number.
const MOST_TILES: u64 = 256;

/// The packing alone.
fn one_tile() -> [u32; 2] {
    [1, 1]
}

impl FrameOptions {
    /// Default options with a constraint.
    pub fn new(constraint: FrameConstraint) -> Self {
        Self {
            constraint,
            tiles: one_tile(),
            shared_sides: false,
            control: FrameControl::Direct,
            damping: FrameDamping::Fire,
            strain_per_step: None,
            tolerance: None,
            energy_tolerance: None,
            servo_tolerance: None,
            max_steps: None,
            most_corrections: None,
        }
    }

    /// The frame that `[rve] frame` asks for, or a periodic one: accuracy and damping are those of the cell.
    ///
    /// # Errors
    /// See [`RveOptions::check_frame`].
    pub(crate) fn of_cell(options: &RveOptions) -> Result<Self, DefinitionError> {
        options.check_frame()?;
        let wanted = options.frame.clone().unwrap_or_default();
        let bare = Self {
            strain_per_step: Some(options.strain_per_step()),
            max_steps: options.max_steps,
            shared_sides: wanted.shared_sides,
            control: wanted.control,
            servo_tolerance: wanted.servo_tolerance,
            most_corrections: wanted.most_corrections,
            ..Self::new(wanted.constraint)
        };
        Ok(if options.damping == Damping::Local {
            let damping = FrameDamping::Local { coefficient: options.local_coefficient() };
            Self { damping, energy_tolerance: Some(options.tolerance()), ..bare }
        } else {
            Self { tolerance: Some(options.tolerance()), ..bare }
        })
    }

    /// Strain per ramp step in force.
    pub fn strain_per_step(&self) -> f64 {
        self.strain_per_step.unwrap_or(1e-6)
    }

    /// Force tolerance in force.
    pub fn tolerance(&self) -> f64 {
        self.tolerance.unwrap_or(1e-3)
    }

    /// Energy tolerance in force.
    pub fn energy_tolerance(&self) -> f64 {
        self.energy_tolerance.unwrap_or(1e-6)
    }

    /// Tolerance of opposite boundary loads in force. Where both grains move as one it follows the force tolerance: the
    /// residual is a norm over the whole boundary.
    pub fn servo_tolerance(&self) -> f64 {
        let follows = self.control == FrameControl::Direct && self.damping == FrameDamping::Fire;
        self.servo_tolerance.unwrap_or(if follows { 30.0 * self.tolerance() } else { 1e-2 })
    }

    /// Ratio of a state that counts as at rest: what the damping in force leaves at the end of a trial.
    pub(crate) fn largest_unbalanced_at_rest(&self) -> f64 {
        match self.damping {
            FrameDamping::Fire => self.tolerance(),
            FrameDamping::Local { .. } => self.servo_tolerance(),
        }
    }

    /// Step cap in force.
    pub fn max_steps(&self) -> u32 {
        self.max_steps.unwrap_or(50_000)
    }

    /// Cap of servo corrections in force.
    pub fn most_corrections(&self) -> u32 {
        self.most_corrections.unwrap_or(500)
    }

    /// Refuses keys of a test file that have no effect with the others.
    ///
    /// # Errors
    /// The key and what it needs.
    pub fn refuse_unused(&self) -> Result<(), DefinitionError> {
        let is_servo = matches!(self.control, FrameControl::Servo { .. });
        let unused = [
            (
                self.energy_tolerance.is_some() && self.damping == FrameDamping::Fire,
                "energy_tolerance",
                "damping = { local = { ... } }",
            ),
            (self.most_corrections.is_some() && !is_servo, "most_corrections", "control = { servo = { ... } }"),
            (
                is_servo && self.constraint != FrameConstraint::Periodic,
                "control = { servo = ... }",
                "constraint = \"periodic\"",
            ),
        ];
        if let Some((_, key, needed)) = unused.iter().find(|(is_unused, ..)| *is_unused) {
            return Err(DefinitionError(format!(
                "frame.{key} has no effect without {needed}; leave it out, or write that"
            )));
        }
        Ok(())
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub fn validate(&self) -> Result<(), DefinitionError> {
        in_declared_ranges(self, "frame")?;
        let [across, up] = self.tiles;
        match u64::from(across) * u64::from(up) {
            1..=MOST_TILES => Ok(()),
            _ => Err(DefinitionError(format!(
                "frame.tiles must be two whole numbers from 1 on, copies of the packing along x and y, {MOST_TILES} in all at most, not \
                 [{across}, {up}]"
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::definition::CellFrame;

    /// The declared default of every numeric key is what the code uses where the key is left out.
    #[test]
    fn declared_defaults_are_those_in_force() {
        let options = FrameOptions::new(FrameConstraint::Periodic);
        let in_force = [
            ("energy_tolerance", options.energy_tolerance()),
            ("max_steps", f64::from(options.max_steps())),
            ("most_corrections", f64::from(options.most_corrections())),
            ("strain_per_step", options.strain_per_step()),
            ("tolerance", options.tolerance()),
        ];
        let declared = |table: &keys::Table| {
            let numeric =
                table.keys.iter().filter_map(|key| Some((key.name.clone(), key.default.parse::<f64>().ok()?)));
            numeric.collect::<Vec<_>>()
        };
        let expected = in_force.map(|(key, value)| (key.to_owned(), value));
        assert_eq!(declared(&keys::Table::of::<FrameOptions>()), expected);
        // The table `[rve] frame` has this one too, and every other accuracy from `[rve]`.
        assert_eq!(declared(&keys::Table::of::<CellFrame>()), expected[2..3]);
    }

    /// They were read and did nothing.
    #[test]
    fn keys_without_effect_are_refused() {
        let periodic = FrameOptions::new(FrameConstraint::Periodic);
        let reason = |options: FrameOptions| options.refuse_unused().unwrap_err().to_string();
        let tolerance = FrameOptions { energy_tolerance: Some(1e-9), ..periodic.clone() };
        assert!(reason(tolerance.clone()).contains("frame.energy_tolerance has no effect"));
        let damping = FrameDamping::Local { coefficient: 0.7 };
        assert!(FrameOptions { damping, ..tolerance }.refuse_unused().is_ok());
        let corrections = FrameOptions { most_corrections: Some(9), ..periodic };
        assert!(reason(corrections).contains("frame.most_corrections"));
    }
}
