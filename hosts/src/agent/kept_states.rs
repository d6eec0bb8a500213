//! States that have passed through an agent, kept until the macro says that they are no longer wanted.
//!
//! The counterpart of the macro's mirror (`hosts/src/state_mirror.rs`).

use super::Replies;
use protocol::StateId;
use protocol::transport::LoadedJob;
use std::collections::BTreeMap;

#[derive(Debug)]
struct Kept {
    bytes: Box<[u8]>,
    /// Number of the last message to the macro that carried it; 0 if it came from the macro.
    sent_with: u64,
}

/// The states of one connection.
#[derive(Debug)]
pub(super) struct KeptStates {
    /// Whether any are kept: otherwise the macro keeps no account of them, and nothing would ever be forgotten.
    enabled: bool,
    states: BTreeMap<StateId, Kept>,
    /// Messages sent to the macro.
    sent: u64,
}

impl KeptStates {
    /// None yet, and none ever unless `enabled`.
    pub(super) fn new(enabled: bool) -> Self {
        Self { enabled, states: BTreeMap::new(), sent: 0 }
    }

    /// A message is about to be sent to the macro.
    pub(super) fn count_message(&mut self) {
        self.sent += 1;
    }

    /// Keeps the states of replies that are about to be sent.
    pub(super) fn take_replies(&mut self, replies: Replies<'_>) {
        if !self.enabled {
            return;
        }
        let sent = self.sent;
        for one in replies.iter().filter(|one| !one.state.is_empty()) {
            let kept =
                self.states.entry(one.reply.state).or_insert_with(|| Kept { bytes: one.state.into(), sent_with: 0 });
            kept.sent_with = sent;
        }
    }

    /// Keeps the state that a job has brought.
    pub(super) fn take_job(&mut self, one: &LoadedJob<'_>) {
        if self.enabled && !one.state.is_empty() {
            self.states.entry(one.job.state).or_insert_with(|| Kept { bytes: one.state.into(), sent_with: 0 });
        }
    }

    /// A state, if it is kept.
    pub(super) fn get(&self, state: StateId) -> Option<&[u8]> {
        self.states.get(&state).map(|kept| &*kept.bytes)
    }

    /// Forgets states, except those that a message above number `heard` has brought to the macro again: it counts on them.
    pub(super) fn forget(&mut self, states: &[StateId], heard: u64) {
        for state in states {
            if self.states.get(state).is_some_and(|kept| kept.sent_with <= heard) {
                self.states.remove(state);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use protocol::transport::LoadedReply;
    use protocol::wire::TrialReply;

    #[test]
    fn a_state_that_is_under_way_to_the_macro_again_is_not_forgotten() {
        let (mut kept, id) = (KeptStates::new(true), StateId::of(b"state"));
        let replies =
            [LoadedReply { reply: TrialReply { state: id, ..TrialReply::zeroed() }, state: b"state", error: b"" }];
        kept.count_message();
        kept.take_replies(&replies);
        kept.count_message();
        kept.take_replies(&replies);
        kept.forget(&[id], 1);
        assert_eq!(kept.get(id), Some(&b"state"[..]));
        kept.forget(&[id], 2);
        assert_eq!(kept.get(id), None);
    }
}
