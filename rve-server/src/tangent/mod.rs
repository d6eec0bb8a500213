//! Tangent operators `C_ijkl = d sigma_ij / d F_kl` of a frozen contact network.
//!
//! An operator is a pure function of a [`ContactNetwork`]: it moves no grain and reads no history. `F` is measured from
//! the network's own state, so that `C` is the derivative at `F = I`. The network operators ([`truss_like`], [`slip`])
//! let every grain of the frozen network find its own translation and rotation by one sparse solve; [`kruyt`] forces the
//! mean strain upon all grains. What a network operator cannot do honestly is reported in [`TangentOutcome`].

mod assembly;
mod backbone;
mod block_factors;
mod block_matrix;
mod contact_stiffness;
pub mod kruyt;
mod network_operator;
mod network_solver;
pub mod slip;
pub mod truss_like;

#[cfg(test)]
mod probe_tests;
#[cfg(test)]
mod sample_networks;
#[cfg(test)]
mod tests;

use crate::network::ContactNetwork;
use protocol::TangentKind;

/// A plane operator as `[ij][kl]`, pairs ordered 11, 12, 21, 22, Pa.
pub type PlaneOperator = [[f64; 4]; 4];

/// A network operator whose Frobenius norm exceeds that of the uniform-strain operator by this factor is refused. Without
/// prestress the ratio cannot exceed 1; beyond 10 the network stands at a mechanism and the number is an artefact of it.
const LARGEST_RATIO_TO_UNIFORM_STRAIN: f64 = 10.0;

/// A tangent operator with the shortcuts that were needed to get it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentOutcome {
    /// `d sigma_ij / d F_kl` as `[ij][kl]`, pairs ordered 11, 12, 21, 22, Pa.
    pub operator: PlaneOperator,
    /// Whether the network operator failed and the uniform-strain operator stands in its place.
    pub fallback: bool,
    /// Whether mechanisms of the network had to be held by a small stiffness of their own.
    pub regularised: bool,
}

/// Linearises `network`. [`TangentKind::None`] and a network without contacts give the zero operator.
///
/// The answer is always finite if the network is: a network operator that is singular, not finite or absurdly stiff is
/// replaced by [`kruyt::operator`] and marked.
pub fn evaluate(network: &ContactNetwork, kind: TangentKind) -> TangentOutcome {
    let solved = match kind {
        TangentKind::None => return TangentOutcome { operator: [[0.0; 4]; 4], fallback: false, regularised: false },
        TangentKind::Kruyt => None,
        TangentKind::TrussLike => Some(truss_like::operator(network)),
        TangentKind::TrussLikeSlip => Some(slip::operator(network)),
    };
    let uniform = kruyt::operator(network);
    match solved {
        None => TangentOutcome { operator: uniform, fallback: false, regularised: false },
        Some(Some(solution)) if is_credible(&solution.operator, &uniform) => {
            TangentOutcome { operator: solution.operator, fallback: false, regularised: solution.regularised }
        }
        Some(_) => TangentOutcome { operator: uniform, fallback: true, regularised: false },
    }
}

fn is_credible(operator: &PlaneOperator, uniform: &PlaneOperator) -> bool {
    // A NaN makes the comparison false.
    frobenius_norm(operator) <= LARGEST_RATIO_TO_UNIFORM_STRAIN * frobenius_norm(uniform)
}

fn frobenius_norm(operator: &PlaneOperator) -> f64 {
    operator.iter().flatten().map(|value| value * value).sum::<f64>().sqrt()
}

/// Volume of the cell, m3.
fn volume(network: &ContactNetwork) -> f64 {
    let [first, second] = network.cell;
    (first[0] * second[1] - first[1] * second[0]).abs() * network.thickness
}
