//! The number that contact laws and motion are written over.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign};

/// The outcome of a comparison, lane by lane.
pub trait Mask: Copy + Debug + PartialEq + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// The same decision in every lane.
    fn splat(value: bool) -> Self;

    /// Whether at least one lane says yes.
    fn any(self) -> bool;

    /// Whether one lane says yes.
    fn lane(self, lane: usize) -> bool;
}

/// One number, or several independent ones side by side.
///
/// Arithmetic operators act lane by lane. Write `a.mul_add(b, c)` for `a b + c` with one rounding; `a * b + c` rounds
/// twice, on every back end.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialEq
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// Outcome of comparisons.
    type Mask: Mask;

    /// How many numbers there are.
    const LANES: usize;

    /// The number of one lane.
    fn lane(&self, lane: usize) -> f64;

    /// Replaces the number of one lane.
    fn set_lane(&mut self, lane: usize, value: f64);

    /// The same number in every lane.
    fn splat(value: f64) -> Self;

    /// `self * factor + addend` with one rounding.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// Exact (correctly rounded) square root.
    fn sqrt(self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// Whether `self < other`; false for NaN.
    fn less(self, other: Self) -> Self::Mask;

    /// Whether `self <= other`; false for NaN.
    fn at_most(self, other: Self) -> Self::Mask;

    /// `yes` where `mask` holds, else `no`. The value not taken may be anything, NaN included.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// The larger one; `self` if the two cannot be compared or are equal.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self::select(self.less(other), other, self)
    }

    /// The smaller one; `self` if the two cannot be compared or are equal.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self::select(other.less(self), other, self)
    }

    /// `self` held within `-limit ..= limit`.
    #[inline(always)]
    fn held_within(self, limit: Self) -> Self {
        self.smaller(limit).larger(-limit)
    }
}

impl Mask for bool {
    #[inline(always)]
    fn splat(value: bool) -> Self {
        value
    }

    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn lane(self, _: usize) -> bool {
        self
    }
}

impl Real for f64 {
    type Mask = bool;
    const LANES: usize = 1;

    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn set_lane(&mut self, _: usize, value: f64) {
        *self = value;
    }

    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        f64::mul_add(self, factor, addend)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }

    #[inline(always)]
    fn less(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}
