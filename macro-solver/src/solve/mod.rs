//! Solution of a problem, stage after stage.
//!
//! [`driver`] takes steps along the stages of a run, whatever their procedure; `newton`, `relaxation` and `explicit` are the
//! procedures. They share the rooms of `model`: body, points, constraints, loads, assembly of the elements.

mod checkpoint;
mod driver;
mod explicit;
mod fields;
mod initial;
mod linear_solver;
mod newton;
mod relaxation;
mod stabilisation;
mod stage;
#[cfg(test)]
pub(crate) mod tests;

pub use driver::{solve, solve_kept};
