//! The space dimension in the kernel: motion of two grains in contact, in the plane and in space.
//!
//! Tangential quantities are **axial vectors**: a tangential force `f_t` is kept as `tau` with `f_t = tau x n`, slip
//! likewise. In the plane an axial vector is one number and `tau x n = tau t` with the tangent `t`, the normal turned by
//! +90 degrees; in space it has three components and is perpendicular to `n`. The moment of `f_t` about either centre
//! is `arm tau`, in both.

use super::Space;
use super::discs::Discs;
use super::slip::{self, Slip, slip_of_spheres};
use super::spheres::Spheres;
use crate::simd::{Mask, Real, Tuple};

/// Squared share of a limit under which no rounding can bring a length near it.
const CLEARLY_BELOW: f64 = 0.99;

/// An axial vector cut to a limit.
#[derive(Clone, Copy, Debug)]
pub struct Shortened<W, R: Real> {
    /// The shortened vector.
    pub kept: W,
    /// `kept . (w - kept)`.
    pub lost: R,
    /// Where the length came near the limit, or above it.
    pub at_limit: R::Mask,
}

/// Discs in the plane, or spheres in space.
pub trait KernelSpace: Space {
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

    /// Rotation that carries a contact's history along in one step.
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

impl KernelSpace for Discs {
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

impl KernelSpace for Spheres {
    type Coordinates<R: Real> = [R; 3];
    type Axial<R: Real> = [R; 3];
    type Turning<R: Real> = Slip<R>;

    #[inline(always)]
    fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
        slip::cross(a, b)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Lanes;
    use proptest::prelude::*;

    proptest! {
        /// Whether some lane, all or none are near the limit: each gets what the definition gives, to the bit.
        #[test]
        fn cuts_to_a_limit_are_those_of_the_definition_whoever_is_beside(
            shares in proptest::array::uniform8(prop_oneof![
                Just(0.0), Just(1.0), 0.0..0.99f64, 0.994..0.996f64, 0.9989..0.9991f64, 1.0..3.0f64,
                (-4..5i32).prop_map(|steps| 1.0 + f64::from(steps) * f64::EPSILON),
            ]),
            way in proptest::array::uniform3(-1.0..1.0f64), limit in prop_oneof![Just(0.0), 1e-9..1e3f64],
        ) {
            const NEAR: f64 = 0.999;
            let norm = Spheres::length(way).max(1e-3);
            let of_lane = |lane: usize| way.map(|component| component / norm * (shares[lane] * limit));
            let mut all = [Lanes::<8>::default(); 3];
            for lane in 0..8 {
                for (all, own) in all.iter_mut().zip(of_lane(lane)) {
                    all.set_lane(lane, own);
                }
            }
            let cut = Spheres::shortened(all, Lanes::splat(limit), NEAR);
            for lane in 0..8 {
                let given = of_lane(lane);
                let length = Spheres::length(given);
                let kept = if limit < length { given.map(|component| component * (limit / length)) } else { given };
                prop_assert_eq!(cut.kept.map(|component| component[lane]), kept);
                prop_assert_eq!(cut.at_limit.lane(lane), limit * NEAR <= length, "{} of {}", length, limit);
                prop_assert_eq!(cut.lost[lane], Tuple::<f64>::dot(kept, given.minus(kept)));
            }
        }
    }
}
