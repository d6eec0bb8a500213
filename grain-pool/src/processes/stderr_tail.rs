//! Standard error of workers: it goes into the log, and the latest lines are kept for the message about the end of a worker.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader};
use std::process::ChildStderr;
use std::sync::{Arc, Mutex, PoisonError};

/// Lines kept.
const LINES: usize = 3;

/// The latest lines of one worker; filled by a thread until the worker closes its standard error.
#[derive(Clone, Debug, Default)]
pub(super) struct StderrTail(Arc<Mutex<VecDeque<String>>>);

impl StderrTail {
    /// Starts to read the standard error of the worker `pid`.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn of(pid: u32, stderr: ChildStderr) -> std::io::Result<Self> {
        let tail = Self::default();
        let kept = tail.clone();
        std::thread::Builder::new().name(format!("stderr-{pid}")).spawn(move || {
            for line in BufReader::new(stderr).lines() {
                // Lines that are not text are of no use to people.
                let Ok(line) = line else { continue };
                tracing::info!(target: "worker", pid, line);
                kept.push(line);
            }
        })?;
        Ok(tail)
    }

    fn push(&self, line: String) {
        let mut lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// The lines joined into one; empty if there are none.
    pub(super) fn text(&self) -> String {
        let lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        lines.iter().map(String::as_str).collect::<Vec<_>>().join(" | ")
    }
}
