//! Grain solvers: from the state of a cell and a stretch to the next equilibrium.
//!
//! [`GrainSolver`] is the seam. A second solver is a folder next to `relaxation`, a [`SolverName`], and an arm of
//! `solver_of`; the key `[rve] solver` then chooses it.

mod event_driven;
pub mod kernel;
mod relaxation;

pub use event_driven::{Course, DiscMotions, DiscPair, LinearResponses};
pub(crate) use relaxation::{Advice, ConvergenceMonitor, Imbalance, descent_share, side_by_side};

use crate::cell::{ContactNetwork, GrainState};
use crate::contact::{ContactLaws, ContactTable};
use crate::definition::{DefinedSpace, GrainModel, SolverName};
use crate::error::DefinitionError;
use crate::space::{Discs, Space, Spheres, Tensor, largest_component};
use protocol::RveError;
use std::fmt::Debug;

/// Fewest ramp increments that the engine chooses by itself.
const FEWEST_RAMP_STEPS: u32 = 5;

/// Number of ramp increments for a strain where the request leaves the choice to the engine.
pub(crate) fn chosen_ramp_steps<T: Tensor>(strain: &T, strain_per_step: f64) -> u32 {
    let steps = (largest_component(strain) / strain_per_step).ceil();
    (steps.min(f64::from(u32::MAX)) as u32).max(FEWEST_RAMP_STEPS)
}

/// A stretch to be solved.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a, S: Space> {
    /// State to start from.
    pub state: &'a GrainState<S>,
    /// `U - I`: the pure stretch, dimensionless. The caller turns the result by the rotation.
    pub strain: S::Tensor,
    /// Increments of the ramp; with 0 the state is evaluated as it is, and nothing moves.
    pub ramp_steps: u32,
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
    pub course: Course,
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
    fn solve(&mut self, model: &GrainModel, jobs: &[Job<'_, S>]) -> Vec<Result<End<S>, RveError>>;

    /// The contacts of an end, frozen.
    fn network(&self, model: &GrainModel, end: &End<S>) -> ContactNetwork<S>;

    /// Energy stored in the contacts of a state that this solver has left, J.
    fn elastic_energy(&self, model: &GrainModel, state: &GrainState<S>) -> f64;

    /// Whether several jobs are solved side by side in lanes; a solver without lanes has no such choice.
    fn use_lanes(&mut self, _uses_lanes: bool) {}

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
    pub fn solve_one(&mut self, model: &GrainModel, job: Job<'_, S>) -> Result<End<S>, RveError> {
        self.solve(model, &[job]).pop().expect("one job, one end")
    }

    /// Evaluates the contacts of a state as it is: nothing moves.
    ///
    /// # Errors
    /// [`RveError::NotFinite`] where the forces are not finite.
    pub fn evaluate_state(&mut self, model: &GrainModel, state: &GrainState<S>) -> Result<End<S>, RveError> {
        self.solve_one(model, Job { state, strain: S::Tensor::ZERO, ramp_steps: 0 })
    }
}

/// Spaces whose grains can be solved for. The method is not generic, unlike what it calls: the kernels are compiled once per
/// space, in this crate, and not again in every program that uses it.
pub trait SolverFor: DefinedSpace {
    /// The solver of this name for a contact law.
    ///
    /// # Errors
    /// A table that is not valid.
    fn solver(name: SolverName, contact: &ContactTable) -> Result<Box<dyn GrainSolver<Self>>, DefinitionError>;
}

impl SolverFor for Discs {
    fn solver(name: SolverName, contact: &ContactTable) -> Result<Box<dyn GrainSolver<Self>>, DefinitionError> {
        match name {
            SolverName::EventDriven => event_driven::for_discs(contact),
            SolverName::Relaxation => solver_of(name, contact),
        }
    }
}

impl SolverFor for Spheres {
    fn solver(name: SolverName, contact: &ContactTable) -> Result<Box<dyn GrainSolver<Self>>, DefinitionError> {
        solver_of(name, contact)
    }
}

/// The registry of solvers for any grains.
fn solver_of<S: Space<Kernel: ContactLaws>>(
    name: SolverName,
    contact: &ContactTable,
) -> Result<Box<dyn GrainSolver<S>>, DefinitionError> {
    match name {
        SolverName::Relaxation => relaxation::for_contact(contact),
        SolverName::EventDriven => event_driven::for_others(contact),
    }
}
