//! `L` numbers side by side as a plain array. Inside a function with the right target features the compiler turns each
//! operation into vector instructions; nothing here knows which.

use super::real::{Mask, Real};
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Index, IndexMut, Mul, Neg, Not, Sub, SubAssign};

/// An array from an expression per lane. A loop and not `array::from_fn`, whose closure the compiler leaves a function of its own
/// now and then, outside the instruction set of its caller.
macro_rules! each {
    ($zero:literal, $lane:ident => $value:expr) => {{
        let mut values = [$zero; L];
        let mut $lane = 0;
        while $lane < L {
            values[$lane] = $value;
            $lane += 1;
        }
        values
    }};
}

/// `L` independent numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes<const L: usize>(pub [f64; L]);

/// Decisions of `L` lanes: all bits of a lane are set, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct LaneMask<const L: usize>([u64; L]);

impl<const L: usize> Lanes<L> {
    /// The number of each lane: 0, 1, ...
    #[inline(always)]
    pub fn counting() -> Self {
        Self(each!(0.0, lane => lane as f64))
    }
}

impl<const L: usize> Default for Lanes<L> {
    #[inline(always)]
    fn default() -> Self {
        Self([0.0; L])
    }
}

impl<const L: usize> Index<usize> for Lanes<L> {
    type Output = f64;

    #[inline(always)]
    fn index(&self, lane: usize) -> &f64 {
        &self.0[lane]
    }
}

impl<const L: usize> IndexMut<usize> for Lanes<L> {
    #[inline(always)]
    fn index_mut(&mut self, lane: usize) -> &mut f64 {
        &mut self.0[lane]
    }
}

macro_rules! lane_operator {
    ($operator:ident, $method:ident, $symbol:tt) => {
        impl<const L: usize> $operator for Lanes<L> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(each!(0.0, lane => self.0[lane] $symbol other.0[lane]))
            }
        }
    };
}

lane_operator!(Add, add, +);
lane_operator!(Sub, sub, -);
lane_operator!(Mul, mul, *);
lane_operator!(Div, div, /);

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(each!(0.0, lane => -self.0[lane]))
    }
}

impl<const L: usize> AddAssign for Lanes<L> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const L: usize> SubAssign for Lanes<L> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<const L: usize> BitAnd for LaneMask<L> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(each!(0, lane => self.0[lane] & other.0[lane]))
    }
}

impl<const L: usize> BitOr for LaneMask<L> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(each!(0, lane => self.0[lane] | other.0[lane]))
    }
}

impl<const L: usize> Not for LaneMask<L> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self(each!(0, lane => !self.0[lane]))
    }
}

impl<const L: usize> Mask for LaneMask<L> {
    #[inline(always)]
    fn splat(value: bool) -> Self {
        Self([if value { u64::MAX } else { 0 }; L])
    }

    #[inline(always)]
    fn any(self) -> bool {
        let mut all = 0;
        for bits in self.0 {
            all |= bits;
        }
        all != 0
    }

    #[inline(always)]
    fn lane(self, lane: usize) -> bool {
        self.0[lane] != 0
    }
}

impl<const L: usize> Real for Lanes<L> {
    type Mask = LaneMask<L>;
    const LANES: usize = L;

    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0[lane]
    }

    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0[lane] = value;
    }

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; L])
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(each!(0.0, lane => self.0[lane].mul_add(factor.0[lane], addend.0[lane])))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each!(0.0, lane => self.0[lane].sqrt()))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(each!(0.0, lane => self.0[lane].abs()))
    }

    #[inline(always)]
    fn less(self, other: Self) -> LaneMask<L> {
        LaneMask(each!(0, lane => if self.0[lane] < other.0[lane] { u64::MAX } else { 0 }))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> LaneMask<L> {
        LaneMask(each!(0, lane => if self.0[lane] <= other.0[lane] { u64::MAX } else { 0 }))
    }

    #[inline(always)]
    fn select(mask: LaneMask<L>, yes: Self, no: Self) -> Self {
        Self(each!(0.0, lane => if mask.0[lane] != 0 { yes.0[lane] } else { no.0[lane] }))
    }
}
