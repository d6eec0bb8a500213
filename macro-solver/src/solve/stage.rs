//! From one stage to the next: supports, loads and equations change, the body and its points stay.

use super::driver::{Session, Solver};
use super::equations::Equations;
use super::explicit::Handover;
use super::newton::path::PathConstraint;
use super::newton::quasi_newton::Memory;
use super::newton::tangent_update::TangentUpdater;
use crate::observer::Outcome;
use crate::problem::{Moment, ProblemError, Stage};

impl<'a> Solver<'a> {
    /// The stage under way.
    pub(super) fn stage(&self) -> &'a Stage {
        &self.problem.stages[self.stage]
    }

    /// The moment of the stage at a load factor.
    pub(super) fn moment(&self, load: f64) -> Moment {
        self.stage().moment(load)
    }

    /// Begins the next stage, if there is one, from the committed state.
    ///
    /// # Errors
    /// The observer does not want to go on.
    pub(super) fn enter_next_stage(&mut self, session: &mut Session<'_>) -> Result<bool, Outcome> {
        if self.stage + 1 == self.problem.stages.len() {
            return Ok(false);
        }
        let loads = self.loads.force(&self.body.positions(&self.body.zero()), self.moment(self.load));
        self.handover = Handover::after(self.integrator.take(), &self.constraints, loads);
        self.stage += 1;
        (self.load, self.stage_fraction) = (0.0, 0.0);
        (self.arc_length, self.last_load_change) = (None, 0.0);
        self.step_size = 1.0 / self.stage().control.increments as f64;
        (self.last_step, self.stabilised_in_vain) = (None, None);
        self.stage_start.clone_from(&self.body.displacements);
        self.tangent_kind = self.stage().strategy.tangent;
        self.points.leave_stage(self.stage());
        let counted = self.linear.counts();
        self.set_up().map_err(Outcome::Refused)?;
        self.linear.go_on_counting(counted);
        session.observer.stage_started(self.stage, self.stage());
        Ok(true)
    }

    /// Makes the equations of the stage under way and the balance of the committed state under its loads.
    ///
    /// # Errors
    /// As [`Equations::new`].
    pub(super) fn set_up(&mut self) -> Result<(), ProblemError> {
        self.points.choose(self.problem, self.stage);
        let (stage, coupling) = (self.stage(), self.points.coupling());
        let equations = Equations::new(self.problem, stage, &self.body, &self.stage_start, coupling)?;
        self.statistics.unknowns = equations.constraints.free().len();
        (self.constraints, self.loads, self.linear) = (equations.constraints, equations.loads, equations.linear);
        self.frictions = equations.frictions;
        self.path_constraint = PathConstraint::new(self.problem, self.stage())?;
        let strategy = &self.stage().strategy;
        self.tangents = TangentUpdater::new(strategy.tangent_update, strategy.secant.is_some());
        self.memory = strategy.quasi_newton.as_ref().map(Memory::new);
        self.balance = match self.stage().procedure.solves_equations() {
            true => self.body.balance(&self.body.zero(), &self.points, &self.loads, self.moment(self.load)),
            false => self.forces_at(&self.body.zero(), self.load),
        };
        self.committed_balance.clone_from(&self.balance);
        Ok(())
    }

    /// ` of stage 'NAME'` where there are several.
    pub(super) fn of_stage(&self) -> String {
        match self.problem.stages.len() {
            1 => String::new(),
            _ => format!(" of stage '{}'", self.stage().name),
        }
    }
}
