//! The force kernel: one explicit step of one cell, or of several cells side by side, and the choice of the processor's
//! instructions at run time.

pub mod backend;
mod cells_in_lanes;
mod pair;
mod pairs_in_lanes;
mod step;
#[cfg(test)]
mod tests;

pub(in crate::solver) use cells_in_lanes::spread;
pub(in crate::solver) use pair::{PairSite, pair_forces};
pub use pairs_in_lanes::{PairGroup, pack, unpack};
pub use step::{
    Contact, Grain, GrainConstants, ListedPair, MoveSums, PairConstants, Steering, StepData, StepSums, Wanted,
};
