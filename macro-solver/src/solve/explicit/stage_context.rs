//! The parts of the driver that a dynamic stage moves.

use super::constrained_velocities::VelocityConstraints;
use super::dashpots::Dashpots;
use crate::material::PointMaterial;
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use crate::model::failure::Failure;
use crate::model::friction::Frictions;
use crate::model::loads::Loads;
use crate::model::points::Points;
use crate::observer::{Outcome, Statistics};
use crate::problem::dynamics::DynamicSettings;
use crate::problem::{Moment, Problem, ProblemError, Stage};
use crate::solve::driver::timed;
use nalgebra::Matrix3;
use protocol::TangentKind;

/// Borrowed from the driver for one time step, or for the start of a stage.
pub(crate) struct StageContext<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) stage: &'a Stage,
    pub(crate) settings: &'a DynamicSettings,
    pub(crate) body: &'a mut Body,
    pub(crate) points: &'a mut Points,
    pub(crate) constraints: &'a Constraints,
    pub(crate) loads: &'a Loads,
    pub(crate) frictions: &'a Frictions,
    pub(crate) statistics: &'a mut Statistics,
}

impl StageContext<'_> {
    /// The velocity constraints of the stage between nodes with these dampers.
    pub(super) fn velocity_constraints(&self, dashpots: &Dashpots) -> Result<VelocityConstraints, ProblemError> {
        let axes = self.problem.mesh.dimension.count();
        VelocityConstraints::of_stage(self.constraints, |dof| dashpots.is_oblique(dof / axes, dof % axes))
    }

    /// Evaluates the points at the gradients of a step, with the friction at a moment.
    ///
    /// # Errors
    /// The end of the run; [`Outcome::DidNotConverge`] if a point refuses its trial even in parts.
    pub(super) fn evaluate_points(
        &mut self,
        gradients: &[Matrix3<f64>],
        moment: Moment,
        tangent: TangentKind,
        material: &mut dyn PointMaterial,
    ) -> Result<(), Outcome> {
        self.points.set_friction(&self.frictions.reductions(moment));
        let mut waiting = 0;
        let answered =
            timed(&mut waiting, || self.points.evaluate_in_parts(gradients, tangent, material, self.statistics));
        self.statistics.material_nanoseconds += waiting;
        match answered {
            Ok(_) => Ok(()),
            Err(Failure::Attempt(reason)) => Err(Outcome::DidNotConverge { reason }),
            Err(Failure::Run(outcome)) => Err(outcome),
        }
    }
}
