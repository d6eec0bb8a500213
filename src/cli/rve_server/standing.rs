//! A worker that outlives its runs: it waits for a run of its name, serves it, and waits for the next.
//!
//! A run is served once. Whatever ended it, the next is recognised by its own prefix in shared memory, so a worker that
//! was dismissed does not join the same run again; one that was asked to make room for a new worker restarts itself.

use crate::build_info::running_program;
use crate::exit::{Exit, Failure};
use protocol::transport::shared_memory::{RunDirectory, RunError, SharedMemoryWorkerPort};
use rve_server::server::{ExitReason, ServeError};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::Duration;

/// Between two searches for a run: some 30 us of work five times a second, 0.02 % of a core.
const INTERVAL: Duration = Duration::from_millis(200);

/// Serves every run of this name; ends by a signal only.
///
/// # Errors
/// The name cannot be that of a run.
pub(super) fn serve_for_ever(
    name: &str,
    serve: impl Fn(SharedMemoryWorkerPort) -> Result<ExitReason, ServeError>,
) -> Result<Exit, Failure> {
    let mut done_with: Option<String> = None;
    loop {
        match RunDirectory::find(name) {
            Ok(Some(record)) if done_with.as_ref() != Some(&record.prefix) => {
                match SharedMemoryWorkerPort::join_found(&record) {
                    Ok(port) => {
                        done_with = Some(record.prefix);
                        if log_end(name, serve(port)) {
                            return Err(restart());
                        }
                    }
                    // It may be ending, or have no room: the next search shows.
                    Err(error) => tracing::debug!(run = name, %error, "could not join"),
                }
            }
            Ok(_) => {}
            Err(RunError::Version { prefix, .. }) if done_with.as_ref() == Some(&prefix) => {}
            Err(error @ RunError::Version { .. }) => {
                tracing::error!(run = name, %error, "this run is not served");
                if let RunError::Version { prefix, .. } = error {
                    done_with = Some(prefix);
                }
            }
            Err(error) => return Err(Failure::new(Exit::BadInput, error)),
        }
        std::thread::sleep(INTERVAL);
    }
}

/// Logs the end of a run. Returns whether the run requests a new worker in place of this one.
fn log_end(run: &str, ended: Result<ExitReason, ServeError>) -> bool {
    match ended {
        Ok(ExitReason::Dismissed) => tracing::info!(run, "served; waiting for the next"),
        Ok(ExitReason::Drained) => {
            tracing::info!(run, "restarting for a new worker");
            return true;
        }
        Ok(ExitReason::MacroLost(reason)) => tracing::warn!(run, reason, "the run has ended; waiting for the next"),
        Err(error) => tracing::error!(run, %error, "could not serve; waiting for the next"),
    }
    false
}

/// Executes this program again in the same process, with empty memory; returns only when that fails.
fn restart() -> Failure {
    let mut arguments = std::env::args_os();
    let mut command = Command::new(running_program());
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    let error = command.args(arguments).exec();
    Failure::new(Exit::WorkersLost, format!("a standing worker could not restart: {error}"))
}
