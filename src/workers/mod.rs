//! Worker processes as other commands see them: how a worker follows its run, how a run is stopped, and what `grainspan status`
//! finds. Starting and replacing them is the part of the crate `grain-pool`.

mod open_files;
mod parent_watch;
mod process_list;
mod signals;
mod status_file;

pub(crate) use open_files::allow_for as allow_open_files_for;
pub(crate) use parent_watch::{RUN_END_TIMEOUT, follow_parent};
pub(crate) use process_list::{WorkerProcess, workers_of};
pub(crate) use signals::SignalWatch;
pub(crate) use status_file::{RunProgress, StatusFile, run_that_writes_to};
