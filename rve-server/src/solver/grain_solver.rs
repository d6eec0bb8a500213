//! The seam of the grain solvers: what is asked of them, and what they answer.

use super::answered_by::AnsweredBy;
use super::linear::LinearResponses;
use crate::cell::{ContactNetwork, GrainState};
use crate::definition::GrainModel;
use crate::space::{Space, Tensor};
use protocol::RveError;
use std::fmt::Debug;

/// A stretch to be solved.
#[derive(Clone, Copy, Debug)]
pub struct SolveJob<'a, S: Space> {
    /// State to start from.
    pub state: &'a GrainState<S>,
    /// `U - I`: the pure stretch, dimensionless. The caller turns the result by the rotation.
    pub strain: S::Tensor,
    /// Increments of the ramp; with 0 the state is evaluated as it is, and nothing moves.
    pub ramp_steps: u32,
    /// Whether the work on the cell is summed up; no other result depends on it.
    pub counts_work: bool,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// Contact-force evaluations spent.
    pub force_evaluations: u64,
    /// Increments of the ramp.
    pub ramp_steps: u32,
    /// Value of the equilibrium criterion.
    pub unbalanced: f64,
    /// Whether the criterion is met.
    pub equilibrated: bool,
    /// Whether the contacts carry load, see [`GrainState::bears_load`].
    pub bears_load: bool,
    /// Whether the solver changed its damping because the grains did not come to rest with the one chosen.
    pub changed_damping: bool,
    /// How the answer was found.
    pub answered_by: AnsweredBy,
    /// Work of the contact forces on the affine motion of the cell, J, if it is wanted and what answered has steps to count.
    pub work: Option<f64>,
    /// Work and damping along the solve, if they are [counted](GrainSolver::count_energies) and what answered has steps to count.
    pub energies: Option<PathEnergies>,
}

/// Energies that are summed up step by step: `work` = change of the stored energy + friction and contact viscosity + `damping`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathEnergies {
    /// Work of the contact forces on the affine motion of the cell, J: what is done on it from outside.
    pub work: f64,
    /// Energy that numerical damping takes, J: the work of the forces out of balance on the motion against the affine one, which no state
    /// keeps as kinetic energy.
    pub damping: f64,
}

/// The end of a solve.
#[derive(Clone, Debug, PartialEq)]
pub struct End<S: Space> {
    /// How it ended.
    pub solved: Solved,
    /// The cell after the stretch, before any rotation.
    pub state: GrainState<S>,
    /// Whether each contact of the state was at the friction limit in most samples of the second half of the ramp.
    pub slid: Vec<bool>,
}

/// A solver for the grains of one packing and one contact law.
///
/// An end depends on its job and the model alone, to the last bit. What a solver keeps from call to call is working memory
/// that makes it faster.
pub trait GrainSolver<S: Space>: Debug + Send + Sync {
    /// Stretches each state by `I + strain` and brings it to equilibrium; one end per job, in their order. A solver may work
    /// on several jobs at once.
    ///
    /// # Errors
    /// Per job: [`RveError::NotFinite`], [`RveError::NotEquilibrated`].
    fn solve(&mut self, model: &GrainModel, jobs: &[SolveJob<'_, S>]) -> Vec<Result<End<S>, RveError>>;

    /// The contacts of an end, frozen.
    fn network(&self, model: &GrainModel, end: &End<S>) -> ContactNetwork<S>;

    /// Energy stored in the contacts of a state that this solver has left, J.
    fn elastic_energy(&self, model: &GrainModel, state: &GrainState<S>) -> f64;

    /// Whether several jobs are solved side by side in lanes; a solver without lanes has no such choice.
    fn use_lanes(&mut self, _uses_lanes: bool) {}

    /// Whether work and damping are summed up along the steps; no other result depends on it. A solver without steps has no such choice.
    fn count_energies(&mut self, _counts: bool) {}

    /// Gives the solver the linear responses that it may use; a solver without such a use has no such choice.
    fn use_responses(&mut self, _responses: Box<dyn LinearResponses>) {}

    /// A solver for the same law without any working memory.
    fn new_instance(&self) -> Box<dyn GrainSolver<S>>;
}

impl<S: Space> dyn GrainSolver<S> + '_ {
    /// Solves one job.
    ///
    /// # Errors
    /// As [`solve`](GrainSolver::solve).
    pub fn solve_one(&mut self, model: &GrainModel, job: SolveJob<'_, S>) -> Result<End<S>, RveError> {
        self.solve(model, &[job]).pop().expect("one job, one end")
    }

    /// Evaluates the contacts of a state as it is: nothing moves.
    ///
    /// # Errors
    /// [`RveError::NotFinite`] where the forces are not finite.
    pub fn evaluate_state(&mut self, model: &GrainModel, state: &GrainState<S>) -> Result<End<S>, RveError> {
        self.solve_one(model, SolveJob { state, strain: S::Tensor::ZERO, ramp_steps: 0, counts_work: false })
    }
}
