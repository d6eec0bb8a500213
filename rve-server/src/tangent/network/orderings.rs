//! Orders of elimination that have been found before.
//!
//! An [`Elimination`] is a function of the graph of touching grains alone, so that one that is kept for an equal graph is
//! the one that would be found again: nothing but time depends on what is kept.

use super::elimination::Elimination;
use std::sync::Arc;

/// Orders kept: a worker answers for many Gauss points in turn, and a point asks again until its step has converged.
const KEPT: usize = 64;

/// Recently used orders of elimination, the last one first.
#[derive(Clone, Debug, Default)]
pub struct Orderings {
    entries: Vec<Entry>,
    /// Times that an order was there already.
    found: u64,
}

#[derive(Clone, Debug)]
struct Entry {
    grains: usize,
    pairs: Vec<[usize; 2]>,
    elimination: Arc<Elimination>,
}

impl Orderings {
    /// Times that an order was there already.
    pub fn found(&self) -> u64 {
        self.found
    }

    /// The order for a graph of `grains` and touching `pairs`; `None` if the ordering fails.
    pub(super) fn of(&mut self, grains: usize, pairs: &[[usize; 2]]) -> Option<Arc<Elimination>> {
        match self.entries.iter().position(|entry| entry.grains == grains && entry.pairs == pairs) {
            Some(place) => {
                self.found += 1;
                self.entries[..=place].rotate_right(1);
            }
            None => {
                let elimination = Arc::new(Elimination::of(grains, pairs)?);
                self.entries.truncate(KEPT - 1);
                self.entries.insert(0, Entry { grains, pairs: pairs.to_vec(), elimination });
            }
        }
        Some(Arc::clone(&self.entries[0].elimination))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of grains with one chord.
    fn ring(grains: usize, chord: [usize; 2]) -> Vec<[usize; 2]> {
        let mut pairs: Vec<[usize; 2]> = (1..grains).map(|grain| [grain - 1, grain]).collect();
        pairs.extend([[0, grains - 1], chord]);
        pairs.sort_unstable();
        pairs
    }

    #[test]
    fn kept_orders_are_those_that_would_be_found_again() {
        let mut orderings = Orderings::default();
        for round in 0..3 {
            for chord in 2..2 + KEPT / 2 {
                let pairs = ring(100, [0, chord]);
                let kept = orderings.of(100, &pairs).unwrap();
                assert_eq!(*kept, Elimination::of(100, &pairs).unwrap(), "round {round}, chord {chord}");
            }
        }
        assert_eq!(orderings.found(), KEPT as u64);
        // One grain more is another graph, even with the same pairs.
        let pairs = ring(100, [0, 2]);
        assert_ne!(*orderings.of(101, &pairs).unwrap(), *orderings.of(100, &pairs).unwrap());
        for chord in 2..2 + 90 {
            orderings.of(100, &ring(100, [0, chord])).unwrap();
        }
        assert_eq!(orderings.entries.len(), KEPT);
    }
}
