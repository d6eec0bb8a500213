//! Why a call was refused or failed.

use crate::SnapshotError;
use macro_solver::material::MaterialError;
use protocol::RveError;
use rve_server::programs::rve_test::ElementError;
use scene_reader::InputError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a call was refused or failed. Committed states are unchanged in every case.
#[derive(Debug, Error)]
pub enum PoolError {
    /// Packing, contact table or test is not what it should be.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The cell refused a trial, or broke down. No trial of the call counts.
    #[error("point {point} of the call: {reason}")]
    Refused {
        /// Place of the trial in the call, from 0; with several refusals the first of the oldest state.
        point: usize,
        /// The cell's reason, with the remedy.
        reason: RveError,
    },
    /// No workers are left and none can be started, or one trial has ended several of them.
    #[error("{0}")]
    WorkersLost(String),
    /// The channel to the workers failed.
    #[error("{0}")]
    Channel(String),
    /// A stop was requested while the call waited.
    #[error("interrupted; committed states are unchanged and the pool serves on")]
    Interrupted,
    /// The pool has been closed.
    #[error("the pool is closed; open another one")]
    Closed,
    /// The process was forked after the pool was opened.
    #[error("the pool belongs to process {owner}, not to this one; open a pool of its own in each process")]
    OtherProcess {
        /// Process that opened the pool.
        owner: u32,
    },
    /// A state of another pool.
    #[error("state {place} of the call belongs to another pool; take states of this pool")]
    ForeignState {
        /// Place in the call, from 0.
        place: usize,
    },
    /// A commit without a trial.
    #[error("state {place} of the call has no trial to commit; nothing was committed")]
    NothingToCommit {
        /// Place in the call, from 0.
        place: usize,
    },
    /// A kind of cell that the pool does not have.
    #[error("there is no cell {cell}: the pool has {cells}, counted from 0")]
    NoSuchCell {
        /// Number given.
        cell: usize,
        /// Kinds of cells of the pool.
        cells: usize,
    },
    /// Arguments whose lengths do not fit each other, or an empty pool.
    #[error("{0}")]
    Arguments(String),
    /// Bytes that are no snapshot of this cell.
    #[error("snapshot {place} of the call: {reason}")]
    Snapshot {
        /// Place in the call, from 0.
        place: usize,
        /// What is wrong, with the remedy.
        reason: SnapshotError,
    },
    /// The program of the workers is not there.
    #[error("there is no program at {}; build it with `cargo build --release`, or give the path of `grainspan`", .0.display())]
    NoProgram(PathBuf),
    /// Channels, workers or threads cannot be made.
    #[error("could not {action}: {reason}")]
    Start {
        /// What failed.
        action: &'static str,
        /// Reason of the system.
        reason: String,
    },
    /// An element test was refused.
    #[error(transparent)]
    Element(#[from] ElementError),
}

impl PoolError {
    /// Whether a smaller deformation could avoid it: a step of the caller should be cut.
    pub fn is_curable_by_smaller_step(&self) -> bool {
        let Self::Refused { point, reason } = self else { return false };
        MaterialError::Point { point: *point, reason: reason.clone() }.is_curable_by_smaller_step()
    }
}
