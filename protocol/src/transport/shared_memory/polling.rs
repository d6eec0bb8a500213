//! The wait of a port for its next messages, the same at both ends.

use crate::transport::TransportError;
use std::time::{Duration, Instant};

/// An end of the channel that can wait.
pub(super) trait Waits {
    /// Looks for messages, for at most this long. Returns whether to read them now; otherwise the end is to sleep.
    fn look(&mut self, limit: Duration) -> bool;

    /// Sleeps until something happens, for at most about this long.
    ///
    /// # Errors
    /// The system's reason.
    fn sleep(&mut self, limit: Duration) -> Result<(), TransportError>;
}

/// Drains a port until it has had events or `wait` is over. Returns the number of events.
///
/// # Errors
/// Those of `drain`, and of a wait that fails.
pub(super) fn poll<P: Waits>(
    port: &mut P,
    wait: Duration,
    mut drain: impl FnMut(&mut P) -> Result<usize, TransportError>,
) -> Result<usize, TransportError> {
    let events = drain(port)?;
    if events > 0 || wait.is_zero() {
        return Ok(events);
    }
    let end = Instant::now().checked_add(wait);
    loop {
        let left = end.map_or(wait, |end| end.saturating_duration_since(Instant::now()));
        let awake = port.look(left);
        if !awake {
            port.sleep(left)?;
        }
        let events = drain(port)?;
        if events > 0 || !awake || left.is_zero() {
            return Ok(events);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An end whose looks find something or not.
    struct Script {
        /// Events of the drains, the last drain first.
        events: Vec<usize>,
        finds: bool,
        looks: usize,
        sleeps: usize,
    }

    impl Waits for Script {
        fn look(&mut self, _: Duration) -> bool {
            self.looks += 1;
            self.finds
        }

        fn sleep(&mut self, _: Duration) -> Result<(), TransportError> {
            self.sleeps += 1;
            Ok(())
        }
    }

    /// Events that a poll has returned, its looks and its sleeps.
    fn polled(events: &[usize], finds: bool, wait: Duration) -> [usize; 3] {
        let mut port = Script { events: events.iter().rev().copied().collect(), finds, looks: 0, sleeps: 0 };
        let events = poll(&mut port, wait, |port| Ok(port.events.pop().unwrap_or(0))).unwrap();
        [events, port.looks, port.sleeps]
    }

    #[test]
    fn events_that_are_there_end_the_poll_at_once() {
        assert_eq!(polled(&[2], false, Duration::MAX), [2, 0, 0]);
        assert_eq!(polled(&[0], false, Duration::ZERO), [0, 0, 0]);
    }

    #[test]
    fn a_sleep_ends_the_poll_even_without_events() {
        assert_eq!(polled(&[0, 3], false, Duration::MAX), [3, 1, 1]);
        assert_eq!(polled(&[0, 0, 3], false, Duration::MAX), [0, 1, 1]);
    }

    #[test]
    fn looks_go_on_until_events_come() {
        assert_eq!(polled(&[0, 0, 0, 1], true, Duration::MAX), [1, 3, 0]);
    }
}
