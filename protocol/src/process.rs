//! What the kernel reports about a process: the only reader of `/proc/PID` figures in the project.
//!
//! Used to see whether a process lives, runs or is stopped. Never read for a result.

use std::fs;
use std::time::Duration;

/// Clock ticks per second in the kernel's figures; fixed on Linux whatever its own clock.
pub const TICKS_PER_SECOND: u64 = 100;

/// A process at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProcessStat {
    /// The kernel's letter for its state: `R` running or ready, `S` and `D` waiting, `T` and `t` stopped, `Z` ended and not yet
    /// reaped.
    pub state: char,
    /// Processor time used by all its threads since its start, ticks.
    pub processor_ticks: u64,
    /// When it started, ticks since boot: tells it from a later process with the same number.
    pub started: u64,
}

impl ProcessStat {
    /// Reads the figures of a process; `None` when it cannot be seen from here.
    pub fn of(pid: u32) -> Option<Self> {
        Self::parse(&fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
    }

    /// Reads a line of `/proc/PID/stat`. The second field is the command in parentheses and may contain anything.
    fn parse(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.rsplit_once(')')?.1.split_whitespace().collect();
        let number = |place: usize| fields.get(place)?.parse::<u64>().ok();
        Some(Self {
            state: fields.first()?.chars().next()?,
            processor_ticks: number(11)? + number(12)?,
            started: number(19)?,
        })
    }

    /// Whether it lives; an unreaped zombie has ended.
    pub fn is_alive(&self) -> bool {
        !matches!(self.state, 'Z' | 'X')
    }

    /// Whether it was stopped by a signal or a debugger.
    pub fn is_stopped(&self) -> bool {
        matches!(self.state, 'T' | 't')
    }

    /// Whether it runs or waits for a processor, and for nothing else.
    pub fn is_runnable(&self) -> bool {
        self.state == 'R'
    }

    /// Processor time used by all its threads since its start.
    pub fn processor_time(&self) -> Duration {
        Duration::from_millis(self.processor_ticks * (1000 / TICKS_PER_SECOND))
    }
}

/// Resident memory of a process, MiB; `None` when it cannot be seen from here.
pub fn resident_mebibytes(pid: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? >> 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_of_the_kernel_is_read_whatever_the_command_is_called() {
        let line = "42 (a) R (b) T 1 42 42 0 -1 4194560 0 0 0 0 120 30 0 0 20 0 1 0 77 1 1";
        let stat = ProcessStat::parse(line).unwrap();
        assert_eq!(stat, ProcessStat { state: 'T', processor_ticks: 150, started: 77 });
        assert!(stat.is_stopped() && stat.is_alive() && !stat.is_runnable());
        assert_eq!(stat.processor_time(), Duration::from_millis(1500));
        assert_eq!(ProcessStat::parse("42 (a"), None);
    }

    #[test]
    fn this_process_is_alive_and_grows_with_what_it_allocates() {
        assert!(ProcessStat::of(std::process::id()).unwrap().is_alive());
        let allocated = std::hint::black_box(vec![1u8; 32 << 20]);
        assert!(resident_mebibytes(std::process::id()).is_some_and(|size| (32..100_000).contains(&size)));
        drop(allocated);
        assert_eq!((ProcessStat::of(u32::MAX), resident_mebibytes(u32::MAX)), (None, None));
    }
}
