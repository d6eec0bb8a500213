//! What errors of stresses are related to.

use nalgebra::Matrix3;

/// Level of a stress over its first `axes` axes, Pa: the mean pressure, or `|s| / sqrt(axes (axes - 1))` of the deviator `s` if that is
/// larger. Without tension it never is, since then `|stress| <= |tr stress|`: the level is the pressure. Waves in a bonded body without load have
/// a level, too.
pub fn stress_level(axes: usize, stress: &Matrix3<f64>) -> f64 {
    let mean = (0..axes).map(|axis| stress[(axis, axis)]).sum::<f64>() / axes as f64;
    let deviator = |row: usize, column: usize| stress[(row, column)] - if row == column { mean } else { 0.0 };
    let squares: f64 = (0..axes).flat_map(|row| (0..axes).map(move |column| deviator(row, column).powi(2))).sum();
    mean.abs().max((squares / (axes * (axes - 1)) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn level_of_a_stress_without_tension_is_its_pressure(
            principal in prop::array::uniform3(0.0_f64..1.0),
            turn in prop::array::uniform3(-3.0_f64..3.0),
        ) {
            let rotation = nalgebra::Rotation3::new(turn.into());
            let stress = -(rotation * Matrix3::from_diagonal(&principal.into()) * rotation.inverse());
            let pressure = principal.iter().sum::<f64>() / 3.0;
            prop_assert!((stress_level(3, &stress) - pressure).abs() <= 1e-12);
            let [first, second, _] = principal;
            let plane = nalgebra::Rotation2::new(turn[0]);
            let turned = plane.matrix() * nalgebra::Matrix2::new(-first, 0.0, 0.0, -second) * plane.matrix().transpose();
            let stress = Matrix3::new(turned[(0, 0)], turned[(0, 1)], 0.0, turned[(1, 0)], turned[(1, 1)], 0.0, 0.0, 0.0, -5.0);
            prop_assert!((stress_level(2, &stress) - 0.5 * (first + second)).abs() <= 1e-12);
        }
    }

    #[test]
    fn shear_and_tension_have_a_level() {
        assert_eq!(stress_level(2, &Matrix3::new(0.0, 2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 2.0);
        assert_eq!(stress_level(3, &Matrix3::from_diagonal_element(3.0)), 3.0);
        assert_eq!(stress_level(3, &Matrix3::zeros()), 0.0);
    }
}
