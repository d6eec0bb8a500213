//! What the number of space dimensions means for the motion of two grains in contact.
//!
//! Tangential quantities are **axial vectors**: a tangential force `f_t` is kept as `tau` with `f_t = tau x n`, slip
//! likewise. In the plane an axial vector is one number and `tau x n = tau t` with the tangent `t`, the normal turned by
//! +90 degrees; in space it has three components and is perpendicular to `n`. The moment of `f_t` about either centre
//! is `arm tau`, in both.

use super::real::Real;
use super::tuple::Tuple;
use crate::space::{Discs, Space, Spheres};

/// Discs in the plane, or spheres in space.
pub trait Kinematics: Space {
    /// Vectors, component by component those of the space.
    type Coordinates<R: Real>: Tuple<R>;

    /// Axial vectors: moments, spins, tangential forces.
    type Axial<R: Real>: Tuple<R>;

    /// The axial vector of a tangential force on a contact with this direction.
    fn axial_of(tangential: Self::Tangential, direction: Self::Vector) -> Self::Axial<f64>;

    /// The tangential force of an axial vector on a contact with this direction.
    fn tangential_of(axial: Self::Axial<f64>, direction: Self::Vector) -> Self::Tangential;

    /// `a x b`.
    fn cross<R: Real>(a: Self::Coordinates<R>, b: Self::Coordinates<R>) -> Self::Axial<R>;

    /// `w x n`.
    fn turn<R: Real>(w: Self::Axial<R>, n: Self::Coordinates<R>) -> Self::Coordinates<R>;

    /// The part of `w` perpendicular to `n`: all of it in the plane.
    fn across<R: Real>(w: Self::Axial<R>, n: Self::Coordinates<R>) -> Self::Axial<R>;

    /// Carries a tangential force along when the normal turns from `before` to `n` with `sine = before x n`, and when
    /// both grains spin about the normal. Lengths are kept.
    fn carried<R: Real>(
        tau: Self::Axial<R>,
        sine: Self::Axial<R>,
        sine_square: R,
        n: Self::Coordinates<R>,
        mean_spin: Self::Axial<R>,
    ) -> Self::Axial<R>;

    /// Length of an axial vector.
    fn length<R: Real>(w: Self::Axial<R>) -> R;

    /// `w` shortened to the length `limit` if it is longer; `limit` is not negative.
    fn shortened<R: Real>(w: Self::Axial<R>, limit: R) -> Self::Axial<R>;
}

impl Kinematics for Discs {
    type Coordinates<R: Real> = [R; 2];
    type Axial<R: Real> = [R; 1];

    fn axial_of(tangential: f64, _: [f64; 2]) -> [f64; 1] {
        [tangential]
    }

    fn tangential_of([axial]: [f64; 1], _: [f64; 2]) -> f64 {
        axial
    }

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
    fn carried<R: Real>(tau: [R; 1], _: [R; 1], _: R, _: [R; 2], _: [R; 1]) -> [R; 1] {
        tau
    }

    #[inline(always)]
    fn length<R: Real>([w]: [R; 1]) -> R {
        w.abs()
    }

    #[inline(always)]
    fn shortened<R: Real>([w]: [R; 1], limit: R) -> [R; 1] {
        [w.held_within(limit)]
    }
}

impl Kinematics for Spheres {
    type Coordinates<R: Real> = [R; 3];
    type Axial<R: Real> = [R; 3];

    fn axial_of(tangential: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
        Self::cross(direction, tangential)
    }

    fn tangential_of(axial: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
        Self::cross(axial, direction)
    }

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
    fn carried<R: Real>(tau: [R; 3], sine: [R; 3], sine_square: R, n: [R; 3], mean_spin: [R; 3]) -> [R; 3] {
        // Rotation about sine x: tau + sine x tau + sine x (sine x tau) / (1 + cosine), the last factor by its series:
        // the next term is below rounding for turns under 0.02 rad.
        let first = Self::cross(sine, tau);
        let second = Self::cross(sine, first);
        let factor = sine_square
            .mul_add(R::splat(5.0 / 128.0), R::splat(1.0 / 16.0))
            .mul_add(sine_square, R::splat(0.125))
            .mul_add(sine_square, R::splat(0.5));
        let turned = second.scaled_plus(factor, tau.plus(first));
        // Then about n by the twist, again by series, and back to the plane: rounding must not pile up along n.
        let twist = mean_spin.dot(n);
        let square = twist * twist;
        let about =
            square.mul_add(R::splat(1.0 / 120.0), R::splat(-1.0 / 6.0)).mul_add(square, R::splat(1.0)) * twist;
        let along = square
            .mul_add(R::splat(-1.0 / 720.0), R::splat(1.0 / 24.0))
            .mul_add(square, R::splat(-0.5))
            .mul_add(square, R::splat(1.0));
        let twisted = Self::cross(n, turned).scaled_plus(about, turned.scaled(along));
        Self::across(twisted, n)
    }

    #[inline(always)]
    fn length<R: Real>(w: [R; 3]) -> R {
        w.dot(w).sqrt()
    }

    #[inline(always)]
    fn shortened<R: Real>(w: [R; 3], limit: R) -> [R; 3] {
        let length = Self::length(w);
        let longer = limit.less(length);
        w.scaled(limit / length).where_or(longer, w)
    }
}
