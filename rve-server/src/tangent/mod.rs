//! Tangent operators `C_ijkl = d sigma_ij / d F_kl` of a frozen contact network.
//!
//! An operator is a pure function of a [`ContactNetwork`]: it moves no grain and reads no history. `F` is measured from
//! the network's own state, so that `C` is the derivative at `F = I`. The network operators let every grain of the frozen
//! network find its own translation and rotation by one sparse solve; the uniform-strain operators force the mean strain
//! upon all grains. Operators that need the grain solver itself are in `perturbation`. What an operator cannot do honestly is
//! reported in [`TangentOutcome`].

mod calibration;
mod evaluate;
mod link;
mod method;
pub mod network;
mod outcome;
pub(crate) mod perturbation;
mod sliding;
mod strain;
mod uniform_strain;

#[cfg(test)]
mod perturbation_tests;
#[cfg(test)]
mod sample_networks;
#[cfg(test)]
mod space_tests;
#[cfg(test)]
mod symmetry_tests;
#[cfg(test)]
mod tests;

pub(crate) use evaluate::{evaluate, evaluate_with};
pub use method::needs_grain_solver;
pub(crate) use method::{FrozenMethod, Method, Perturbation};
pub use network::{Closeness, Orderings};
pub use outcome::{OperatorEvaluation, TangentOutcome};
