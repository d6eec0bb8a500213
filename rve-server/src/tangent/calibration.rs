//! Factors that make the uniform-strain operators less stiff, from a consistent operator.

use super::link::LinkedGrains;
use super::method::Factors;
use super::uniform_strain::kruyt;
use crate::cell::Calibration;
use protocol::Tensor4;

/// The single factor of UCKO ([Argilaga2018] eq. 16) matches `C_1111` of the consistent operator, the two of
/// UCKO-2DOF (eq. 17) match `C_1111` and `C_1122`. `None` if neither gives positive numbers: then the consistent operator
/// is noise. On a path that is not isotropic `C_1122` alone may well ask for a negative factor; that is no fault of UCKO.
pub(super) fn of<const D: usize, const B: usize>(
    grains: &LinkedGrains<D>,
    consistent: &Tensor4,
) -> Option<Calibration> {
    let normal = kruyt::<D, B>(grains, [1.0, 0.0]);
    let tangential = kruyt::<D, B>(grains, [0.0, 1.0]);
    let uniaxial = [normal.get(0, 0, 0, 0), tangential.get(0, 0, 0, 0), consistent.get(0, 0, 0, 0)];
    let lateral = [normal.get(0, 0, 1, 1), tangential.get(0, 0, 1, 1), consistent.get(0, 0, 1, 1)];
    let single = uniaxial[2] / (uniaxial[0] + uniaxial[1]);
    let determinant = uniaxial[0] * lateral[1] - uniaxial[1] * lateral[0];
    // Without tangential stiffness there is nothing that a second factor could scale.
    let pair = if tangential.0.iter().all(|value| *value == 0.0) {
        [single; 2]
    } else {
        [
            (uniaxial[2] * lateral[1] - uniaxial[1] * lateral[2]) / determinant,
            (uniaxial[0] * lateral[2] - uniaxial[2] * lateral[0]) / determinant,
        ]
    };
    let is_usable = |factor: f64| factor.is_finite() && factor > 0.0;
    let single = if is_usable(single) { single } else { 0.0 };
    let pair = if pair.into_iter().all(is_usable) { pair } else { [0.0; 2] };
    (single > 0.0 || pair[0] > 0.0).then_some(Calibration { single, pair })
}

/// The factors of `k_n` and `k_t`; `None` if the calibration has none.
pub(super) fn stiffness_factors(calibration: &Calibration, factors: Factors) -> Option<[f64; 2]> {
    let factors = match factors {
        Factors::Single => [calibration.single; 2],
        Factors::Pair => calibration.pair,
    };
    (factors[0] > 0.0).then_some(factors)
}
