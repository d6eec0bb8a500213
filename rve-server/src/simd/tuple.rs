//! Short tuples of numbers: vectors, axial vectors and what contacts remember, over any [`Real`].

use super::real::Real;
use std::fmt::Debug;

/// A fixed number of components. Implemented for arrays of every length, the empty one included.
pub trait Tuple<R: Real>: Copy + Debug + PartialEq + Send + Sync + AsRef<[R]> + AsMut<[R]> + 'static {
    /// Every component the same.
    fn filled(value: R) -> Self;

    /// The tuple whose component `i` is `component(i)`.
    fn build(component: impl Fn(usize) -> R) -> Self;

    /// Component-wise combination of two tuples.
    fn zip(self, other: Self, combine: impl Fn(R, R) -> R) -> Self;

    /// Component-wise change.
    fn map(self, change: impl Fn(R) -> R) -> Self;

    /// `self . other`: the first product rounded, each further one fused in order; zero without components.
    fn dot(self, other: Self) -> R;

    /// All components zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::filled(R::default())
    }

    /// `self + other`.
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.zip(
            other,
            #[inline(always)]
            |a, b| a + b,
        )
    }

    /// `self - other`.
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.zip(
            other,
            #[inline(always)]
            |a, b| a - b,
        )
    }

    /// `factor self`.
    #[inline(always)]
    fn scaled(self, factor: R) -> Self {
        self.map(
            #[inline(always)]
            |a| a * factor,
        )
    }

    /// `factor self + addend`, fused.
    #[inline(always)]
    fn scaled_plus(self, factor: R, addend: Self) -> Self {
        self.zip(
            addend,
            #[inline(always)]
            |a, b| a.mul_add(factor, b),
        )
    }

    /// `self` where `mask` holds, else `other`.
    #[inline(always)]
    fn where_or(self, mask: R::Mask, other: Self) -> Self {
        self.zip(
            other,
            #[inline(always)]
            |a, b| R::select(mask, a, b),
        )
    }
}

/// Sets one lane of every component from a tuple of single numbers.
#[inline(always)]
pub(crate) fn put_lane<P: Real, R: Real, T: Tuple<P>, U: Tuple<R>>(packed: &mut T, lane: usize, given: &U) {
    for (value, given) in packed.as_mut().iter_mut().zip(given.as_ref()) {
        value.set_lane(lane, given.lane(0));
    }
}

/// One lane of every component, as a tuple of single numbers.
#[inline(always)]
pub(crate) fn take_lane<P: Real, R: Real, T: Tuple<P>, U: Tuple<R>>(packed: &T, lane: usize) -> U {
    U::build(
        #[inline(always)]
        |component| R::splat(packed.as_ref()[component].lane(lane)),
    )
}

impl<R: Real, const N: usize> Tuple<R> for [R; N] {
    #[inline(always)]
    fn filled(value: R) -> Self {
        [value; N]
    }

    #[inline(always)]
    fn build(component: impl Fn(usize) -> R) -> Self {
        let mut built = [R::default(); N];
        for (i, value) in built.iter_mut().enumerate() {
            *value = component(i);
        }
        built
    }

    #[inline(always)]
    fn zip(self, other: Self, combine: impl Fn(R, R) -> R) -> Self {
        let mut combined = self;
        for (value, other) in combined.iter_mut().zip(other) {
            *value = combine(*value, other);
        }
        combined
    }

    #[inline(always)]
    fn map(self, change: impl Fn(R) -> R) -> Self {
        let mut changed = self;
        for value in &mut changed {
            *value = change(*value);
        }
        changed
    }

    #[inline(always)]
    fn dot(self, other: Self) -> R {
        if N == 0 {
            return R::default();
        }
        let mut sum = self[0] * other[0];
        for i in 1..N {
            sum = self[i].mul_add(other[i], sum);
        }
        sum
    }
}
