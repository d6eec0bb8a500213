//! Finds the queue with most work among those whose longest job is long, without looking at all queues.
//!
//! Queues are filed by the binary order of magnitude of their longest job. All queues of the highest order are long ones; of
//! the order below some are, and they are tried in the order of their work.

use protocol::transport::WorkerId;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Worker whose jobs a queue holds; `None` for jobs without affinity.
type Affinity = Option<WorkerId>;

/// Queues by their longest job and their work, both in expected force evaluations.
#[derive(Debug, Default)]
pub(in crate::pool) struct QueueIndex {
    heads: BTreeSet<(u64, Affinity)>,
    /// By order of magnitude: most work first, the lowest affinity among equals, and the longest job.
    orders: BTreeMap<u32, BTreeSet<(Reverse<u128>, Affinity, u64)>>,
}

impl QueueIndex {
    /// Inserts a queue with its longest job and its work.
    pub(in crate::pool) fn insert(&mut self, affinity: Affinity, head: u64, work: u128) {
        self.heads.insert((head, affinity));
        self.orders.entry(order(head)).or_default().insert((Reverse(work), affinity, head));
    }

    /// Removes a queue; the numbers are those it was inserted with.
    pub(in crate::pool) fn remove(&mut self, affinity: Affinity, head: u64, work: u128) {
        self.heads.remove(&(head, affinity));
        if let Some(alike) = self.orders.get_mut(&order(head)) {
            alike.remove(&(Reverse(work), affinity, head));
            if alike.is_empty() {
                self.orders.remove(&order(head));
            }
        }
    }

    /// The longest job of all; `None` when there are no queues.
    pub(in crate::pool) fn longest(&self) -> Option<u64> {
        self.heads.last().map(|(head, _)| *head)
    }

    /// The queue with most work among those whose longest job takes `least` or more; the lowest affinity among equals.
    pub(in crate::pool) fn most_work(&self, least: u64) -> Option<Affinity> {
        let orders = self.orders.range(order(least)..);
        let best = orders.filter_map(|(_, queues)| queues.iter().find(|(_, _, head)| *head >= least));
        best.map(|(work, affinity, _)| (*work, *affinity)).min().map(|(_, affinity)| affinity)
    }
}

/// Binary digits of a number.
fn order(number: u64) -> u32 {
    u64::BITS - number.leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_index_finds_what_a_look_at_every_line_finds(
            queues in proptest::collection::btree_map(0u32..40, (0u64..40, 0u128..12), 0..40),
            gone in proptest::collection::btree_set(0u32..40, 0..20),
        ) {
            let mut index = QueueIndex::default();
            let affinity = |number: u32| (number > 0).then_some(WorkerId(number));
            queues.iter().for_each(|(number, (head, work))| index.insert(affinity(*number), *head, *work));
            let mut left = queues.clone();
            for number in gone {
                if let Some((head, work)) = left.remove(&number) {
                    index.remove(affinity(number), head, work);
                }
            }
            let longest = left.values().map(|(head, _)| *head).max();
            prop_assert_eq!(index.longest(), longest);
            let least = longest.unwrap_or(0).div_ceil(2);
            let long = left.iter().filter(|(_, (head, _))| *head >= least);
            let most = long.map(|(number, (_, work))| (Reverse(*work), affinity(*number))).min();
            prop_assert_eq!(index.most_work(least), most.map(|(_, affinity)| affinity));
        }
    }
}
