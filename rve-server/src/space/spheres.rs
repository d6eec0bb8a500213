//! Spheres in space.

use super::components::Components;
use super::slip::{Slip, slip_of_spheres};
use super::tensor::{Tensor, add_scaled, apply, cross, inverse, largest_component, product, scaled, transpose};
use super::{PolarParts, Space};

/// Spheres in space. Rotations and moments are vectors; a tangential force is a vector normal to the branch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Spheres;

type Matrix = [[f64; 3]; 3];

/// A rotation as a unit quaternion: cosine of half the angle, axis times sine of half the angle. Unlike a matrix it keeps
/// the digits of a small rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion {
    /// Cosine of half the angle.
    pub real: f64,
    /// Axis times sine of half the angle.
    pub vector: [f64; 3],
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { real: 1.0, vector: [0.0; 3] }
    }
}

impl Quaternion {
    /// The quaternion of unit length in the same direction.
    fn normalised(real: f64, vector: [f64; 3]) -> Self {
        let scale = 1.0 / (real * real + vector.dot(vector)).sqrt();
        Self { real: real * scale, vector: vector.times(scale) }
    }

    /// This rotation after `other`.
    fn after(self, other: Self) -> Self {
        let real = self.real * other.real - self.vector.dot(other.vector);
        let sum = other.vector.times(self.real).plus(self.vector.times(other.real));
        Self::normalised(real, sum.plus(cross(self.vector, other.vector)))
    }

    /// `R - I`, with the digits of a small rotation.
    fn matrix_minus_identity(self) -> Matrix {
        let [x, y, z] = self.vector;
        let w = self.real;
        [
            [-2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), -2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), -2.0 * (x * x + y * y)],
        ]
    }

    /// The quaternion of an orthogonal matrix, to the matrix' own accuracy.
    fn of_matrix(r: &Matrix) -> Self {
        let trace = r[0][0] + r[1][1] + r[2][2];
        if trace > 0.0 {
            return Self::normalised(1.0 + trace, [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]);
        }
        // The largest diagonal component belongs to the largest part of the axis: no difference of near numbers is used.
        let i = (0..3).fold(0, |largest, axis| if r[axis][axis] > r[largest][largest] { axis } else { largest });
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let mut vector = [0.0; 3];
        vector[i] = 1.0 + r[i][i] - r[j][j] - r[k][k];
        vector[j] = r[j][i] + r[i][j];
        vector[k] = r[k][i] + r[i][k];
        let real = r[k][j] - r[j][k];
        if real < 0.0 { Self::normalised(-real, vector.times(-1.0)) } else { Self::normalised(real, vector) }
    }
}

impl Space for Spheres {
    const DIMENSION: usize = 3;
    const GRAINS: &'static str = "spheres";
    const INERTIA_FACTOR: f64 = 0.4;
    type Kernel = Self;
    type Carrier = Slip<f64>;
    type Vector = [f64; 3];
    type Shift = [i32; 3];
    type Tensor = Matrix;
    type Spin = [f64; 3];
    type Tangential = [f64; 3];
    type Grain = [f64; 4];
    type Turn = Quaternion;

    fn grain([x, y, z]: [f64; 3], radius: f64) -> [f64; 4] {
        [x, y, z, radius]
    }

