//! Cures a hang of iceoryx2 0.10: a process killed between making a shared-memory file and giving it a size leaves an
//! empty file, and whoever cleans up after the dead process then waits for ever for that size to appear.

use super::run_directory::{SHARED_MEMORY, segments};
use std::fs;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

const ROUND: Duration = Duration::from_millis(50);

/// A living process needs microseconds between the two calls, some milliseconds when it is not scheduled.
const ABANDONED: Duration = Duration::from_millis(200);

/// Age from which the time stamp of the folder is believed: stamps are coarse, and several changes can have the same.
const SETTLED: Duration = Duration::from_secs(1);

/// A thread that removes abandoned empty files of one run. It must be another thread than the one that may hang.
pub(super) struct EmptyFileRemoval {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl EmptyFileRemoval {
    /// Starts the rounds for files whose names begin with `prefix`.
    pub(super) fn start(prefix: String) -> std::io::Result<Self> {
        let (stop, stopped) = channel();
        let thread = std::thread::Builder::new().name("empty-files".to_owned()).spawn(move || {
            let mut rounds = Rounds { prefix, clean: None };
            while stopped.recv_timeout(ROUND) == Err(RecvTimeoutError::Timeout) {
                rounds.walk();
            }
        })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for EmptyFileRemoval {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// To look at every file of the machine's shared memory takes a tenth of a millisecond and more; to ask whether any has come, a
/// microsecond. Long runs do the first some times and the second twenty times a second.
struct Rounds {
    prefix: String,
    /// Time stamp of the folder when no file in it was empty.
    clean: Option<SystemTime>,
}

impl Rounds {
    /// Looks, if anything can have changed; returns whether it did.
    fn walk(&mut self) -> bool {
        // Read before the files are: one that comes meanwhile changes it.
        let stamp = fs::metadata(SHARED_MEMORY).and_then(|folder| folder.modified()).ok();
        if stamp.is_some() && stamp == self.clean {
            return false;
        }
        let is_settled = |time: &SystemTime| time.elapsed().is_ok_and(|age| age > SETTLED);
        let found = remove_abandoned(&self.prefix);
        self.clean = stamp.filter(|time| !found && is_settled(time));
        true
    }
}

/// Removes the empty files that are old; returns whether there were empty files of any age.
fn remove_abandoned(prefix: &str) -> bool {
    let mut found = false;
    for (path, metadata) in segments(prefix).filter(|(_, metadata)| metadata.len() == 0) {
        found = true;
        let age = metadata.modified().ok().and_then(|time| time.elapsed().ok()).unwrap_or_default();
        if age > ABANDONED && fs::remove_file(&path).is_ok() {
            tracing::debug!(path = %path.display(), "removed an empty file of a killed process");
        }
    }
    found
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
        let empty_files = EmptyFileRemoval::start(prefix.clone()).unwrap();
        let begin = Instant::now();
        while path("empty").exists() {
            assert!(begin.elapsed() < Duration::from_secs(5), "the empty file was left");
            std::thread::yield_now();
        }
        assert!(begin.elapsed() >= Duration::from_millis(150), "a file was not given the time to be born");
        assert!(path("full").exists());
        drop(empty_files);
        fs::remove_file(path("full")).unwrap();
    }

    /// Other tests make files in the same folder at any time, so only what must be is claimed.
    #[test]
    fn files_are_looked_at_while_the_folder_changes_or_one_is_empty() {
        let prefix = format!("g{:08x}_", fresh_number() as u32);
        let path = format!("{SHARED_MEMORY}/{prefix}late");
        let mut rounds = Rounds { prefix, clean: Some(SystemTime::UNIX_EPOCH) };
        assert!(rounds.walk(), "the folder is not as it was");
        fs::write(&path, b"").unwrap();
        assert!(rounds.walk() && rounds.clean.is_none(), "an empty file may be one of a killed process");
        assert!(rounds.walk(), "and is watched");
        // It has gone by itself if this test was held up.
        let _ = fs::remove_file(&path);
    }
}
