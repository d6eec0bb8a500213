//! Writers of a run's output folder: history, fields, particles, summary.
//!
//! The writers take plain numbers and names; [`Recorder`] feeds them from what the solver reports. Whole files are written next to
//! their final name and renamed, so that a reader never sees half a file; the history grows by whole rows, and a row
//! that does not fit on the disk is taken back.

mod appended;
mod atomic;
mod chosen;
mod energy;
mod fields;
mod frames;
mod history;
mod lines;
mod particles;
mod points;
mod probe;
mod recorder;
mod summary;
mod table;
mod units;

pub use appended::EarlierFiles;
pub use atomic::{is_draft, remove_drafts, try_place, write_atomically, write_without_flush};
pub use chosen::ChosenField;
pub use energy::EnergyLedger;
pub use fields::{Field, FieldGrid, FieldSeries, write_grid};
pub use frames::{frame_file, step_of_frame, write_frame, write_point_frame};
pub use history::{HistoryColumn, HistoryLayout, HistoryRow, HistoryWriter};
pub use lines::write_lines;
pub use particles::write_particles;
pub use probe::{
    Axes, BandProbe, BandProperty, FieldProbe, LayerBand, Measure, Part, Probe, Profile, Quantity, Rank,
    ReferenceState, References, Statistic, StressMeasure,
};
pub use recorder::{RecordPlan, Recorder, StageOutput};
pub use summary::{AccuracySummary, BalanceSummary, CheckpointSummary, RunStatus, Shortcut, Summary, TimeShares};
pub use units::{HISTORY_COLUMNS, is_field};

use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why an output file could not be written.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The system refused.
    #[error("could not write {}: {source}{}", path.display(), remedy(source))]
    Write {
        /// File or folder.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The numbers do not form a valid file: lengths disagree or the format's writer refused.
    #[error("could not encode {}: {reason}", path.display())]
    Encode {
        /// File.
        path: PathBuf,
        /// What is wrong with the content.
        reason: String,
    },
}

impl OutputError {
    /// A refusal of the system for `path`.
    pub fn write(path: &Path, source: io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }

    fn encode(path: &Path, reason: impl ToString) -> Self {
        Self::Encode { path: path.to_owned(), reason: reason.to_string() }
    }
}

fn remedy(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "\nhint: free some space, or choose a place on another disk with --out"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "\nhint: choose a place you may write to with --out"
        }
        io::ErrorKind::NotADirectory => "\nhint: a part of this path is a file; choose another place with --out",
        _ => "",
    }
}
