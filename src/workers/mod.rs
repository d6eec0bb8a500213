//! Worker processes of a run: started, watched, replaced, dismissed, and found by other commands.
//!
//! A worker is this same executable in the role `rve-server`. It cannot outlive the macro process: the kernel sends it

mod back_off;
mod last_words;
mod processes;
mod run_name;
mod signals;
mod survey;

pub(crate) use processes::{LaunchPlan, WorkerProcesses};
pub(crate) use run_name::run_name;
pub(crate) use signals::SignalWatch;
pub(crate) use survey::{WorkerProcess, workers_of};
