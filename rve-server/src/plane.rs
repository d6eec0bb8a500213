//! Plane tensors as `[[f64; 2]; 2]`, row-major: the few closed forms that a periodic cell needs.

/// A plane second-order tensor, row-major.
pub type Plane = [[f64; 2]; 2];

/// The unit tensor.
pub const IDENTITY: Plane = [[1.0, 0.0], [0.0, 1.0]];

/// Determinant.
pub fn determinant(a: &Plane) -> f64 {
    a[0][0] * a[1][1] - a[0][1] * a[1][0]
}

/// Inverse; the caller knows that the determinant is not zero.
pub fn inverse(a: &Plane) -> Plane {
    let scale = 1.0 / determinant(a);
    [[a[1][1] * scale, -a[0][1] * scale], [-a[1][0] * scale, a[0][0] * scale]]
}

/// Matrix product `a b`.
pub fn product(a: &Plane, b: &Plane) -> Plane {
    let mut c = [[0.0; 2]; 2];
    for (i, row) in c.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value = a[i][0] * b[0][j] + a[i][1] * b[1][j];
        }
    }
    c
}

/// Transpose.
pub fn transpose(a: &Plane) -> Plane {
    [[a[0][0], a[1][0]], [a[0][1], a[1][1]]]
}

/// Matrix times column vector.
pub fn apply(a: &Plane, v: [f64; 2]) -> [f64; 2] {
    [a[0][0] * v[0] + a[0][1] * v[1], a[1][0] * v[0] + a[1][1] * v[1]]
}

/// Component-wise sum `a + scale b`.
pub fn add_scaled(a: &Plane, scale: f64, b: &Plane) -> Plane {
    let mut c = *a;
    for (row, other) in c.iter_mut().zip(b) {
        for (value, addend) in row.iter_mut().zip(other) {
            *value += scale * addend;
        }
    }
    c
}

/// Largest absolute component.
pub fn largest_component(a: &Plane) -> f64 {
    a.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs()))
}

/// Frobenius norm.
pub fn norm(a: &Plane) -> f64 {
    a.iter().flatten().map(|value| value * value).sum::<f64>().sqrt()
}

/// Rotation by `angle`, counter-clockwise.
pub fn rotation(angle: f64) -> Plane {
    let (sine, cosine) = angle.sin_cos();
    [[cosine, -sine], [sine, cosine]]
}

/// `R a R^T` for a rotation `R`.
pub fn rotated(a: &Plane, rotation: &Plane) -> Plane {
    product(&product(rotation, a), &transpose(rotation))
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
