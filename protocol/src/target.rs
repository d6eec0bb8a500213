//! Which target deformations make sense for every engine. How large one may be is for the engine to say.

use crate::rve_error::RveError;
use crate::tensor::Tensor2;

/// Refuses a target `H = F - I` that no engine can follow. `dimension` is that of the packing, 2 or 3.
///
/// # Errors
/// [`RveError::TargetNotFinite`]; [`RveError::Unsupported`] where discs should deform out of their plane;
/// [`RveError::TargetInverted`] for `det F <= 0`.
pub fn check(target: &Tensor2, dimension: usize) -> Result<(), RveError> {
    if !target.is_finite() {
        return Err(RveError::TargetNotFinite);
    }
    if dimension == 2 && *target != Tensor2::from_plane(target.plane()) {
        return Err(RveError::Unsupported("deformation out of the plane".into()));
    }
    let determinant = determinant_of_deformation(target);
    if determinant <= 0.0 {
        return Err(RveError::TargetInverted { determinant });
    }
    Ok(())
}

/// `det(I + H)`: the first row times the vector product of the others. For a plane `H` it is `F11 F22 - F12 F21`, to the last bit.
fn determinant_of_deformation(h: &Tensor2) -> f64 {
    let f = |i: usize, j: usize| h.get(i, j) + f64::from(u8::from(i == j));
    let minor = |j: usize, k: usize| f(1, j) * f(2, k) - f(1, k) * f(2, j);
    f(0, 0) * minor(1, 2) + f(0, 1) * minor(2, 0) + f(0, 2) * minor(0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_near_the_unit_tensor_are_accepted() {
        let shear = Tensor2::from_plane([[0.01, 0.3], [-0.2, -0.02]]);
        for dimension in [2, 3] {
            assert_eq!(check(&Tensor2::ZERO, dimension), Ok(()));
            assert_eq!(check(&shear, dimension), Ok(()));
        }
    }

    #[test]
    fn one_component_that_is_no_number_is_refused_before_all_else() {
        for value in [f64::NAN, f64::INFINITY] {
            for place in 0..9 {
                let mut target = Tensor2::from_plane([[-2.0, 0.0], [0.0, 0.0]]);
                target.0[place] = value;
                assert_eq!(check(&target, 2), Err(RveError::TargetNotFinite));
                assert_eq!(check(&target, 3), Err(RveError::TargetNotFinite));
            }
        }
    }

    #[test]
    fn only_discs_refuse_deformation_out_of_the_plane() {
        for place in [2, 5, 6, 7, 8] {
            let mut target = Tensor2::ZERO;
            target.0[place] = 1e-9;
            assert!(matches!(check(&target, 2), Err(RveError::Unsupported(_))), "{place}");
            assert_eq!(check(&target, 3), Ok(()), "{place}");
        }
    }

    #[test]
    fn a_minus_before_a_zero_is_no_deformation_out_of_the_plane() {
        let mut target = Tensor2::ZERO;
        target.0[8] = -0.0;
        assert_eq!(check(&target, 2), Ok(()));
    }

    #[test]
    fn cells_turned_inside_out_or_pressed_flat_are_refused() {
        let pressed = |xx: f64| Tensor2::from_plane([[xx, 0.0], [0.0, 1.0]]);
        for dimension in [2, 3] {
            let refusal = |determinant| Err(RveError::TargetInverted { determinant });
            assert_eq!(check(&pressed(-1.0), dimension), refusal(0.0));
            assert_eq!(check(&pressed(-2.0), dimension), refusal(-2.0));
        }
    }

    #[test]
    fn determinant_of_a_full_tensor_is_that_of_its_expansion() {
        let rows = [[0.5, 2.0, -1.0], [3.0, 0.25, 4.0], [-2.0, 1.0, 1.5]];
        let [[a, b, c], [d, e, f], [g, h, i]] = [[1.5, 2.0, -1.0], [3.0, 1.25, 4.0], [-2.0, 1.0, 2.5]];
        let expanded: f64 = a * e * i + b * f * g + c * d * h - c * e * g - b * d * i - a * f * h;
        assert_eq!(determinant_of_deformation(&Tensor2::from_rows(&rows)), expanded);
    }

    #[test]
    fn determinant_of_a_plane_tensor_has_the_bits_of_two_products() {
        let mut value = 0.123_456_789_f64;
        for _ in 0..100 {
            let mut next = || {
                value = (997.0 * value).fract();
                value - 0.5
            };
            let plane = [[next(), next()], [next(), next()]];
            let products = (plane[0][0] + 1.0) * (plane[1][1] + 1.0) - plane[0][1] * plane[1][0];
            let found = determinant_of_deformation(&Tensor2::from_plane(plane));
            assert_eq!(found.to_bits(), products.to_bits());
        }
    }
}
