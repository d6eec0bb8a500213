//! Slip of spheres, and how a tangential force is carried along with a contact, for finite steps without any error.
//!
//! Both grains' spins, weighted with their arms, make one rotation vector: that of a rigid pair which rolls along with
//! the surfaces. This rotation is applied to the old normal and the old force; what the branch has turned beyond it is
//! slip. A pair that rotates rigidly, about whatever axis, therefore slips by exactly nothing and carries its force along
//! exactly, whereas the usual update (rotate by the turn of the normal, then by the twist) errs in second order.

use crate::simd::{Real, Tuple};

/// Slip of a step and the rotation that carries the contact's history along.
#[derive(Clone, Copy, Debug)]
pub struct Slip<R: Real> {
    /// Slip as an axial vector, m.
    pub slip: [R; 3],
    mean_spin: [R; 3],
    sine_over_angle: R,
    versine_over_square: R,
    sum: [R; 3],
    factor: R,
    direction: [R; 3],
}

/// Slip of a pair whose normal went from `before` to `direction` while the grains span; `length` is the distance of the
/// centres, `arms` the distances of the contact point from them, m.
#[inline(always)]
pub fn slip_of_spheres<R: Real>(
    before: [R; 3],
    direction: [R; 3],
    reciprocal_length: R,
    length: R,
    arms: [R; 2],
    spins: [[R; 3]; 2],
) -> Slip<R> {
    let mean_spin = spins[0].scaled(arms[0]).plus(spins[1].scaled(arms[1])).scaled(reciprocal_length);
    let square = mean_spin.dot(mean_spin);
    let one = R::splat(1.0);
    // sin x / x and (1 - cos x) / x^2; the next terms are below rounding for angles under 0.03.
    let sine_over_angle = one - square * (R::splat(1.0 / 6.0) - square * R::splat(1.0 / 120.0));
    let versine_over_square = R::splat(0.5) - square * (R::splat(1.0 / 24.0) - square * R::splat(1.0 / 720.0));
    let rolled = rotated(mean_spin, sine_over_angle, versine_over_square, before);
    let sine = cross(rolled, direction);
    let sine_square = sine.dot(sine);
    // The turn beyond as an angle: arcsin by its series.
    let angle_over_sine = one + sine_square * (R::splat(1.0 / 6.0) + sine_square * R::splat(0.075));
    // 1 / (1 + cos) of the turn beyond, by its series in the square of the sine.
    let factor = R::splat(0.5) + sine_square * (R::splat(0.125) + sine_square * R::splat(1.0 / 16.0));
    Slip {
        slip: sine.scaled(length * angle_over_sine),
        mean_spin,
        sine_over_angle,
        versine_over_square,
        sum: rolled.plus(direction),
        factor,
        direction,
    }
}

impl<R: Real> Slip<R> {
    /// An axial vector of the contact, turned along. Its length is kept; the result is perpendicular to the new normal
    /// whatever rounding has done to the old one.
    #[inline(always)]
    pub fn carried(&self, axial: [R; 3]) -> [R; 3] {
        let along = rotated(self.mean_spin, self.sine_over_angle, self.versine_over_square, axial);
        along.minus(self.sum.scaled(self.factor * self.direction.dot(along)))
    }
}

/// `a x b`.
#[inline(always)]
pub(super) fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `v + sin x / x w x v + (1 - cos x) / x^2 w x (w x v)` for a rotation vector `w` of length `x`.
#[inline(always)]
fn rotated<R: Real>(w: [R; 3], sine_over_angle: R, versine_over_square: R, v: [R; 3]) -> [R; 3] {
    let first = cross(w, v);
    let second = cross(w, first);
    v.plus(first.scaled(sine_over_angle)).plus(second.scaled(versine_over_square))
}

#[cfg(test)]
mod tests {
    use super::slip_of_spheres;
    use crate::space::{Components, KernelSpace, Spheres};
    use proptest::prelude::*;

    proptest! {
        /// A pair that rotates rigidly about any axis slips by nothing and carries its force along exactly.
        #[test]
        fn rigid_rotation_is_no_slip(
            axis in proptest::array::uniform3(-1.0..1.0f64), angle in -0.02..0.02f64,
            start in proptest::array::uniform3(-1.0..1.0f64), across in proptest::array::uniform3(-1.0..1.0f64),
        ) {
            prop_assume!(axis.norm() > 0.1 && start.norm() > 0.1);
            let axis = axis.times(1.0 / axis.norm());
            let before = start.times(1.0 / start.norm());
            let turn = |v: [f64; 3]| {
                let cross = Spheres::cross(axis, v);
                let twice = Spheres::cross(axis, cross);
                v.plus(cross.times(angle.sin())).plus(twice.times(2.0 * (0.5 * angle).sin().powi(2)))
            };
            let force = Spheres::cross(before, across);
            let spin = axis.times(angle);
            let (length, arms) = (1.9, [0.7, 1.2]);
            let slip = slip_of_spheres(before, turn(before), 1.0 / length, length, arms, [spin, spin]);
            prop_assert!(slip.slip.norm() < 1e-15, "{:?}", slip.slip);
            prop_assert!(slip.carried(force).minus(turn(force)).norm() < 1e-15);
        }

        /// To first order the slip is that of the two surfaces; the order of the grains does not matter.
        #[test]
        fn slip_is_the_motion_of_the_surfaces(
            motion in proptest::array::uniform3(-1e-6..1e-6f64), spins in proptest::array::uniform6(-1e-6..1e-6f64),
        ) {
            let before = [0.6, 0.0, 0.8];
            let (length, arms) = (1.9, [0.7, 1.2]);
            let branch = before.times(length).plus(motion);
            let after = branch.times(1.0 / branch.norm());
            let spins = [[spins[0], spins[1], spins[2]], [spins[3], spins[4], spins[5]]];
            let slip = slip_of_spheres(before, after, 1.0 / length, length, arms, spins).slip;
            let surface = motion
                .minus(Spheres::cross(spins[0], before.times(arms[0])))
                .minus(Spheres::cross(spins[1], before.times(arms[1])));
            let across = surface.minus(before.times(surface.dot(before)));
            prop_assert!(Spheres::cross(slip, before).minus(across).norm() < 1e-11);
            let swapped =
                slip_of_spheres(before.times(-1.0), after.times(-1.0), 1.0 / length, length, [arms[1], arms[0]], [spins[1], spins[0]]);
            prop_assert!(swapped.slip.minus(slip).norm() < 1e-15);
        }
    }
}
