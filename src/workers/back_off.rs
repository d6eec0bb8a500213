//! When a lost worker is replaced: at once if it had served, later and later if workers end before they can.

use std::time::Duration;

/// First pause after a worker that never served.
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// The replacements that a run may still make.
#[derive(Clone, Debug)]
pub(super) struct BackOff {
    limit: u32,
    used: u32,
    stillborn: u32,
}

impl BackOff {
    /// At most `limit` replacements.
    pub(super) fn new(limit: u32) -> Self {
        Self { limit, used: 0, stillborn: 0 }
    }

    /// A worker took up its work.
    pub(super) fn joined(&mut self) {
        self.stillborn = 0;
    }

    /// A worker has ended. Returns the pause before its replacement starts, or `None` when no more are allowed.
    pub(super) fn ended(&mut self, had_served: bool) -> Option<Duration> {
        if self.used >= self.limit {
            return None;
        }
        self.used += 1;
        if had_served {
            return Some(Duration::ZERO);
        }
        self.stillborn += 1;
        Some((FIRST_PAUSE * 2u32.pow((self.stillborn - 1).min(10))).min(LONGEST_PAUSE))
    }

    /// Replacements granted so far.
    pub(super) fn used(&self) -> u32 {
        self.used
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_that_served_are_replaced_at_once_up_to_the_limit() {
        let mut back_off = BackOff::new(3);
        for _ in 0..3 {
            assert_eq!(back_off.ended(true), Some(Duration::ZERO));
        }
        assert_eq!(back_off.ended(true), None);
        assert_eq!(back_off.used(), 3);
    }

    #[test]
    fn workers_that_never_serve_are_started_ever_more_slowly() {
        let mut back_off = BackOff::new(100);
        let pauses: Vec<_> = (0..4).filter_map(|_| back_off.ended(false)).map(|pause| pause.as_millis()).collect();
        assert_eq!(pauses, [100, 200, 400, 800]);
        back_off.joined();
        assert_eq!(back_off.ended(false), Some(FIRST_PAUSE));
        for _ in 0..40 {
            back_off.ended(false);
        }
        assert_eq!(back_off.ended(false), Some(LONGEST_PAUSE));
    }
}
