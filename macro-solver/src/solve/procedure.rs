//! The procedures of stages, one folder each, and the one list that maps a stage's [`Procedure`] to its folder.

use super::accepted::Attempted;
use super::driver::{Session, Solver};
use super::newton::Newton;
use crate::model::failure::Failure;
use crate::problem::Procedure;
use crate::problem::dynamics::DynamicSettings;

/// How the driver takes a stage to its end.
pub(super) enum StageMethod<'a> {
    /// Load steps from one equilibrium to the next.
    LoadSteps(&'a dyn LoadStepMethod),
    /// Time steps of a motion.
    Motion(&'a DynamicSettings),
}

impl<'a> StageMethod<'a> {
    /// The method of a procedure: the list.
    pub(super) fn of(procedure: &'a Procedure) -> Self {
        match procedure {
            Procedure::Implicit => Self::LoadSteps(&Newton),
            Procedure::Relaxation(settings) => Self::LoadSteps(settings),
            Procedure::Dynamic(settings) => Self::Motion(settings),
        }
    }
}

/// Finds the equilibrium at the end of one load step.
pub(super) trait LoadStepMethod {
    /// Tries to reach the share `stage_fraction` of the stage's path from the committed state; `again` after a failed attempt at
    /// this step. Nothing is committed, by an unfinished attempt neither.
    ///
    /// # Errors
    /// [`Failure::Attempt`] if a smaller step may help, otherwise the end of the run.
    fn attempt(
        &self,
        solver: &mut Solver<'_>,
        stage_fraction: f64,
        again: bool,
        session: &mut Session<'_>,
    ) -> Result<Attempted, Failure>;

    /// Whether the number of iterations measures how hard a step was, so that it governs the size of the next one.
    fn iterations_govern_step_size(&self) -> bool;

    /// Whether a step that does not converge may be stabilised.
    fn can_be_stabilised(&self) -> bool;
}
