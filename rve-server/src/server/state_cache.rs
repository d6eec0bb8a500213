//! The states that a worker keeps at hand, so that a job need not carry a snapshot the worker has just produced.

use protocol::StateId;
use std::collections::BTreeMap;
use std::rc::Rc;

/// A bounded set of snapshots by name; the least recently used one leaves first.
#[derive(Debug)]
pub(super) struct StateCache {
    capacity: usize,
    /// Counts uses; the order of uses decides who leaves.
    clock: u64,
    snapshots: BTreeMap<StateId, Kept>,
    by_age: BTreeMap<u64, StateId>,
}

#[derive(Debug)]
struct Kept {
    used: u64,
    bytes: Rc<Vec<u8>>,
}

impl StateCache {
    /// A cache of at most `capacity` snapshots, at least one.
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity: capacity.max(1), clock: 0, snapshots: BTreeMap::new(), by_age: BTreeMap::new() }
    }

    /// The snapshot named `id`; counts as a use.
    pub(super) fn get(&mut self, id: StateId) -> Option<Rc<Vec<u8>>> {
        self.touch(id);
        self.snapshots.get(&id).map(|kept| Rc::clone(&kept.bytes))
    }

    /// Keeps `bytes`, whose name is `id`; counts as a use.
    pub(super) fn insert(&mut self, id: StateId, bytes: Rc<Vec<u8>>) {
        if self.snapshots.contains_key(&id) {
            return self.touch(id);
        }
        while self.snapshots.len() >= self.capacity {
            let Some((_, oldest)) = self.by_age.pop_first() else { break };
            self.snapshots.remove(&oldest);
        }
        self.clock += 1;
        self.by_age.insert(self.clock, id);
        self.snapshots.insert(id, Kept { used: self.clock, bytes });
    }

    fn touch(&mut self, id: StateId) {
        let Some(kept) = self.snapshots.get_mut(&id) else { return };
        self.clock += 1;
        self.by_age.remove(&kept.used);
        kept.used = self.clock;
        self.by_age.insert(self.clock, id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_state_leaves_first() {
        let mut cache = StateCache::new(2);
        let [a, b, c] = [b"a", b"b", b"c"].map(|bytes| StateId::of(bytes));
        let bytes = |text: &[u8]| Rc::new(text.to_vec());
        cache.insert(a, bytes(b"a"));
        cache.insert(b, bytes(b"b"));
        assert_eq!(cache.get(a), Some(bytes(b"a")));
        cache.insert(c, bytes(b"c"));
        assert_eq!(cache.get(b), None);
        assert_eq!(cache.get(a), Some(bytes(b"a")));
        assert_eq!(cache.get(c), Some(bytes(b"c")));
    }
}
