//! Network operators: every grain of the frozen network finds its own translation and rotation, by one sparse solve.

mod aggregates;
mod assembly;
mod bearing;
mod bicgstab;
mod block_matrix;
mod closeness;
mod conjugate_gradients;
mod elimination;
mod factors;
mod motions;
mod operator;
mod orderings;
mod response;
mod single_precision;
mod solver;
mod two_level;

pub use closeness::Closeness;
pub use motions::NetworkResponses;
pub(super) use operator::solve;
#[cfg(test)]
pub(super) use operator::solve_within;
pub use orderings::Orderings;
