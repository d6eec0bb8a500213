//! The macro's picture of which states a worker still holds.

use protocol::StateId;
use std::collections::BTreeMap;

/// Least-recently-used mirror of a worker's state cache. It may be wrong in either direction without harm: a snapshot
/// sent needlessly costs a copy, one missing costs a `NeedState` round trip.
#[derive(Clone, Debug)]
pub(in crate::pool) struct CacheMirror {
    capacity: usize,
    clock: u64,
    last_use: BTreeMap<StateId, u64>,
    by_age: BTreeMap<u64, StateId>,
}

impl CacheMirror {
    /// Mirror of an empty cache that keeps `capacity` states.
    pub(in crate::pool) fn new(capacity: usize) -> Self {
        Self { capacity, clock: 0, last_use: BTreeMap::new(), by_age: BTreeMap::new() }
    }

    /// Whether the worker is believed to hold `state`. The initial state of a known definition is always at hand.
    pub(in crate::pool) fn holds(&self, state: StateId) -> bool {
        state == StateId::NONE || self.last_use.contains_key(&state)
    }

    /// Notes that the worker has just used or produced `state`.
    pub(in crate::pool) fn touch(&mut self, state: StateId) {
        if state == StateId::NONE || self.capacity == 0 {
            return;
        }
        self.clock += 1;
        if let Some(earlier) = self.last_use.insert(state, self.clock) {
            self.by_age.remove(&earlier);
        }
        self.by_age.insert(self.clock, state);
        if self.last_use.len() > self.capacity
            && let Some((_, oldest)) = self.by_age.pop_first()
        {
            self.last_use.remove(&oldest);
        }
    }

    /// Notes that the worker said it lacks `state`.
    pub(in crate::pool) fn forget(&mut self, state: StateId) {
        if let Some(age) = self.last_use.remove(&state) {
            self.by_age.remove(&age);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(number: u8) -> StateId {
        StateId::of(&[number])
    }

    #[test]
    fn least_recently_used_state_is_forgotten_first() {
        let mut mirror = CacheMirror::new(2);
        mirror.touch(state(1));
        mirror.touch(state(2));
        mirror.touch(state(1));
        mirror.touch(state(3));
        assert!(mirror.holds(state(1)) && mirror.holds(state(3)));
        assert!(!mirror.holds(state(2)));
        mirror.forget(state(1));
        assert!(!mirror.holds(state(1)));
    }

    #[test]
    fn a_cache_of_no_states_holds_only_initial_states() {
        let mut mirror = CacheMirror::new(0);
        mirror.touch(state(1));
        assert!(!mirror.holds(state(1)));
        assert!(mirror.holds(StateId::NONE));
    }
}
