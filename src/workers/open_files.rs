//! The files that a process may have open: a run has some for each of its workers, and systems start programs with few.

use crate::exit::{Exit, Failure};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Open files of a run without workers: channels, event loop, output.
const BASE: u64 = 64;
/// Open files for each worker: ends of its channels, its process, its messages to the terminal.
const PER_WORKER: u64 = 8;

/// As many as any run of many hosts has. No more: engines outside close all that they may have inherited.
const MOST: u64 = 65_536;

/// Raises the limit of open files as far as the system lets this process, and says so if that is too few for a number of workers.
///
/// # Errors
/// It is too few. Without this, the channels would fail later on, with causes that do not name the limit.
pub(crate) fn allow_for(workers: usize) -> Result<(), Failure> {
    let limit = getrlimit(Resource::Nofile);
    let wanted = limit.maximum.map_or(MOST, |maximum| maximum.min(MOST));
    if limit.current.is_some_and(|current| current < wanted) {
        // A refusal leaves the limit as it is, and that is looked at next.
        let _ = setrlimit(Resource::Nofile, Rlimit { current: Some(wanted), maximum: limit.maximum });
    }
    enough(getrlimit(Resource::Nofile).current, workers).map_err(|message| Failure::new(Exit::BadInput, message))
}

/// Whether so many open files (`None`: any number) are enough for a number of workers.
fn enough(allowed: Option<u64>, workers: usize) -> Result<(), String> {
    let needed = BASE + PER_WORKER * workers as u64;
    match allowed {
        Some(allowed) if allowed < needed => Err(format!(
            "a run with {workers} worker(s) has up to {needed} files open, and the system allows this process {allowed}: raise the limit \
             (`ulimit -n {needed}`), or take fewer workers"
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::enough;

    #[test]
    fn few_open_files_are_refused_with_the_number_that_is_needed() {
        assert_eq!(enough(None, 10_000), Ok(()));
        assert_eq!(enough(Some(1024), 100), Ok(()));
        let refused = enough(Some(1024), 200).unwrap_err();
        assert!(refused.contains("ulimit -n 1664") && refused.contains("allows this process 1024"), "{refused}");
    }
}
