//! When a lost worker is restarted: at once if it had completed a job, with exponential back-off if workers end before that.

use std::time::Duration;

/// First pause after a worker that completed no job.
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// The restarts that a run may still make. A long run may lose any number of workers as long as jobs are completed.
#[derive(Clone, Debug)]
pub(super) struct RestartBackoff {
    limit: u32,
    granted: u64,
    /// Consecutive replacements that ended without a completed job.
    fruitless: u32,
}

impl RestartBackoff {
    /// At most `limit` consecutive replacements without a completed job.
    pub(super) fn new(limit: u32) -> Self {
        Self { limit, granted: 0, fruitless: 0 }
    }

    /// A worker has ended. Returns the pause before its replacement starts, or `None` when no more are allowed.
    pub(super) fn ended(&mut self, had_completed_job: bool) -> Option<Duration> {
        if had_completed_job {
            self.fruitless = 0;
        } else if self.fruitless >= self.limit {
            return None;
        } else {
            self.fruitless += 1;
        }
        self.granted += 1;
        match self.fruitless {
            0 => Some(Duration::ZERO),
            count => Some((FIRST_PAUSE * 2u32.pow((count - 1).min(10))).min(LONGEST_PAUSE)),
        }
    }

    /// Replacements granted so far.
    pub(super) fn granted(&self) -> u64 {
        self.granted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_that_completed_a_job_are_replaced_at_once_however_often() {
        let mut restart_backoff = RestartBackoff::new(3);
        for _ in 0..100 {
            assert_eq!(restart_backoff.ended(true), Some(Duration::ZERO));
        }
        assert_eq!(restart_backoff.granted(), 100);
    }

    #[test]
    fn workers_that_complete_no_job_are_restarted_with_growing_pauses_and_then_not_at_all() {
        let mut restart_backoff = RestartBackoff::new(4);
        let pauses: Vec<_> = (0..6).map(|_| restart_backoff.ended(false).map(|pause| pause.as_millis())).collect();
        assert_eq!(pauses, [Some(100), Some(200), Some(400), Some(800), None, None]);
        assert_eq!(restart_backoff.ended(true), Some(Duration::ZERO));
        assert_eq!(restart_backoff.ended(false), Some(FIRST_PAUSE));
        let mut long = RestartBackoff::new(100);
        for _ in 0..40 {
            long.ended(false);
        }
        assert_eq!(long.ended(false), Some(LONGEST_PAUSE));
    }
}
