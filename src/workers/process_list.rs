//! The worker processes of a run among all processes of this machine.

use protocol::process::{self, ProcessStat};
use std::fs;

/// One worker process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WorkerProcess {
    /// Process id.
    pub(crate) pid: u32,
    /// The kernel's letter for its state: `R` running, `S` waiting, `T` stopped.
    pub(crate) state: char,
    /// Processor time used, in ticks.
    pub(crate) ticks: u64,
}

impl WorkerProcess {
    /// Ticks per second.
    pub(crate) const TICKS_PER_SECOND: u64 = process::TICKS_PER_SECOND;
}

/// Workers of the run on this machine, ordered by process id: those with this program's command line, and those that the run's
/// status file lists (`known`), which may be other programs.
pub(crate) fn workers_of(run: &str, known: &[u32]) -> Vec<WorkerProcess> {
    let Ok(entries) = fs::read_dir("/proc") else { return Vec::new() };
    let pids = entries.flatten().filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let mut workers: Vec<_> =
        pids.filter(|pid| known.contains(pid) || serves(*pid, run)).filter_map(inspect).collect();
    workers.sort_by_key(|worker| worker.pid);
    workers
}

fn serves(pid: u32, run: &str) -> bool {
    let Ok(line) = fs::read(format!("/proc/{pid}/cmdline")) else { return false };
    is_worker_of(&line, run)
}

/// Whether a command line, words ended by zero bytes, is that of a worker of the run.
fn is_worker_of(line: &[u8], run: &str) -> bool {
    let words: Vec<_> = line.split(|byte| *byte == 0).collect();
    let joined = format!("--run={run}");
    words.get(1) == Some(&b"rve-server".as_slice())
        && (words.windows(2).any(|pair| pair[0] == b"--run" && pair[1] == run.as_bytes())
            || words.contains(&joined.as_bytes()))
}

fn inspect(pid: u32) -> Option<WorkerProcess> {
    let stat = ProcessStat::of(pid)?;
    Some(WorkerProcess { pid, state: stat.state, ticks: stat.processor_ticks })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_are_told_from_their_command_line() {
        assert!(is_worker_of(b"/usr/bin/grainspan\0rve-server\0--run\0a-1\0--parent\x007\0", "a-1"));
        assert!(is_worker_of(b"grainspan\0rve-server\0--run=a-1\0", "a-1"));
        assert!(!is_worker_of(b"grainspan\0rve-server\0--run\0a-12\0", "a-1"));
        assert!(!is_worker_of(b"grainspan\0status\0a-1\0", "a-1"));
        assert!(!is_worker_of(b"", "a-1"));
    }

    #[test]
    fn this_process_can_be_inspected() {
        let here = inspect(std::process::id()).unwrap();
        assert_eq!(here.pid, std::process::id());
        assert_eq!(workers_of("no such run", &[here.pid]).len(), 1);
        assert!(workers_of("no such run", &[]).is_empty());
    }
}
