//! Numbers in lanes: the same arithmetic on one number or on several at once.
//!
//! Formulas are written once over [`Real`]. `f64` is the canonical number; [`Lanes`] does the same operations on `L`
//! numbers that never see each other, so lane `k` of a result has the bits that `f64` would have given. What makes that
//! true: only IEEE operations that every back end rounds alike (sum, product, quotient, square root, fused
//! multiply-add), no reassociation, no approximate reciprocal, decisions by [`Real::select`] and never by a
//! multiplication with zero.

mod array;
mod dispatch;
mod real;
#[cfg(test)]
mod tests;
mod tuple;

pub use array::{LaneMask, Lanes};
pub(crate) use dispatch::{Vectorised, dispatch};
pub use real::{Mask, Real};
pub use tuple::Tuple;
pub(crate) use tuple::{put_lane, take_lane};
