//! The pair list of one cell: how it ages, and how sorted lists are joined.

use crate::cell::{Cell, PairKey};
use crate::space::{Space, Tensor, add_scaled, inverse, norm, product, transpose};
use std::cmp::Ordering;

/// Pairs that may touch, and the motion since they were listed.
#[derive(Clone, Debug, Default)]
pub(crate) struct NeighbourList<S: Space> {
    /// Sorted.
    pub(crate) keys: Vec<PairKey<S>>,
    listed_cell: S::Tensor,
    largest_motion: f64,
    stretch: f64,
}

impl<S: Space> NeighbourList<S> {
    /// Pairs listed for another cell, after grains have moved by up to `largest_motion`, m, against an affine motion that differs from
    /// none by a tensor of the norm `stretch`.
    pub(crate) fn aged(listed_cell: &Cell<S>, keys: Vec<PairKey<S>>, largest_motion: f64, stretch: f64) -> Self {
        Self { keys, listed_cell: listed_cell.rows, largest_motion, stretch }
    }

    /// Notes that the pairs have just been listed.
    pub(crate) fn begin(&mut self, cell: &Cell<S>) {
        self.listed_cell = cell.rows;
        self.largest_motion = 0.0;
        self.stretch = 0.0;
    }

    /// Notes that no grain has moved by more than `distance` against the affine motion.
    pub(crate) fn add_motion(&mut self, distance: f64) {
        self.largest_motion += distance;
    }

    /// Notes the cell as it is now.
    pub(crate) fn stretch_to(&mut self, cell: &Cell<S>) {
        let since = product(&transpose(&cell.rows), &inverse(&transpose(&self.listed_cell)));
        self.stretch = norm(&add_scaled(&since, -1.0, &S::Tensor::IDENTITY));
    }

    /// Whether no unlisted pair can touch by now. It was at least the skin away from touching; its branch vector has
    /// since been stretched by the cell's deformation and by both grains' own motion.
    pub(crate) fn is_complete(&self, range: f64, skin: f64) -> bool {
        2.0 * self.largest_motion * (1.0 + 2.0 * self.stretch) + self.stretch * range < skin
    }
}

/// Whether a sorted list holds nothing that another sorted list lacks.
pub(crate) fn is_subset<T: Ord>(part: &[T], whole: &[T]) -> bool {
    let mut rest = whole.iter();
    part.iter().all(|wanted| rest.find(|found| *found >= wanted) == Some(wanted))
}

/// Both sorted lists in one, without repetition.
pub(crate) fn merged<T: Ord + Copy>(first: &[T], second: &[T]) -> Vec<T> {
    let mut union = Vec::with_capacity(first.len() + second.len() / 8);
    let (mut a, mut b) = (first.iter().peekable(), second.iter().peekable());
    loop {
        let order = match (a.peek(), b.peek()) {
            (Some(x), Some(y)) => x.cmp(y),
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (None, None) => return union,
        };
        let next = match order {
            Ordering::Less => a.next(),
            Ordering::Greater => b.next(),
            Ordering::Equal => {
                a.next();
                b.next()
            }
        };
        union.extend(next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn sorted_lists_are_joined_and_compared_as_sets(
            first in proptest::collection::btree_set(0..40u32, 0..20), second in proptest::collection::btree_set(0..40u32, 0..20),
        ) {
            let list = |set: &BTreeSet<u32>| set.iter().copied().collect::<Vec<_>>();
            prop_assert_eq!(merged(&list(&first), &list(&second)), list(&first.union(&second).copied().collect()));
            prop_assert_eq!(is_subset(&list(&first), &list(&second)), first.is_subset(&second));
        }
    }
}
