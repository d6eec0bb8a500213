//! Slip of spheres, and how a tangential force is carried along with a contact, for finite steps without any error.
//!
//! Both grains' spins, weighted with their arms, make one rotation vector: that of a rigid pair which rolls along with
//! the surfaces. This rotation is applied to the old normal and the old force; what the branch has turned beyond it is
//! slip. A pair that rotates rigidly, about whatever axis, therefore slips by exactly nothing and carries its force along
//! exactly, whereas the usual update (rotate by the turn of the normal, then by the twist) errs in second order.

use crate::lanes::{Kinematics, Real, Tuple};
use crate::space::Spheres;

/// Slip of a step and the rotation that carries the contact's history along.
#[derive(Clone, Copy, Debug)]
pub struct Slip<R: Real> {
    /// Slip as an axial vector, m.
    pub slip: [R; 3],
    roll: Roll<R>,
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
    let shares = [arms[0] * reciprocal_length, arms[1] * reciprocal_length];
    let roll = Roll::new(spins[0].scaled_plus(shares[0], spins[1].scaled(shares[1])));
    let rolled = roll.turned(before);
    // Both products rounded, so that parallel vectors give exactly zero.
    let sine = Spheres::cross(rolled, direction);
    let sine_square = sine.dot(sine);
    // The turn beyond as an angle: arcsin by its series.
    let angle_over_sine = series(sine_square, [1.0, 1.0 / 6.0, 0.075]);
    // 1 / (1 + cos) of the turn beyond, by its series in the square of the sine.
    let factor = series(sine_square, [0.5, 0.125, 1.0 / 16.0]);
    Slip { slip: sine.scaled(length * angle_over_sine), roll, sum: rolled.plus(direction), factor, direction }
}

impl<R: Real> Slip<R> {
    /// An axial vector of the contact, turned along. Its length is kept; the result is perpendicular to the new normal
    /// whatever rounding has done to the old one.
    #[inline(always)]
    pub fn carried(&self, axial: [R; 3]) -> [R; 3] {
        let along = self.roll.turned(axial);
        self.sum.scaled_plus(-(self.factor * self.direction.dot(along)), along)
    }
}

/// A rotation by `w`, of less than 0.03 rad: `cos x v + sin x / x w x v + (1 - cos x) / x^2 w (w . v)`, x the length of `w`.
#[derive(Clone, Copy, Debug)]
struct Roll<R: Real> {
    spin: [R; 3],
    /// `sin x / x w`.
    across: [R; 3],
    /// `(1 - cos x) / x^2`.
    versine: R,
    cosine: R,
}

impl<R: Real> Roll<R> {
    #[inline(always)]
    fn new(spin: [R; 3]) -> Self {
        let square = spin.dot(spin);
        // The next terms are below rounding.
        let sine_over_angle = series(square, [1.0, -1.0 / 6.0, 1.0 / 120.0]);
        let versine = series(square, [0.5, -1.0 / 24.0, 1.0 / 720.0]);
        Self {
            spin,
            across: spin.scaled(sine_over_angle),
            versine,
            cosine: (-square).mul_add(versine, R::splat(1.0)),
        }
    }

    #[inline(always)]
    fn turned(&self, v: [R; 3]) -> [R; 3] {
        let along = self.versine * self.spin.dot(v);
        let w = self.across;
        let straight = self.spin.scaled_plus(along, v.scaled(self.cosine));
        <[R; 3]>::build(
            #[inline(always)]
            |i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                w[j].mul_add(v[k], (-w[k]).mul_add(v[j], straight[i]))
            },
        )
    }
}

#[inline(always)]
fn series<R: Real>(x: R, [a, b, c]: [f64; 3]) -> R {
    x.mul_add(R::splat(c), R::splat(b)).mul_add(x, R::splat(a))
}