    fn grain_measure(radius: f64) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius
    }

    fn shift(component: impl FnMut(usize) -> i32) -> [i32; 3] {
        std::array::from_fn(component)
    }

    fn cofactors([first, second, third]: &Matrix) -> Matrix {
        [cross(*second, *third), cross(*third, *first), cross(*first, *second)]
    }

    fn contact_force(direction: [f64; 3], normal: f64, tangential: [f64; 3]) -> [f64; 3] {
        direction.times(normal).plus(tangential)
    }

    fn seen_from(tangential: [f64; 3], is_swapped: bool) -> [f64; 3] {
        if is_swapped { tangential.times(-1.0) } else { tangential }
    }

    fn contact_moment(direction: [f64; 3], tangential: [f64; 3]) -> [f64; 3] {
        cross(direction, tangential)
    }

    fn axial(spin: [f64; 3]) -> [f64; 3] {
        spin
    }

    fn spin(axial: [f64; 3]) -> [f64; 3] {
        axial
    }

    fn to_axial(tangential: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
        cross(direction, tangential)
    }

    fn from_axial(axial: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
        cross(axial, direction)
    }

    fn slip(
        before: [f64; 3],
        direction: [f64; 3],
        length: f64,
        arms: [f64; 2],
        spins: [[f64; 3]; 2],
    ) -> ([f64; 3], Slip<f64>) {
        let slip = slip_of_spheres(before, direction, 1.0 / length, length, arms, spins);
        (slip.slip, slip)
    }

    fn carry(carrier: &Slip<f64>, axial: [f64; 3]) -> [f64; 3] {
        carrier.carried(axial)
    }

    fn polar(h: &Matrix) -> PolarParts<Self> {
        if *h == transpose(h) && is_stretch(h) {
            return PolarParts { turn: Quaternion::default(), strain: *h };
        }
        let f = add_scaled(&Matrix::IDENTITY, 1.0, h);
        let mut turn = Quaternion::of_matrix(&nearest_rotation(&f));
        let mut strain = strain_behind(turn, h);
        // Newton's method for a symmetric stretch, from a start that is right to rounding of I: what it adds are the
        // digits of a small rotation and a small strain.
        for _ in 0..REFINEMENTS {
            let skew = [strain[2][1] - strain[1][2], strain[0][2] - strain[2][0], strain[1][0] - strain[0][1]];
            let trace = 3.0 + strain[0][0] + strain[1][1] + strain[2][2];
            let matrix = Matrix::from_fn(|i, j| {
                let unit = if i == j { 1.0 } else { 0.0 };
                (trace - 1.0) * unit - 0.5 * (strain[i][j] + strain[j][i])
            });
            let correction = apply(&inverse(&matrix), skew);
            turn = turn.after(Quaternion::normalised(1.0, correction.times(0.5)));
            strain = strain_behind(turn, h);
        }
        let symmetric = add_scaled(&scaled(&strain, 0.5), 0.5, &transpose(&strain));
        PolarParts { turn, strain: symmetric }
    }

    fn rotation_matrix(turn: Quaternion) -> Matrix {
        add_scaled(&Matrix::IDENTITY, 1.0, &turn.matrix_minus_identity())
    }

    fn rotation_vector(turn: Quaternion) -> [f64; 3] {
        let sine = turn.vector.norm();
        // 2 atan2(s, c) / s tends to 2 for a rotation that vanishes.
        let factor = if sine > 0.0 { 2.0 * sine.atan2(turn.real) / sine } else { 2.0 };
        turn.vector.times(factor)
    }

    fn turned_tangential(tangential: [f64; 3], matrix: &Matrix) -> [f64; 3] {
        apply(matrix, tangential)
    }

    fn turned_spin(spin: [f64; 3], matrix: &Matrix) -> [f64; 3] {
        apply(matrix, spin)
    }

    fn spin_in_space(spin: [f64; 3]) -> [f64; 3] {
        spin
    }
}

/// Newton steps after the iteration for the rotation; each squares the relative error.
const REFINEMENTS: u32 = 2;

/// Most iterations for the rotation; five to eight are used.
const MOST_ITERATIONS: u32 = 40;

/// `U - I = (R^T - I) + R^T H`, symmetric if the rotation is right.
fn strain_behind(turn: Quaternion, h: &Matrix) -> Matrix {
    let back = transpose(&turn.matrix_minus_identity());
    add_scaled(&add_scaled(&back, 1.0, h), 1.0, &product(&back, h))
}

/// Whether I plus a symmetric matrix stretches alone: half turns about an axis are symmetric too.
fn is_stretch(h: &Matrix) -> bool {
    let f = add_scaled(&Matrix::IDENTITY, 1.0, h);
    f[0][0] > 0.0 && f[0][0] * f[1][1] - f[0][1] * f[1][0] > 0.0 && f.determinant() > 0.0
}

