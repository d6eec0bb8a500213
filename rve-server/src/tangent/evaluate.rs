//! Operators that need the frozen network alone.

use super::link::LinkedGrains;
use super::method::{Form, FrozenMethod, UniformStrain};
use super::network::{self, Closeness, Orderings};
use super::outcome::TangentOutcome;
use super::uniform_strain::UNCALIBRATED;
use super::{calibration, uniform_strain};
use crate::cell::{Calibration, ContactNetwork};
use crate::space::Space;
use protocol::Tensor4;

/// A network operator whose Frobenius norm exceeds that of the uniform-strain operator by this factor is refused. Without
/// prestress the ratio cannot exceed 1; beyond 10 the network stands at a mechanism and the number is an artefact of it.
const LARGEST_RATIO_TO_UNIFORM_STRAIN: f64 = 10.0;

/// Linearises `network`, Pa. A network without contacts gives the zero operator.
///
/// The answer is always finite if the network is: a network operator that is singular, not finite or absurdly stiff is
/// replaced by the uniform-strain operator (UKO) and marked.
pub(crate) fn evaluate<S: Space>(network: &ContactNetwork<S>, method: FrozenMethod) -> TangentOutcome {
    evaluate_with(&mut Orderings::default(), network, method, Closeness::RESULT)
}

/// As [`evaluate`], as close as wanted, with orders of elimination that were found before; they cannot reach a bit of the answer.
pub(crate) fn evaluate_with<S: Space>(
    orderings: &mut Orderings,
    network: &ContactNetwork<S>,
    method: FrozenMethod,
    closeness: Closeness,
) -> TangentOutcome {
    if S::DIMENSION == 2 {
        evaluate_discs(orderings, &LinkedGrains::of(network), method, closeness)
    } else {
        evaluate_spheres(orderings, &LinkedGrains::of(network), method, closeness)
    }
}

/// Not generic, unlike what it calls: the sparse solvers are compiled once, in this crate.
#[inline(never)]
fn evaluate_discs(
    orderings: &mut Orderings,
    grains: &LinkedGrains<2>,
    method: FrozenMethod,
    closeness: Closeness,
) -> TangentOutcome {
    evaluate_linked::<2, 3, 4>(orderings, grains, method, closeness)
}

/// As [`evaluate_discs`].
#[inline(never)]
fn evaluate_spheres(
    orderings: &mut Orderings,
    grains: &LinkedGrains<3>,
    method: FrozenMethod,
    closeness: Closeness,
) -> TangentOutcome {
    evaluate_linked::<3, 6, 8>(orderings, grains, method, closeness)
}

/// The uniform-strain operator with stiffnesses calibrated by these factors.
pub(super) fn calibrated<S: Space>(network: &ContactNetwork<S>, form: Form, factors: [f64; 2]) -> Tensor4 {
    if S::DIMENSION == 2 {
        uniform::<2, 3>(&LinkedGrains::of(network), form, factors)
    } else {
        uniform::<3, 6>(&LinkedGrains::of(network), form, factors)
    }
}

/// Calibrates the uniform-strain operators of `network` by a consistent one; `None` if that is noise.
pub(super) fn calibration<S: Space>(network: &ContactNetwork<S>, consistent: &Tensor4) -> Option<Calibration> {
    if S::DIMENSION == 2 {
        calibration::of::<2, 3>(&LinkedGrains::of(network), consistent)
    } else {
        calibration::of::<3, 6>(&LinkedGrains::of(network), consistent)
    }
}

fn uniform<const D: usize, const B: usize>(grains: &LinkedGrains<D>, form: Form, factors: [f64; 2]) -> Tensor4 {
    match form {
        Form::Objective => uniform_strain::kruyt::<D, B>(grains, factors),
        Form::Printed => uniform_strain::kruyt_printed(grains, factors),
    }
}

fn evaluate_linked<const D: usize, const B: usize, const P: usize>(
    orderings: &mut Orderings,
    grains: &LinkedGrains<D>,
    method: FrozenMethod,
    closeness: Closeness,
) -> TangentOutcome {
    let sliding = match method {
        FrozenMethod::Network(sliding) => sliding,
        FrozenMethod::UniformStrain(UniformStrain::Plain(form)) => {
            return TangentOutcome::exact(uniform::<D, B>(grains, form, UNCALIBRATED));
        }
        FrozenMethod::UniformStrain(UniformStrain::Augmented(Form::Objective)) => {
            return TangentOutcome::exact(uniform_strain::augmented::<D, B>(grains));
        }
        FrozenMethod::UniformStrain(UniformStrain::Augmented(Form::Printed)) => {
            return TangentOutcome::exact(uniform_strain::augmented_printed::<D, B>(grains));
        }
    };
    let solved = network::solve::<D, B, P>(orderings, grains, sliding, closeness);
    let uniform = uniform::<D, B>(grains, Form::Objective, UNCALIBRATED);
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

pub(super) fn frobenius_norm(operator: &Tensor4) -> f64 {
    operator.0.iter().map(|value| value * value).sum::<f64>().sqrt()
}
