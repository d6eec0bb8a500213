//! What the number of space dimensions means for the motion of two grains in contact.
//!
//! Tangential quantities are **axial vectors**: a tangential force `f_t` is kept as `tau` with `f_t = tau x n`, slip
//! likewise. In the plane an axial vector is one number and `tau x n = tau t` with the tangent `t`, the normal turned by
//! +90 degrees; in space it has three components and is perpendicular to `n`. The moment of `f_t` about either centre
//! is `arm tau`, in both.

use super::real::{Mask, Real};
use super::tuple::Tuple;
use crate::law::{Slip, slip_of_spheres};
use crate::space::{Discs, Space, Spheres};

/// Squared share of a limit under which no rounding can bring a length near it.
const CLEARLY_BELOW: f64 = 0.99;

/// An axial vector cut to a limit.
#[derive(Clone, Copy, Debug)]
pub struct Shortened<W, R: Real> {
    /// What is left.
    pub kept: W,
    /// `kept . (w - kept)`.
    pub lost: R,
    /// Where the length came near the limit, or above it.
    pub at_limit: R::Mask,
}

/// Discs in the plane, or spheres in space.
pub trait Kinematics: Space {
    /// Vectors, component by component those of the space.
    type Coordinates<R: Real>: Tuple<R>;

    /// Axial vectors: moments, spins, tangential forces.
    type Axial<R: Real>: Tuple<R>;

    /// `a x b`.
    fn cross<R: Real>(a: Self::Coordinates<R>, b: Self::Coordinates<R>) -> Self::Axial<R>;

    /// `w x n`.
    fn turn<R: Real>(w: Self::Axial<R>, n: Self::Coordinates<R>) -> Self::Coordinates<R>;

    /// The part of `w` perpendicular to `n`: all of it in the plane.
    fn across<R: Real>(w: Self::Axial<R>, n: Self::Coordinates<R>) -> Self::Axial<R>;

    /// What carries a contact's history along in one step.
    type Turning<R: Real>: Copy;

    /// Slip of a step in which the normal went from `before` to `direction` and the grains span, m, and what carries
    /// the contact's history along. A pair that rotates rigidly slips by exactly nothing. `length` is the distance of the
    /// centres and `reciprocal` one over it; `arms` lead from the centres to the contact point.
    fn slip_and_turning<R: Real>(
        before: Self::Coordinates<R>,
        direction: Self::Coordinates<R>,
        reciprocal: R,
        length: R,
        arms: [R; 2],
        spins: [Self::Axial<R>; 2],
    ) -> (Self::Axial<R>, Self::Turning<R>);

    /// An axial vector of a contact's history, turned along with the contact.
    fn carried<R: Real>(carrier: &Self::Turning<R>, axial: Self::Axial<R>) -> Self::Axial<R>;

    /// Length of an axial vector.
    fn length<R: Real>(w: Self::Axial<R>) -> R;

    /// `w` shortened to the length `limit` if it is longer; `limit` is not negative. `near_limit`, a share of the limit between
    /// 0.995 and 1, says from which length on `w` counts as being at it.
    fn shortened<R: Real>(w: Self::Axial<R>, limit: R, near_limit: f64) -> Shortened<Self::Axial<R>, R>;
}

impl Kinematics for Discs {
    type Coordinates<R: Real> = [R; 2];
    type Axial<R: Real> = [R; 1];
    /// A tangential force is the same number whichever way the contact points.
    type Turning<R: Real> = ();

    #[inline(always)]
    fn cross<R: Real>(a: [R; 2], b: [R; 2]) -> [R; 1] {
        // Both products rounded, so that parallel vectors give exactly zero.
        [a[0] * b[1] - a[1] * b[0]]
    }

    #[inline(always)]
    fn turn<R: Real>([w]: [R; 1], n: [R; 2]) -> [R; 2] {
        [-(w * n[1]), w * n[0]]
    }

    #[inline(always)]
    fn across<R: Real>(w: [R; 1], _: [R; 2]) -> [R; 1] {
        w
    }

    #[inline(always)]
    fn slip_and_turning<R: Real>(
        before: [R; 2],
        direction: [R; 2],
        _: R,
        length: R,
        arms: [R; 2],
        [[first], [second]]: [[R; 1]; 2],
    ) -> ([R; 1], ()) {
        // The branch's own turn is measured as an angle, not as a chord: a rigidly rotating pair then slips by exactly
        // nothing. arcsin by its series; the next term is below rounding for turns under 0.02 rad.
        let [sine] = Self::cross(before, direction);
        let square = sine * sine;
        let series = square.mul_add(R::splat(0.075), R::splat(1.0 / 6.0)).mul_add(square, R::splat(1.0));
        let rolled = arms[0].mul_add(first, arms[1] * second);
        ([(length * series).mul_add(sine, -rolled)], ())
    }

    #[inline(always)]
    fn carried<R: Real>((): &(), axial: [R; 1]) -> [R; 1] {
        axial
    }

    #[inline(always)]
    fn length<R: Real>([w]: [R; 1]) -> R {
        w.abs()
    }

    #[inline(always)]
    fn shortened<R: Real>([w]: [R; 1], limit: R, near_limit: f64) -> Shortened<[R; 1], R> {
        let kept = w.held_within(limit);
        let at_limit = (limit * R::splat(near_limit)).at_most(w.abs());
        Shortened { kept: [kept], lost: kept * (w - kept), at_limit }
    }
}

impl Kinematics for Spheres {
    type Coordinates<R: Real> = [R; 3];
    type Axial<R: Real> = [R; 3];
    type Turning<R: Real> = Slip<R>;

    #[inline(always)]
    fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    }

    #[inline(always)]
    fn turn<R: Real>(w: [R; 3], n: [R; 3]) -> [R; 3] {
        Self::cross(w, n)
    }

    #[inline(always)]
    fn across<R: Real>(w: [R; 3], n: [R; 3]) -> [R; 3] {
        n.scaled_plus(-w.dot(n), w)
    }

    #[inline(always)]
    fn slip_and_turning<R: Real>(
        before: [R; 3],
        direction: [R; 3],
        reciprocal: R,
        length: R,
        arms: [R; 2],
        spins: [[R; 3]; 2],
    ) -> ([R; 3], Slip<R>) {
        let slip = slip_of_spheres(before, direction, reciprocal, length, arms, spins);
        (slip.slip, slip)
    }

    #[inline(always)]
    fn carried<R: Real>(carrier: &Slip<R>, axial: [R; 3]) -> [R; 3] {
        carrier.carried(axial)
    }

    #[inline(always)]
    fn length<R: Real>(w: [R; 3]) -> R {
        w.dot(w).sqrt()
    }

    #[inline(always)]
    fn shortened<R: Real>(w: [R; 3], limit: R, near_limit: f64) -> Shortened<[R; 3], R> {
        let square = w.dot(w);
        // Most contacts are well below their limit: root and quotient, which keep the divider busy, are for the others.
        if !(limit * limit * R::splat(CLEARLY_BELOW)).at_most(square).any() {
            return Shortened { kept: w, lost: R::default(), at_limit: R::Mask::splat(false) };
        }
        let length = square.sqrt();
        let longer = limit.less(length);
        let kept = w.scaled(limit / length).where_or(longer, w);
        let at_limit = (limit * R::splat(near_limit)).at_most(length);
        Shortened { kept, lost: kept.dot(w.minus(kept)), at_limit }
    }
}
