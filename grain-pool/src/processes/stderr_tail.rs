//! Standard error of workers: it goes into the log, and the latest lines are kept for the message about the end of a worker.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::process::ChildStderr;
use std::sync::{Arc, Mutex, PoisonError};

/// Lines kept.
const LINES: usize = 3;

/// Longest line, bytes; a longer one is cut into several. A worker may write without end and without a line break.
const LONGEST: u64 = 64 << 10;

/// Reads lines until there are no more.
fn each_line(mut reader: impl BufRead, mut take: impl FnMut(String)) {
    let mut line = Vec::new();
    while matches!(reader.by_ref().take(LONGEST).read_until(b'\n', &mut line), Ok(length) if length > 0) {
        // A cut may have split a letter, and a worker may write what is not text.
        take(String::from_utf8_lossy(&line).trim_end_matches(['\n', '\r']).to_owned());
        line.clear();
    }
}

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
            each_line(BufReader::new(stderr), |line| {
                tracing::info!(target: "worker", pid, line);
                kept.push(line);
            });
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_whole_and_those_without_an_end_in_pieces() {
        let mut lines = Vec::new();
        each_line(&b"one\r\n\ntwo \xff\nthree"[..], |line| lines.push(line));
        assert_eq!(lines, ["one", "", "two \u{fffd}", "three"]);
        let endless = BufReader::new(std::io::repeat(b'x').take(3 * LONGEST / 2));
        let mut lengths = Vec::new();
        each_line(endless, |line| lengths.push(line.len() as u64));
        assert_eq!(lengths, [LONGEST, LONGEST / 2]);
    }
}