/// The rotation of the polar decomposition by averaging a matrix with its inverse transpose, scaled so that both have
/// determinant 1 at first.
fn nearest_rotation(f: &Matrix) -> Matrix {
    let mut r = scaled(f, 1.0 / f.determinant().cbrt());
    for _ in 0..MOST_ITERATIONS {
        let next = scaled(&add_scaled(&r, 1.0, &transpose(&inverse(&r))), 0.5);
        let change = largest_component(&add_scaled(&next, -1.0, &r));
        r = next;
        if change < 1e-12 {
            break;
        }
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rotation_of(vector: [f64; 3]) -> Matrix {
        let angle = vector.norm();
        let half = 0.5 * angle;
        let scale = if angle > 0.0 { half.sin() / angle } else { 0.5 };
        Spheres::rotation_matrix(Quaternion { real: half.cos(), vector: vector.times(scale) })
    }

    proptest! {
        #[test]
        fn rotation_times_stretch_is_the_deformation(
            h in proptest::array::uniform9(-0.3..0.3f64), turn in proptest::array::uniform3(-3.0..3.0f64),
        ) {
            let f = add_scaled(&Matrix::IDENTITY, 1.0, &Matrix::from_fn(|i, j| h[3 * i + j]));
            prop_assume!(f.determinant() > 0.05);
            let f = product(&rotation_of(turn), &f);
            let parts = Spheres::polar(&add_scaled(&f, -1.0, &Matrix::IDENTITY));
            let stretch = add_scaled(&Matrix::IDENTITY, 1.0, &parts.strain);
            let rotation = Spheres::rotation_matrix(parts.turn);
            let error = add_scaled(&product(&rotation, &stretch), -1.0, &f);
            prop_assert!(largest_component(&error) < 1e-14, "{error:?}");
            prop_assert!(stretch.determinant() > 0.0 && rotation.determinant() > 0.0);
            let orthogonal = add_scaled(&product(&rotation, &transpose(&rotation)), -1.0, &Matrix::IDENTITY);
            prop_assert!(largest_component(&orthogonal) < 1e-14);
            let again = rotation_of(Spheres::rotation_vector(parts.turn));
            prop_assert!(largest_component(&add_scaled(&again, -1.0, &rotation)) < 1e-14);
        }
    }

    /// Half turns about any axis, with a small stretch or none: symmetric where the axis is one of the stretch.
    #[test]
    fn half_turns_are_rotations() {
        let half = 0.5_f64.sqrt();
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [half, half, 0.0], [0.6, 0.0, 0.8]] {
            for stretch in [[0.0; 3], [1e-3, -2e-3, 5e-4]] {
                let turn = Matrix::from_fn(|i, j| 2.0 * axis[i] * axis[j] - if i == j { 1.0 } else { 0.0 });
                let stretch = Matrix::from_fn(|i, j| if i == j { stretch[i] } else { 0.0 });
                let f = product(&turn, &add_scaled(&Matrix::IDENTITY, 1.0, &stretch));
                let parts = Spheres::polar(&add_scaled(&f, -1.0, &Matrix::IDENTITY));
                let error = largest_component(&add_scaled(&parts.strain, -1.0, &stretch));
                assert!(error < 1e-14, "{axis:?}: {:?}", parts.strain);
                let error = largest_component(&add_scaled(&Spheres::rotation_matrix(parts.turn), -1.0, &turn));
                assert!(error < 1e-14, "{axis:?}");
            }
        }
    }

    #[test]
    fn tiny_strain_behind_a_rotation_keeps_its_digits() {
        let strain = [[1e-9, 2e-10, -3e-10], [2e-10, -3e-9, 5e-10], [-3e-10, 5e-10, 2e-9]];
        for turn in [[1e-4, -2e-4, 3e-4], [1e-9, 2e-9, 3e-10]] {
            let angle_free = {
                // R - I without loss, so that H has all its digits.
                let half = 0.5 * turn.norm();
                Quaternion { real: half.cos(), vector: turn.times(half.sin() / turn.norm()) }
            };
            let rotation = angle_free.matrix_minus_identity();
            let h = add_scaled(&add_scaled(&rotation, 1.0, &strain), 1.0, &product(&rotation, &strain));
            let parts = Spheres::polar(&h);
            assert!(largest_component(&add_scaled(&parts.strain, -1.0, &strain)) < 1e-20 + 1e-16 * turn.norm());
            let found = Spheres::rotation_vector(parts.turn);
            assert!(found.minus(turn).norm() < 1e-15 * turn.norm());
        }
    }

    #[test]
    fn symmetric_gradient_is_its_own_strain() {
        let h = [[0.1, 0.02, 0.0], [0.02, -0.3, 0.1], [0.0, 0.1, 0.2]];
        let parts = Spheres::polar(&h);
        assert_eq!((parts.turn, parts.strain), (Quaternion::default(), h));
        assert_eq!(Spheres::rotation_vector(parts.turn), [0.0; 3]);
    }
}
