//! Grain solvers: from the state of a cell and a stretch to the next equilibrium.
//!
//! [`GrainSolver`] is the seam. A second solver is a folder next to `relaxation`, a [`SolverName`], and an arm of
//! `solver_of`; the key `[rve] solver` then chooses it.

mod answered_by;
mod event_driven;
mod grain_solver;
pub mod kernel;
mod linear;
mod relaxation;

pub use answered_by::AnsweredBy;
pub use grain_solver::{End, GrainSolver, PathEnergies, SolveJob, Solved};
pub use linear::{DiscMotions, DiscPair, LinearResponses};
pub(crate) use relaxation::{
    Advice, ConvergenceMonitor, Imbalance, LEAST_LOAD, descent_share, holds_together_far_from_rest, side_by_side,
};

use crate::contact::{ContactLaws, ContactTable};
use crate::definition::{DefinedSpace, SolverName};
use crate::error::DefinitionError;
use crate::space::{Discs, Space, Spheres, Tensor, largest_component};

/// Fewest ramp increments that the engine chooses by itself.
const FEWEST_RAMP_STEPS: u32 = 5;

/// Number of ramp increments for a strain where the request leaves the choice to the engine.
pub(crate) fn chosen_ramp_steps<T: Tensor>(strain: &T, strain_per_step: f64) -> u32 {
    let steps = (largest_component(strain) / strain_per_step).ceil();
    (steps.min(f64::from(u32::MAX)) as u32).max(FEWEST_RAMP_STEPS)
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
