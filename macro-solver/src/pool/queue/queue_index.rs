//! Finds, among all lines of waiting jobs, the one with most work among those whose longest job is long, without looking
//! at each of them.
//!
//! Lines are filed by the binary order of magnitude of their longest job. All lines of the highest order are long ones; of
//! the order below some are, and they are tried in the order of their work.

use protocol::transport::WorkerId;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Whose jobs a line holds.
type Home = Option<WorkerId>;

/// See the module. Every line is entered with its longest job and its work, expected force evaluations.
#[derive(Debug, Default)]
pub(in crate::pool) struct LineIndex {
    heads: BTreeSet<(u64, Home)>,
    /// By order of magnitude: most work first, the lowest home among equals, and the longest job.
    orders: BTreeMap<u32, BTreeSet<(Reverse<u128>, Home, u64)>>,
}

impl LineIndex {
    pub(in crate::pool) fn enter(&mut self, home: Home, head: u64, work: u128) {
        self.heads.insert((head, home));
        self.orders.entry(order(head)).or_default().insert((Reverse(work), home, head));
    }

    /// Takes a line out; the numbers are those it was entered with.
    pub(in crate::pool) fn leave(&mut self, home: Home, head: u64, work: u128) {
        self.heads.remove(&(head, home));
        if let Some(alike) = self.orders.get_mut(&order(head)) {
            alike.remove(&(Reverse(work), home, head));
            if alike.is_empty() {
                self.orders.remove(&order(head));
            }
        }
    }

    /// The longest job of all; `None` when there are no lines.
    pub(in crate::pool) fn longest(&self) -> Option<u64> {
        self.heads.last().map(|(head, _)| *head)
    }

    /// The line with most work among those whose longest job takes `least` or more; the lowest home among equals.
    pub(in crate::pool) fn most_work(&self, least: u64) -> Option<Home> {
        let orders = self.orders.range(order(least)..);
        let best = orders.filter_map(|(_, lines)| lines.iter().find(|(_, _, head)| *head >= least));
        best.map(|(work, home, _)| (*work, *home)).min().map(|(_, home)| home)
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
            lines in proptest::collection::btree_map(0u32..40, (0u64..40, 0u128..12), 0..40),
            gone in proptest::collection::btree_set(0u32..40, 0..20),
        ) {
            let mut index = LineIndex::default();
            let home = |number: u32| (number > 0).then_some(WorkerId(number));
            lines.iter().for_each(|(number, (head, work))| index.enter(home(*number), *head, *work));
            let mut left = lines.clone();
            for number in gone {
                if let Some((head, work)) = left.remove(&number) {
                    index.leave(home(number), head, work);
                }
            }
            let longest = left.values().map(|(head, _)| *head).max();
            prop_assert_eq!(index.longest(), longest);
            let least = longest.unwrap_or(0).div_ceil(2);
            let long = left.iter().filter(|(_, (head, _))| *head >= least);
            let most = long.map(|(number, (_, work))| (Reverse(*work), home(*number))).min();
            prop_assert_eq!(index.most_work(least), most.map(|(_, home)| home));
        }
    }
}
