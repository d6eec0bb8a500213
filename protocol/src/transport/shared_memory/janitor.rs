//! Cures a hang of iceoryx2 0.10: a process killed between making a shared-memory file and giving it a size leaves an
//! empty file, and whoever cleans up after the dead process then waits for ever for that size to appear.

use super::run_directory::segments;
use std::fs;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

const ROUND: Duration = Duration::from_millis(50);

/// A living process needs microseconds between the two calls, some milliseconds when it is not scheduled.
const ABANDONED: Duration = Duration::from_millis(200);

/// A thread that removes abandoned empty files of one run. It must be another thread than the one that may hang.
pub(super) struct Janitor {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Janitor {
    /// Starts the rounds for files whose names begin with `prefix`.
    pub(super) fn start(prefix: String) -> std::io::Result<Self> {
        let (stop, stopped) = channel();
        let thread = std::thread::Builder::new().name("janitor".to_owned()).spawn(move || {
            while stopped.recv_timeout(ROUND) == Err(RecvTimeoutError::Timeout) {
                remove_abandoned(&prefix);
            }
        })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Janitor {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn remove_abandoned(prefix: &str) {
    for (path, metadata) in segments(prefix) {
        let age = metadata.modified().ok().and_then(|time| time.elapsed().ok()).unwrap_or_default();
        if metadata.len() == 0 && age > ABANDONED && fs::remove_file(&path).is_ok() {
            tracing::debug!(path = %path.display(), "removed an empty file of a killed process");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::run_directory::fresh_number;
    use super::*;
    use std::time::Instant;

    #[test]
    fn empty_files_of_the_run_go_and_full_ones_stay() {
        let prefix = format!("g{:08x}_", fresh_number() as u32);
        let path = |end: &str| std::path::PathBuf::from(format!("/dev/shm/{prefix}{end}"));
        fs::write(path("empty"), b"").unwrap();
        fs::write(path("full"), b"x").unwrap();
        let janitor = Janitor::start(prefix.clone()).unwrap();
        let begin = Instant::now();
        while path("empty").exists() {
            assert!(begin.elapsed() < Duration::from_secs(5), "the empty file was left");
            std::thread::yield_now();
        }
        assert!(begin.elapsed() >= Duration::from_millis(150), "a file was not given the time to be born");
        assert!(path("full").exists());
        drop(janitor);
        fs::remove_file(path("full")).unwrap();
    }
}
