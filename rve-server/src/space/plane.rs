//! Plane tensors as `[[f64; 2]; 2]`, row-major: what is special to two axes. The operations that are not come from
//! [`crate::space`] and are found here too.

pub use super::tensor::{
    add_scaled, apply, determinant, inverse, largest_component, norm, product, rotated, transpose,
};

/// A plane second-order tensor, row-major.
pub type Plane = [[f64; 2]; 2];

/// The unit tensor.
pub const IDENTITY: Plane = [[1.0, 0.0], [0.0, 1.0]];

/// Rotation by `angle`, counter-clockwise.
pub fn rotation(angle: f64) -> Plane {
    let (sine, cosine) = angle.sin_cos();
    [[cosine, -sine], [sine, cosine]]
}

/// Rotation and stretch of a deformation gradient, `F = I + H = R U`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polar {
    /// Angle of `R`, rad, counter-clockwise.
    pub angle: f64,
    /// `U - I`, symmetric.
    pub strain: Plane,
}

/// Polar decomposition in closed form. `det(I + h) > 0` is the caller's duty. A symmetric `h` gives an angle of exactly
/// zero and returns itself, so that pure stretch suffers no rounding.
pub fn polar(h: &Plane) -> Polar {
    let angle = (h[1][0] - h[0][1]).atan2(2.0 + h[0][0] + h[1][1]);
    if angle == 0.0 {
        return Polar { angle: 0.0, strain: *h };
    }
    // U - I = (R^T - I) + R^T H keeps the digits of a small H; cos a - 1 = -2 sin^2(a/2) keeps those of a small angle.
    let (sine, cosine) = angle.sin_cos();
    let half = (0.5 * angle).sin();
    let back = [[-2.0 * half * half, sine], [-sine, -2.0 * half * half]];
    let turned = product(&[[cosine, sine], [-sine, cosine]], h);
    let strain = add_scaled(&back, 1.0, &turned);
    let shear = 0.5 * (strain[0][1] + strain[1][0]);
    Polar { angle, strain: [[strain[0][0], shear], [shear, strain[1][1]]] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rotation_times_stretch_is_the_deformation(
            h in proptest::array::uniform4(-0.4..0.4f64), turn in -3.0..3.0f64,
        ) {
            let f = add_scaled(&IDENTITY, 1.0, &[[h[0], h[1]], [h[2], h[3]]]);
            prop_assume!(determinant(&f) > 0.05);
            let f = product(&rotation(turn), &f);
            let decomposed = polar(&add_scaled(&f, -1.0, &IDENTITY));
            let stretch = add_scaled(&IDENTITY, 1.0, &decomposed.strain);
            let error = add_scaled(&product(&rotation(decomposed.angle), &stretch), -1.0, &f);
            prop_assert!(largest_component(&error) < 1e-14);
            prop_assert!(stretch[0][0] + stretch[1][1] > 0.0 && determinant(&stretch) > 0.0);
        }
    }

    #[test]
    fn tiny_strain_behind_a_rotation_keeps_its_digits() {
        let strain = [[1e-9, 2e-10], [2e-10, -3e-9]];
        let f = product(&rotation(1e-4), &add_scaled(&IDENTITY, 1.0, &strain));
        let found = polar(&add_scaled(&f, -1.0, &IDENTITY)).strain;
        assert!(largest_component(&add_scaled(&found, -1.0, &strain)) < 1e-15);
    }
}
