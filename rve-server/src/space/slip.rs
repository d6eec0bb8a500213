//! Slip of spheres, and how a tangential force is carried along with a contact, for finite steps without any error.
//!
//! Both grains' spins, weighted with their arms, make one rotation vector: that of a rigid pair which rolls along with
//! the surfaces. This rotation is applied to the old normal and the old force; what the branch has turned beyond it is
//! slip. A pair that rotates rigidly, about whatever axis, therefore slips by exactly nothing and carries its force along
//! exactly, whereas the usual update (rotate by the turn of the normal, then by the twist) errs in second order.

use super::kernel_space::KernelSpace;
use super::spheres::Spheres;
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
    let sine = Spheres::cross(rolled, direction);
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

/// `v + sin x / x w x v + (1 - cos x) / x^2 w x (w x v)` for a rotation vector `w` of length `x`.
#[inline(always)]
fn rotated<R: Real>(w: [R; 3], sine_over_angle: R, versine_over_square: R, v: [R; 3]) -> [R; 3] {
    let first = Spheres::cross(w, v);
    let second = Spheres::cross(w, first);
    v.plus(first.scaled(sine_over_angle)).plus(second.scaled(versine_over_square))
}
