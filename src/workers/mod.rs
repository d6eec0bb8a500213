//! Worker processes of a run: started, watched, replaced, dismissed, and found by other commands.
//!
//! A worker is this same executable in the role `rve-server`, or the program of another engine. It cannot outlive the macro process: the kernel sends it
//! SIGTERM when its parent ends, however that happens.

mod back_off;
mod beacon;
mod fleet;
mod last_words;
mod launch;
mod parent;
mod processes;
mod run_name;
mod signals;
mod survey;

pub(crate) use beacon::{Progress, RunBeacon};
pub(crate) use fleet::Fleet;
pub(crate) use parent::{DYING, follow_parent};
pub(crate) use processes::{LaunchPlan, WorkerProcesses};
pub(crate) use run_name::run_name;
pub(crate) use signals::SignalWatch;
pub(crate) use survey::{WorkerProcess, workers_of};
