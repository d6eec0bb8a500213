//! Wall time for people: no result depends on it.

use std::time::Instant;

/// Wall time since `start`, ns; `u64::MAX` for times that are longer than it can hold.
pub fn nanoseconds_since(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX)
}
