//! Periodic sides and how they strain: images move as [Lees and Edwards 1972] have them.
//!
//! Grains are never moved back into the cell; the identity of a pair holds the image that its end grain is seen in. A period that
//! leans by more than half of another one is replaced by the nearest upright one that makes the same images, and the identities
//! of the pairs are written anew ([`Folding`]). No contact notices.

use super::super::SpecimenSpace;
use crate::space::{Components, Space, Tensor, product, transpose};

/// Share of a period from which on another one that leans by it is folded.
const MOST_LEANING: f64 = 0.5;

/// Translations to the next images, m, with their rates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Periods<S: SpecimenSpace> {
    /// The periods as the motion has carried them along, m.
    pub(super) carried: [Option<S::Vector>; 3],
    /// Their rates, m/s.
    pub(super) rates: [S::Vector; 3],
    /// Period `k` in use is the carried one plus `folds[k][a]` times the carried one of `a`.
    pub(super) folds: [[i32; 3]; 3],
}

/// Period `axis` has become itself less `times` period `by`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Folding {
    axis: usize,
    by: usize,
    times: i32,
}

impl Folding {
    /// The number of images, in the new periods, of what was `shift` in the old ones.
    pub(crate) fn shift<S: Space>(self, shift: S::Shift) -> S::Shift {
        S::shift(|axis| shift[axis] + if axis == self.by { self.times * shift[self.axis] } else { 0 })
    }
}

impl<S: SpecimenSpace> Periods<S> {
    /// Sides at rest.
    pub(crate) fn at_rest(periods: [Option<S::Vector>; 3]) -> Self {
        Self { carried: periods, rates: [S::Vector::ZERO; 3], folds: [[0; 3]; 3] }
    }

    /// Whether some side moves.
    pub(crate) fn are_moving(&self) -> bool {
        self.rates.iter().any(|rate| *rate != S::Vector::ZERO)
    }

    /// The period of an axis as it is used, m.
    pub(crate) fn in_use(&self, axis: usize) -> Option<S::Vector> {
        self.carried[axis].map(|period| self.folded(axis, period, |other| self.carried[other]))
    }

    /// Rate of the period of an axis as it is used, m/s.
    pub(crate) fn rate(&self, axis: usize) -> S::Vector {
        self.folded(axis, self.rates[axis], |other| self.carried[other].map(|_| self.rates[other]))
    }

    fn folded(&self, axis: usize, own: S::Vector, other: impl Fn(usize) -> Option<S::Vector>) -> S::Vector {
        (0..axis).filter(|by| self.folds[axis][*by] != 0).fold(own, |sum, by| {
            sum.plus(other(by).unwrap_or(S::Vector::ZERO).times(f64::from(self.folds[axis][by])))
        })
    }

    /// Moves the sides for `step` seconds.
    pub(crate) fn advance(&mut self, step: f64) {
        for (period, rate) in self.carried.iter_mut().zip(&self.rates) {
            *period = period.map(|period| period.plus(rate.times(step)));
        }
    }

    /// Folds what leans too much. The foldings have to be applied to the pairs in this order.
    pub(crate) fn fold(&mut self) -> Vec<Folding> {
        let mut foldings = Vec::new();
        for axis in 1..S::DIMENSION {
            for by in (0..axis).rev() {
                let (Some(leaning), Some(other)) = (self.in_use(axis), self.in_use(by)) else { continue };
                let share = leaning[by] / other[by];
                if share.abs() <= MOST_LEANING {
                    continue;
                }
                let times = share.round() as i32;
                for below in 0..by {
                    self.folds[axis][below] -= times * self.folds[by][below];
                }
                self.folds[axis][by] -= times;
                foldings.push(Folding { axis, by, times });
            }
        }
        foldings
    }

    /// Velocity gradient of the homogeneous flow that belongs to the moving sides, 1/s; walled axes have no part in it.
    pub(crate) fn gradient(&self) -> S::Tensor {
        gradient::<S>(&self.carried, &self.rates)
    }

    /// Displacement gradient of the homogeneous strain that has brought the sides here from `before`.
    pub(crate) fn strain_since(&self, before: &[Option<S::Vector>; 3]) -> S::Tensor {
        let change = std::array::from_fn(|axis| match (self.carried[axis], before[axis]) {
            (Some(now), Some(before)) => now.minus(before),
            _ => S::Vector::ZERO,
        });
        gradient::<S>(before, &change)
    }
}

/// The tensor that takes every period to its change, and the normals of walls to nothing.
fn gradient<S: Space>(periods: &[Option<S::Vector>; 3], changes: &[S::Vector; 3]) -> S::Tensor {
    let rows = S::Tensor::from_fn(|i, j| match periods[i] {
        Some(period) => period[j],
        None => f64::from(u8::from(i == j)),
    });
    let changes = S::Tensor::from_fn(|i, j| changes[i][j]);
    transpose(&product(&rows.inverse(), &changes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::Cell;
    use crate::space::{Discs, Spheres};

    #[test]
    fn a_period_that_leans_too_much_is_folded_and_makes_the_same_images() {
        let mut periods = Periods::<Discs>::at_rest([Some([2.0, 0.0]), Some([0.3, 3.0]), None]);
        periods.rates = [[0.0; 2], [1.0, 0.0], [0.0; 2]];
        assert_eq!(periods.fold(), []);
        periods.advance(4.0);
        let before = Cell::<Discs> { rows: [periods.in_use(0).unwrap(), periods.in_use(1).unwrap()] };
        let foldings = periods.fold();
        assert_eq!(foldings, [Folding { axis: 1, by: 0, times: 2 }]);
        let after = Cell::<Discs> { rows: [periods.in_use(0).unwrap(), periods.in_use(1).unwrap()] };
        assert!((after.rows[1][0] - 0.3).abs() < 1e-12, "{after:?}");
        for shift in [[0, 1], [3, -2], [-1, 0]] {
            let renamed = foldings[0].shift::<Discs>(shift);
            let (old, new) = (before.translation(shift), after.translation(renamed));
            assert!((old[0] - new[0]).abs() < 1e-12 && (old[1] - new[1]).abs() < 1e-12);
        }
        assert_eq!(periods.rate(1), [1.0, 0.0]);
    }

    #[test]
    fn the_gradient_takes_every_period_to_its_rate_in_space_too() {
        let mut periods =
            Periods::<Spheres>::at_rest([Some([2.0, 0.0, 0.0]), Some([0.3, 3.0, 0.0]), Some([0.9, 2.4, 4.0])]);
        periods.rates = [[0.1, 0.0, 0.0], [0.2, -0.3, 0.0], [0.4, 0.5, 0.6]];
        let foldings = periods.fold();
        assert_eq!(foldings.len(), 1, "{foldings:?}");
        let gradient = periods.gradient();
        for axis in 0..3 {
            let moved = crate::space::apply(&gradient, periods.in_use(axis).unwrap());
            assert!(moved.minus(periods.rate(axis)).norm() < 1e-15);
        }
    }
}
