//! Tangent operators `C_ijkl = d sigma_ij / d F_kl` of a frozen contact network.
//!
//! An operator is a pure function of a [`ContactNetwork`]: it moves no grain and reads no history. `F` is measured from
//! the network's own state, so that `C` is the derivative at `F = I`. The network operators let every grain of the frozen
//! network find its own translation and rotation by one sparse solve; the uniform-strain operators force the mean strain
//! upon all grains. Operators that need the grain solver itself are in `probing`. What an operator cannot do honestly is
//! reported in [`TangentOutcome`].

mod calibration;
mod link;
pub mod network;
pub mod perturbation;
mod sliding;
mod strain;
mod uniform_strain;

#[cfg(test)]
mod probe_tests;
#[cfg(test)]
mod sample_networks;
#[cfg(test)]
mod space_tests;
#[cfg(test)]
mod symmetry_tests;
#[cfg(test)]
mod tests;

use crate::cell::{Calibration, ContactNetwork};
use crate::space::Space;
use link::LinkedGrains;
pub use network::Orderings;
use protocol::{TangentKind, Tensor4};
use sliding::Sliding;
use uniform_strain::{Factors, UNCALIBRATED};

/// A plane operator as `[ij][kl]`, pairs ordered 11, 12, 21, 22, Pa.
pub type PlaneOperator = [[f64; 4]; 4];

/// A network operator whose Frobenius norm exceeds that of the uniform-strain operator by this factor is refused. Without
/// prestress the ratio cannot exceed 1; beyond 10 the network stands at a mechanism and the number is an artefact of it.
const LARGEST_RATIO_TO_UNIFORM_STRAIN: f64 = 10.0;

/// A tangent operator with the shortcuts that were needed to get it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentOutcome {
    /// `d sigma_ij / d F_kl`, Pa.
    pub operator: Tensor4,
    /// Whether the operator asked for failed and the uniform-strain operator stands in its place.
    pub fallback: bool,
    /// Whether mechanisms of the network had to be held by a small stiffness of their own.
    pub regularised: bool,
}

impl TangentOutcome {
    /// An operator that needed no shortcut.
    pub(crate) fn exact(operator: Tensor4) -> Self {
        Self { operator, fallback: false, regularised: false }
    }
}

/// Linearises `network`. A network without contacts gives the zero operator, and so do [`TangentKind::None`] and the
/// kinds that cannot be had from a network alone.
///
/// The answer is always finite if the network is: a network operator that is singular, not finite or absurdly stiff is
/// replaced by the uniform-strain operator (UKO) and marked.
pub fn evaluate<S: Space>(network: &ContactNetwork<S>, kind: TangentKind) -> TangentOutcome {
    evaluate_with(&mut Orderings::default(), network, kind)
}

/// As [`evaluate`], with orders of elimination that were found before; they cannot reach a bit of the answer.
pub fn evaluate_with<S: Space>(
    orderings: &mut Orderings,
    network: &ContactNetwork<S>,
    kind: TangentKind,
) -> TangentOutcome {
    if S::DIMENSION == 2 {
        evaluate_linked::<2, 3, 4>(orderings, &LinkedGrains::of(network), kind)
    } else {
        evaluate_linked::<3, 6, 8>(orderings, &LinkedGrains::of(network), kind)
    }
}

/// The uniform-strain operator `kind` with stiffnesses calibrated by these factors.
pub(crate) fn calibrated<S: Space>(network: &ContactNetwork<S>, kind: TangentKind, factors: [f64; 2]) -> Tensor4 {
    let printed = matches!(kind, TangentKind::KruytCalibratedPrinted | TangentKind::KruytTwiceCalibratedPrinted);
    if S::DIMENSION == 2 {
        uniform::<2, 3>(&LinkedGrains::of(network), printed, factors)
    } else {
        uniform::<3, 6>(&LinkedGrains::of(network), printed, factors)
    }
}

/// Calibrates the uniform-strain operators of `network` by a consistent one; `None` if that is noise.
pub(crate) fn calibration<S: Space>(network: &ContactNetwork<S>, consistent: &Tensor4) -> Option<Calibration> {
    if S::DIMENSION == 2 {
        Calibration::of::<2, 3>(&LinkedGrains::of(network), consistent)
    } else {
        Calibration::of::<3, 6>(&LinkedGrains::of(network), consistent)
    }
}

fn uniform<const D: usize, const B: usize>(grains: &LinkedGrains<D>, printed: bool, factors: Factors) -> Tensor4 {
    if printed {
        uniform_strain::kruyt_printed(grains, factors)
    } else {
        uniform_strain::kruyt::<D, B>(grains, factors)
    }
}

fn evaluate_linked<const D: usize, const B: usize, const P: usize>(
    orderings: &mut Orderings,
    grains: &LinkedGrains<D>,
    kind: TangentKind,
) -> TangentOutcome {
    let Some(sliding) = Sliding::of(kind) else {
        return TangentOutcome::exact(match kind {
            TangentKind::Kruyt => uniform::<D, B>(grains, false, UNCALIBRATED),
            TangentKind::KruytPrinted => uniform::<D, B>(grains, true, UNCALIBRATED),
            TangentKind::KruytAugmented => uniform_strain::augmented::<D, B>(grains),
            TangentKind::KruytAugmentedPrinted => uniform_strain::augmented_printed::<D, B>(grains),
            _ => Tensor4::ZERO,
        });
    };
    let solved = network::solve::<D, B, P>(orderings, grains, sliding);
    let uniform = uniform::<D, B>(grains, false, UNCALIBRATED);
    match solved {
        Some(solution) if is_credible(&solution.operator, &uniform) => {
            TangentOutcome { operator: solution.operator, fallback: false, regularised: solution.regularised }
        }
        _ => TangentOutcome { operator: uniform, fallback: true, regularised: false },
    }
}

fn is_credible(operator: &Tensor4, uniform: &Tensor4) -> bool {
    // A NaN makes the comparison false.
    frobenius_norm(operator) <= LARGEST_RATIO_TO_UNIFORM_STRAIN * frobenius_norm(uniform)
}

fn frobenius_norm(operator: &Tensor4) -> f64 {
    operator.0.iter().map(|value| value * value).sum::<f64>().sqrt()
}
