//! What the kernel reports about a worker's process: a progress counter that every engine has, whatever its language.
//!
//! Used to tell a worker that is stopped, or that waits for a processor, from one that hangs. Never read for a result.

use protocol::process::ProcessStat;
use std::time::{Duration, Instant};

/// The process of a worker at one moment; `None` when it cannot be seen from here, or is this one.
pub(in crate::pool) fn process_stat(pid: u32) -> Option<ProcessStat> {
    if pid == std::process::id() { None } else { ProcessStat::of(pid) }
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
    /// Records the process at `now`; `since` is when the worker began its present work.
    pub(in crate::pool) fn record(&mut self, stat: &ProcessStat, since: Instant, now: Instant) {
        if let Some((seen, used)) = self.last
            && stat.is_runnable()
        {
            let passed = now.saturating_duration_since(seen.max(since));
            self.waited_for_processor += passed.saturating_sub(stat.processor_time().saturating_sub(used));
        }
        self.last = Some((now, stat.processor_time()));
        self.stopped_since = stat.is_stopped().then(|| self.stopped_since.unwrap_or(now));
    }

    /// How long it has been stopped.
    pub(in crate::pool) fn stopped(&self, now: Instant) -> Option<Duration> {
        self.stopped_since.map(|since| now.saturating_duration_since(since))
    }

    /// The worker has begun other work.
    pub(in crate::pool) fn restart(&mut self) {
        self.waited_for_processor = Duration::ZERO;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::process::TICKS_PER_SECOND;

    fn stat(state: char, seconds: u64) -> ProcessStat {
        ProcessStat { state, processor_ticks: seconds * TICKS_PER_SECOND, started: 0 }
    }

    #[test]
    fn own_process_is_no_worker() {
        assert_eq!(process_stat(std::process::id()), None);
    }

    #[test]
    fn only_a_worker_that_is_ready_and_gets_no_processor_is_starved() {
        let begin = Instant::now();
        let at = |seconds: u64| begin + Duration::from_secs(seconds);
        let look = |runnable: bool, used| stat(if runnable { 'R' } else { 'S' }, used);
        let mut seen = ProcessHistory::default();
        seen.record(&look(true, 0), begin, at(0));
        seen.record(&look(true, 1), begin, at(10));
        assert_eq!(seen.waited_for_processor, Duration::from_secs(9));
        seen.record(&look(false, 1), begin, at(20));
        assert_eq!(seen.waited_for_processor, Duration::from_secs(9), "it waits for something else");
        seen.restart();
        seen.record(&look(true, 1), at(28), at(30));
        assert_eq!(seen.waited_for_processor, Duration::from_secs(2), "only since it began");
    }

    #[test]
    fn a_stop_counts_from_the_first_look_and_ends_with_it() {
        let begin = Instant::now();
        let look = |stopped: bool| stat(if stopped { 'T' } else { 'R' }, 0);
        let mut seen = ProcessHistory::default();
        seen.record(&look(true), begin, begin);
        seen.record(&look(true), begin, begin + Duration::from_secs(3));
        assert_eq!(seen.stopped(begin + Duration::from_secs(4)), Some(Duration::from_secs(4)));
        seen.record(&look(false), begin, begin + Duration::from_secs(5));
        assert_eq!(seen.stopped(begin + Duration::from_secs(6)), None);
    }
}
