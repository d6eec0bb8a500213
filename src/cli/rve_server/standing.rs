//! A worker that outlives its runs: it waits for a run of its name, serves it, and waits for the next.
//!
//! A run is served once. Whatever ended it, the next is recognised by its own prefix in shared memory, so a worker that
//! was sent away does not come back to the run that sent it away; one that was asked to make room for a fresh worker becomes
//! that worker.

use crate::cli::exit::{Exit, Failure};
use protocol::transport::shared_memory::{RunDirectory, RunError, SharedMemoryWorkerPort};
use rve_server::server::{ExitReason, ServeError};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::Duration;

/// Between two looks for a run: some 30 us of work five times a second, a fiftieth of a per cent of a core.
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
                        if told(name, serve(port)) {
                            return Err(start_afresh());
                        }
                    }
                    // It may be ending, or have no room: the next look tells.
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

/// What a supervisor's log needs: the end of every run. Returns whether the run wants a fresh worker in this one's place.
fn told(run: &str, ended: Result<ExitReason, ServeError>) -> bool {
    match ended {
        Ok(ExitReason::Dismissed) => tracing::info!(run, "served; waiting for the next"),
        Ok(ExitReason::Drained) => {
            tracing::info!(run, "made room for a fresh worker");
            return true;
        }
        Ok(ExitReason::MacroLost(reason)) => tracing::warn!(run, reason, "the run has ended; waiting for the next"),
        Err(error) => tracing::error!(run, %error, "could not serve; waiting for the next"),
    }
    false
}

/// Begins this program anew in the same process, with nothing in its memory; returns only when that fails.
fn start_afresh() -> Failure {
    let error = match std::env::current_exe() {
        Ok(program) => Command::new(program).args(std::env::args_os().skip(1)).exec(),
        Err(error) => error,
    };
    Failure::new(Exit::WorkersLost, format!("a standing worker could not begin anew: {error}"))
}
