//! Solution of a problem, stage after stage.
//!
//! The `driver` takes load steps or time steps along the stages of a run; `procedure` lists the procedures, each in a folder of
//! its own: `newton`, `relaxation`, `explicit`. They share body, points, constraints, loads and the assembly of the elements,
//! which are in `crate::model`. `evaluation` has the points answer an iterate and assembles the balance, `convergence` measures how
//! far it is from the end of its step. A new procedure is a folder here and a line in `procedure`.

mod accepted;
mod balance_error;
mod checkpoint;
mod convergence;
mod driver;
mod equations;
mod equilibrium_stress;
mod evaluation;
mod explicit;
mod initial;
mod linear_solver;
mod newton;
mod procedure;
mod relaxation;
mod report;
mod residual_norms;
mod stabilisation;
mod stage;
mod step_ends;
#[cfg(test)]
pub(crate) mod tests;
mod vectors;

pub use crate::model::points::CouplingSize;
pub use driver::{solve, solve_with_checkpoints};
pub use equilibrium_stress::{EquilibriumError, equilibrium_stress};
