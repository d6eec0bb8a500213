//! Pair lists of earlier trials. Trials of one packing begin from states that differ little, so a list found for one of them is
//! often complete for the next. Which list is taken cannot reach a result.

use super::neighbour_list::NeighbourList;
use crate::cell::{Cell, PairKey};
use crate::space::{Components, Space, Tensor, add_scaled, apply, inverse, norm, product, transpose};

/// Most lists that are kept.
const MOST_LISTS: usize = 64;

/// Most pairs that are kept in all, some five megabytes with their positions.
const MOST_PAIRS: usize = 1 << 18;

/// A list is taken if this share of the skin at least is left for the motion to come.
const SHARE_LEFT: f64 = 0.5;

/// A list with the state that it was found for.
#[derive(Clone, Debug)]
struct Remembered<S: Space> {
    cell: Cell<S>,
    positions: Vec<S::Vector>,
    keys: Vec<PairKey<S>>,
}

/// Lists of earlier trials, the last one used at the end.
#[derive(Clone, Debug)]
pub(super) struct NeighbourListMemory<S: Space> {
    lists: Vec<Remembered<S>>,
}

impl<S: Space> Default for NeighbourListMemory<S> {
    fn default() -> Self {
        Self { lists: Vec::new() }
    }
}

impl<S: Space> NeighbourListMemory<S> {
    /// A list that is complete for these positions, with its age; the one used last is tried first. `range` is the largest distance of
    /// the centres of a listed pair without the `skin`, m.
    pub(super) fn recall(
        &mut self,
        cell: &Cell<S>,
        positions: impl Fn(usize) -> S::Vector,
        range: f64,
        skin: f64,
    ) -> Option<NeighbourList<S>> {
        let aged = |list: &Remembered<S>| list.aged(cell, &positions, range, skin);
        let (place, neighbour_list) = self
            .lists
            .iter()
            .enumerate()
            .rev()
            .find_map(|(place, list)| aged(list).map(|neighbour_list| (place, neighbour_list)))?;
        self.lists[place..].rotate_left(1);
        Some(neighbour_list)
    }

    /// Keeps a list that was found for these positions.
    pub(super) fn keep(&mut self, cell: &Cell<S>, positions: Vec<S::Vector>, keys: &[PairKey<S>]) {
        let most = (MOST_PAIRS / keys.len().max(1)).clamp(1, MOST_LISTS);
        let surplus = (self.lists.len() + 1).saturating_sub(most);
        self.lists.drain(..surplus);
        self.lists.push(Remembered { cell: *cell, positions, keys: keys.to_vec() });
    }
}

impl<S: Space> Remembered<S> {
    /// The list with the motion since, if enough of the skin is left.
    fn aged(
        &self,
        cell: &Cell<S>,
        positions: impl Fn(usize) -> S::Vector,
        range: f64,
        skin: f64,
    ) -> Option<NeighbourList<S>> {
        let deformation = product(&transpose(&cell.rows), &inverse(&transpose(&self.cell.rows)));
        let stretch = norm(&add_scaled(&deformation, -1.0, &S::Tensor::IDENTITY));
        let left = (1.0 - SHARE_LEFT) * skin - stretch * range;
        // Whatever is not a number leaves nothing.
        let farthest = 0.5 * left / (1.0 + 2.0 * stretch);
        if farthest.is_nan() || farthest <= 0.0 {
            return None;
        }
        let mut largest_square = 0.0_f64;
        for (grain, before) in self.positions.iter().enumerate() {
            let own = positions(grain).minus(apply(&deformation, *before));
            let square = own.dot(own);
            if square.is_nan() || square > farthest * farthest {
                return None;
            }
            largest_square = largest_square.max(square);
        }
        Some(NeighbourList::aged(&self.cell, self.keys.clone(), largest_square.sqrt(), stretch))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::PairFinder;
    use crate::space::Discs;
    use proptest::prelude::*;

    const RADII: [f64; 20] = [0.5; 20];
    const SKIN: f64 = 0.1;

    fn found(cell: &Cell, positions: &[[f64; 2]]) -> Vec<PairKey> {
        let mut keys = Vec::new();
        PairFinder::<Discs>::default().find(cell, positions.iter().copied(), &RADII, SKIN, &mut keys);
        keys
    }

    /// Every pair that touches.
    fn touching(cell: &Cell, positions: &[[f64; 2]]) -> Vec<PairKey> {
        let mut keys = Vec::new();
        PairFinder::<Discs>::default().find(cell, positions.iter().copied(), &RADII, 0.0, &mut keys);
        keys
    }

    proptest! {
        #[test]
        fn a_list_is_taken_only_where_it_holds_every_touching_pair(
            points in proptest::collection::vec(proptest::array::uniform2(0.0..4.0f64), 20),
            moves in proptest::collection::vec(proptest::array::uniform2(-0.03..0.03f64), 20),
            strain in proptest::array::uniform4(-0.03..0.03f64), scale in 0.0..1.0f64,
        ) {
            let cell = Cell::<Discs> { rows: [[4.0, 0.0], [0.3, 4.0]] };
            let mut memory = NeighbourListMemory::<Discs>::default();
            memory.keep(&cell, points.clone(), &found(&cell, &points));
            let [a, b, c, d] = strain.map(|component| scale * component);
            let f = [[1.0 + a, b], [c, 1.0 + d]];
            let later = cell.deformed(&f);
            let moved: Vec<[f64; 2]> = points
                .iter()
                .zip(&moves)
                .map(|(point, own)| apply(&f, *point).plus(own.times(scale)))
                .collect();
            match memory.recall(&later, |grain| moved[grain], 1.0, SKIN) {
                Some(neighbour_list) => {
                    prop_assert!(neighbour_list.is_complete(1.0, SKIN));
                    prop_assert!(touching(&later, &moved).iter().all(|key| neighbour_list.keys.contains(key)));
                }
                // Nothing has moved by more than this.
                None => prop_assert!(scale > 0.2),
            }
        }
    }

    #[test]
    fn the_list_used_last_is_kept_longest_and_far_states_find_none() {
        let cell = Cell::<Discs> { rows: [[40.0, 0.0], [0.0, 40.0]] };
        let places = |shift: f64| (0..20).map(|grain| [f64::from(grain) + shift, shift]).collect::<Vec<_>>();
        let mut memory = NeighbourListMemory::<Discs>::default();
        for number in 0..MOST_LISTS {
            memory.keep(&cell, places(number as f64), &found(&cell, &places(number as f64)));
        }
        let mut recalls = |shift: f64| memory.recall(&cell, |grain| places(shift)[grain], 1.0, SKIN).is_some();
        assert!(recalls(0.01) && !recalls(0.4));
        for number in 0..MOST_LISTS - 1 {
            let shift = 100.0 + number as f64;
            memory.keep(&cell, places(shift), &found(&cell, &places(shift)));
        }
        assert!(memory.recall(&cell, |grain| places(0.0)[grain], 1.0, SKIN).is_some());
        assert_eq!(memory.lists.len(), MOST_LISTS);
    }
}
