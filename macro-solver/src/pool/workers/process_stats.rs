//! What the kernel reports about a worker's process: a progress counter that every engine has, whatever its language.
//!
//! Used to tell a worker that is stopped, or that waits for a processor, from one that hangs. Never read for a result.

use std::fs;
use std::time::{Duration, Instant};

/// Clock ticks per second in what the kernel tells programs; fixed on Linux whatever its own clock.
const TICKS_PER_SECOND: f64 = 100.0;

/// One look at a process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::pool) struct ProcessStats {
    /// Stopped by a signal or a debugger.
    pub(in crate::pool) stopped: bool,
    /// Running or waiting for a processor; not waiting for anything else.
    pub(in crate::pool) runnable: bool,
    /// Processor time used since its start.
    pub(in crate::pool) used: Duration,
}

impl ProcessStats {
    /// Looks at a process; `None` when it cannot be seen from here, or is this one.
    pub(in crate::pool) fn of(pid: u32) -> Option<Self> {
        if pid == std::process::id() {
            return None;
        }
        Self::parse(&fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
    }

    /// Reads a line of `/proc/PID/stat`; the command in parentheses may contain anything.
    fn parse(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.rsplit_once(')')?.1.split_whitespace().collect();
        let ticks = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
        let state = *fields.first()?;
        Some(Self {
            stopped: matches!(state, "T" | "t"),
            runnable: state == "R",
            used: Duration::from_secs_f64(ticks as f64 / TICKS_PER_SECOND),
        })
    }
}

/// The process of a worker since it has had work.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::pool) struct ProcessHistory {
    last: Option<(Instant, Duration)>,
    /// Time that it was ready to run and got no processor.
    pub(in crate::pool) waited_for_processor: Duration,
    stopped_since: Option<Instant>,
}

impl ProcessHistory {
    /// Takes in a look. `since`: when the worker began what it has in hand.
    pub(in crate::pool) fn take(&mut self, stats: &ProcessStats, since: Instant, now: Instant) {
        if let Some((seen, used)) = self.last
            && stats.runnable
        {
            let passed = now.saturating_duration_since(seen.max(since));
            self.waited_for_processor += passed.saturating_sub(stats.used.saturating_sub(used));
        }
        self.last = Some((now, stats.used));
        self.stopped_since = stats.stopped.then(|| self.stopped_since.unwrap_or(now));
    }

    /// How long it has been stopped.
    pub(in crate::pool) fn stopped(&self, now: Instant) -> Option<Duration> {
        self.stopped_since.map(|since| now.saturating_duration_since(since))
    }

    /// The worker has begun something new.
    pub(in crate::pool) fn restart(&mut self) {
        self.waited_for_processor = Duration::ZERO;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_kernel_is_read_whatever_the_program_is_called() {
        let line = "42 (a) R (b) T 1 42 42 0 -1 4194560 0 0 0 0 120 30 0 0 20 0 1 0 1 1 1";
        let stats = ProcessStats::parse(line).unwrap();
        assert_eq!(stats, ProcessStats { stopped: true, runnable: false, used: Duration::from_millis(1500) });
        assert_eq!(ProcessStats::parse("42 (a"), None);
        assert_eq!(ProcessStats::of(std::process::id()), None);
    }

    #[test]
    fn only_a_worker_that_is_ready_and_gets_no_processor_is_starved() {
        let begin = Instant::now();
        let at = |seconds: u64| begin + Duration::from_secs(seconds);
        let look = |runnable, used| ProcessStats { stopped: false, runnable, used: Duration::from_secs(used) };
        let mut seen = ProcessHistory::default();
        seen.take(&look(true, 0), begin, at(0));
        seen.take(&look(true, 1), begin, at(10));
        assert_eq!(seen.waited_for_processor, Duration::from_secs(9));
        seen.take(&look(false, 1), begin, at(20));
        assert_eq!(seen.waited_for_processor, Duration::from_secs(9), "it waits for something else");
        seen.restart();
        seen.take(&look(true, 1), at(28), at(30));
        assert_eq!(seen.waited_for_processor, Duration::from_secs(2), "only since it began");
    }

    #[test]
    fn a_stop_counts_from_the_first_look_and_ends_with_it() {
        let begin = Instant::now();
        let look = |stopped| ProcessStats { stopped, runnable: !stopped, used: Duration::ZERO };
        let mut seen = ProcessHistory::default();
        seen.take(&look(true), begin, begin);
        seen.take(&look(true), begin, begin + Duration::from_secs(3));
        assert_eq!(seen.stopped(begin + Duration::from_secs(4)), Some(Duration::from_secs(4)));
        seen.take(&look(false), begin, begin + Duration::from_secs(5));
        assert_eq!(seen.stopped(begin + Duration::from_secs(6)), None);
    }
}
