//! The macro's exact picture of the states that an agent keeps.
//!
//! The macro decides what an agent keeps. An agent keeps every state that passes through it until the macro tells it to forget; so a
//! job that starts from a state in the picture need not carry it. Messages keep their order in either direction; the one race, a
//! reply under way with a state that is just being forgotten, is settled by the number of messages heard.

use protocol::StateId;
use std::collections::BTreeMap;

/// States of one agent, the least recently used first to be forgotten.
#[derive(Debug)]
pub(crate) struct StateMirror {
    limit: u64,
    bytes: u64,
    clock: u64,
    kept: BTreeMap<StateId, (u64, u64)>,
    by_age: BTreeMap<u64, StateId>,
}

impl StateMirror {
    /// Of an agent that keeps up to `limit` bytes.
    pub(crate) fn new(limit: u64) -> Self {
        Self { limit, bytes: 0, clock: 0, kept: BTreeMap::new(), by_age: BTreeMap::new() }
    }

    /// Whether the agent has this state; counts as a use.
    pub(crate) fn holds(&mut self, state: StateId) -> bool {
        match self.kept.get_mut(&state) {
            Some((age, _)) => {
                self.clock += 1;
                self.by_age.remove(age);
                self.by_age.insert(self.clock, state);
                *age = self.clock;
                true
            }
            None => false,
        }
    }

    /// Notes that a state has passed through the agent.
    pub(crate) fn note(&mut self, state: StateId, length: usize) {
        if state == StateId::NONE || length == 0 || self.holds(state) {
            return;
        }
        self.clock += 1;
        self.bytes += length as u64;
        self.kept.insert(state, (self.clock, length as u64));
        self.by_age.insert(self.clock, state);
    }

    /// States beyond the limit, which the agent is to forget now.
    pub(crate) fn surplus(&mut self) -> Vec<StateId> {
        let mut surplus = Vec::new();
        while self.bytes > self.limit
            && let Some((_, state)) = self.by_age.pop_first()
        {
            if let Some((_, length)) = self.kept.remove(&state) {
                self.bytes -= length;
            }
            surplus.push(state);
        }
        surplus
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_states_are_forgotten_down_to_the_limit() {
        let [a, b, c] = [b"a", b"b", b"c"].map(|bytes| StateId::of(bytes));
        let mut mirror = StateMirror::new(250);
        [a, b].into_iter().for_each(|state| mirror.note(state, 100));
        assert!(mirror.surplus().is_empty() && mirror.holds(a));
        mirror.note(c, 100);
        assert_eq!(mirror.surplus(), [b]);
        assert!(mirror.holds(a) && mirror.holds(c) && !mirror.holds(b));
        mirror.note(StateId::NONE, 100);
        assert!(!mirror.holds(StateId::NONE));
        let mut nothing = StateMirror::new(0);
        nothing.note(a, 1);
        assert_eq!(nothing.surplus(), [a]);
    }
}
