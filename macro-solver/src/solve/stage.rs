//! From one stage to the next: supports, loads and equations change, the body and its points stay.

use super::driver::{Session, Solver};
use super::linear_solver::LinearSolver;
use super::newton::path::Constraint;
use super::newton::quasi_newton::Memory;
use super::newton::tangent_update::TangentUpdater;
use crate::model::assembly::block::BlockDofs;
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use crate::model::friction::Frictions;
use crate::model::loads::Loads;
use crate::model::points::Coupling;
use crate::observer::Outcome;
use crate::problem::elimination::dependents;
use crate::problem::{Moment, Problem, ProblemError, Stage};

/// What a stage prescribes, ready for the solver.
pub(super) struct Equations {
    pub(super) constraints: Constraints,
    pub(super) loads: Loads,
    pub(super) frictions: Frictions,
    pub(super) linear: LinearSolver,
}

impl Equations {
    /// The equations of a stage that begins with the displacements `start`, m, and whose points are coupled by averages over
    /// neighbours or not.
    ///
    /// # Errors
    /// A condition that does not fit the mesh.
    pub(super) fn new(
        problem: &Problem,
        stage: &Stage,
        body: &Body,
        start: &[f64],
        coupling: Option<&Coupling>,
    ) -> Result<Self, ProblemError> {
        let prescribed = problem.prescribed_displacements(stage)?;
        // About where the stage begins, also when a run goes on within it.
        let equations = problem.equations(stage, &body.positions_at(start))?;
        let constraints = Constraints::new(&prescribed, &dependents(&equations, &prescribed)?, start);
        let loads = Loads::new(problem, stage)?;
        let block_dofs: Vec<BlockDofs> =
            body.block_dofs(&loads, coupling).iter().map(|dofs| constraints.condensed_dofs(dofs)).collect();
        let linear = LinearSolver::new(block_dofs.iter(), &constraints, problem.equations);
        let frictions = Frictions::new(problem, stage, body)?;
        Ok(Self { constraints, loads, frictions, linear })
    }
}

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
        self.stage += 1;
        (self.load, self.stage_fraction) = (0.0, 0.0);
        (self.arc_length, self.last_load_change) = (None, 0.0);
        self.step_size = 1.0 / self.stage().control.increments as f64;
        (self.last_increment, self.stabilised_in_vain) = (None, false);
        self.carried_velocity = self.integrator.take().map(|integrator| integrator.velocity().to_vec());
        self.stage_start.clone_from(&self.body.displacements);
        self.tangent_kind = self.stage().strategy.tangent;
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
        self.constraint = Constraint::new(self.problem, &self.stage().control.path)?;
        let strategy = &self.stage().strategy;
        self.tangents = TangentUpdater::new(strategy.tangent_update, strategy.secant.is_some());
        self.memory = strategy.quasi_newton.as_ref().map(Memory::new);
        let moment = self.moment(self.load);
        self.balance = self.body.balance(&self.body.zero(), &self.points, &self.loads, moment);
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
