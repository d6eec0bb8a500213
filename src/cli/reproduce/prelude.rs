//! What every figure uses.

pub(super) use super::curve::{Curve, crossing, liu_ratio, mean_between, median_of, peak, trough, value_at, work};
pub(super) use super::error::ReproduceError;
pub(super) use super::figure::{At, Command, Figure, Outcome, Run, Size};
pub(super) use super::results::Results;
pub(super) use crate::cli::comparison::{Comparison, Theirs, Tolerance};
pub(super) use charts::{Chart, Map, Panel, Scale};
