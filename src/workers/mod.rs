//! Worker processes of a run: started, watched, replaced, dismissed, and found by other commands.
//!
//! A worker is this same executable as `grainspan rve-server`, or the program of another engine. It cannot outlive the macro
//! process: the kernel sends it SIGTERM when its parent ends for any reason.

mod launch;
mod parent_watch;
mod process_list;
mod processes;
mod restart_backoff;
mod run_name;
mod signals;
mod status_file;
mod stderr_tail;
mod worker_groups;

pub(crate) use parent_watch::{RUN_END_TIMEOUT, follow_parent};
pub(crate) use process_list::{WorkerProcess, workers_of};
pub(crate) use processes::{LaunchPlan, WorkerProcesses};
pub(crate) use run_name::run_name;
pub(crate) use signals::SignalWatch;
pub(crate) use status_file::{RunProgress, StatusFile};
pub(crate) use worker_groups::WorkerGroups;
