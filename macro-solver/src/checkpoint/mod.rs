//! What a run needs to go on after its process has ended: collected after every accepted step, written now and then.
//!
//! **A resumed run writes the same bytes as an undisturbed one.** So everything that can influence a later bit is in an
//! [`Archive`]; what can be computed from the scene is not. Three kinds of parts save themselves into it: the driver
//! of the run (displacements, load, step size, per-point memory), the material (committed states) and the observers
//! (rows written, sums). Each owns one named, versioned section, and restores from it or refuses with a reason.
//!
//! The driver of a run takes an earlier archive from its [`CheckpointStore`] before the first step, and hands every accepted step to it
//! when everything about the step has been committed and reported. [`CheckpointFile`] makes files of archives,
//! [`PeriodicCheckpoints`] decides when.

mod archive;
mod failure_case;
mod file;
mod periodic;
#[cfg(test)]
mod tests;

pub use archive::Archive;
pub use failure_case::FailureCase;
pub use file::{CHECKPOINT_FORMAT, CheckpointFile, StoredCheckpoint};
pub use periodic::{CheckpointFigures, CheckpointPolicy, PeriodicCheckpoints};

use std::path::PathBuf;
use thiserror::Error;

/// Why a checkpoint cannot be used or made.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The system refused.
    #[error("could not {action} {}: {source}", path.display())]
    System {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is not whole or not of this kind.
    #[error("{} is not a sound {kind}: {reason}", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// What it should be.
        kind: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// The file was written in another format.
    #[error(
        "{} has format version {found}, but this program reads version {expected}; continue with the program that wrote \
         it, or start again without --resume",
        path.display()
    )]
    Format {
        /// File.
        path: PathBuf,
        /// Version found.
        found: u32,
        /// Version read by this program.
        expected: u32,
    },
    /// A part of the run finds nothing of its own.
    #[error("the checkpoint holds nothing for `{section}`: it was written by another kind of run")]
    Missing {
        /// Name of the part.
        section: String,
    },
    /// A part of the run was written by another version of itself.
    #[error(
        "`{section}` has version {found} in the checkpoint, but this program reads version {expected}; continue with the \
         program that wrote it, or start again without --resume"
    )]
    Section {
        /// Name of the part.
        section: String,
        /// Version found.
        found: u32,
        /// Version read by this program.
        expected: u32,
    },
    /// What was written for a part does not fit this run.
    #[error("`{section}` in the checkpoint does not fit this run: {reason}")]
    Unfit {
        /// Name of the part.
        section: String,
        /// What does not fit.
        reason: String,
    },
}

impl CheckpointError {
    /// A section whose content does not fit the run.
    pub fn unfit(section: &str, reason: impl ToString) -> Self {
        Self::Unfit { section: section.to_owned(), reason: reason.to_string() }
    }
}

/// Progress of a run when it is saved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Accepted steps.
    pub step: u64,
    /// Stage, from 0.
    pub stage: u64,
    /// Share of the stage, 0 to 1.
    pub load: f64,
}

/// Stores the checkpoints of a run and returns the one to continue from.
pub trait CheckpointStore {
    /// The state to continue from, saved by an earlier process of the run; called once, before the first step. `None`: from the start.
    fn earlier(&mut self) -> Option<Archive>;

    /// A step is complete. `fill` collects the state of the run; no error here ends a run.
    fn save_step(&mut self, progress: Progress, fill: &mut dyn FnMut(&mut Archive));
}

/// Stores nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoCheckpoints;

impl CheckpointStore for NoCheckpoints {
    fn earlier(&mut self) -> Option<Archive> {
        None
    }

    fn save_step(&mut self, _progress: Progress, _fill: &mut dyn FnMut(&mut Archive)) {}
}
