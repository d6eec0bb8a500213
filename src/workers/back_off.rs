//! When a lost worker is replaced: at once if it was of use, later and later if workers end before they have answered
//! anything.

use std::time::Duration;

/// First pause after a worker that was of no use.
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// The replacements that a run may still make. A long run may lose any number of workers, as long as it gets somewhere.
#[derive(Clone, Debug)]
pub(super) struct BackOff {
    limit: u32,
    granted: u64,
    /// Replacements in a row that ended without an answer.
    fruitless: u32,
}

impl BackOff {
    /// At most `limit` replacements in a row that are of no use.
    pub(super) fn new(limit: u32) -> Self {
        Self { limit, granted: 0, fruitless: 0 }
    }

    /// A worker has ended. Returns the pause before its replacement starts, or `None` when no more are allowed.
    pub(super) fn ended(&mut self, had_answered: bool) -> Option<Duration> {
        if had_answered {
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
    fn workers_that_were_of_use_are_replaced_at_once_however_often() {
        let mut back_off = BackOff::new(3);
        for _ in 0..100 {
            assert_eq!(back_off.ended(true), Some(Duration::ZERO));
        }
        assert_eq!(back_off.granted(), 100);
    }

    #[test]
    fn workers_that_never_answer_are_started_ever_more_slowly_and_then_not_at_all() {
        let mut back_off = BackOff::new(4);
        let pauses: Vec<_> = (0..6).map(|_| back_off.ended(false).map(|pause| pause.as_millis())).collect();
        assert_eq!(pauses, [Some(100), Some(200), Some(400), Some(800), None, None]);
        assert_eq!(back_off.ended(true), Some(Duration::ZERO));
        assert_eq!(back_off.ended(false), Some(FIRST_PAUSE));
        let mut patient = BackOff::new(100);
        for _ in 0..40 {
            patient.ended(false);
        }
        assert_eq!(patient.ended(false), Some(LONGEST_PAUSE));
    }
}
