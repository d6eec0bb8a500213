//! Moving periodic sides of a body: images, their power, and a list of pairs that stays complete in a flow.

use super::super::SpecimenSpace;
use super::super::contact::Slot;
use super::Body;
use crate::cell::PairKey;
use crate::contact::ContactLaw;
use crate::simd::Tuple;
use crate::space::{Components, apply, norm};

impl<S: SpecimenSpace, C: ContactLaw<S>> Body<S, C> {
    /// Period of an axis as the motion has carried it along, m.
    pub(crate) fn period(&self, axis: usize) -> Option<S::Vector> {
        self.periods.carried[axis]
    }

    /// Rates of the periodic sides, m/s per axis.
    pub(crate) fn side_rates(&self) -> [S::Vector; 3] {
        self.periods.rates
    }

    /// Velocity gradient of the homogeneous flow that belongs to the sides, 1/s; nothing while they stand still.
    pub(crate) fn flow_gradient(&self) -> Option<S::Tensor> {
        self.periods.are_moving().then(|| self.periods.gradient())
    }

    /// Whether some unlisted pair may touch where the sides have moved since the list was made: a homogeneous strain moves a
    /// pair by as much as it stretches its branch, and what is left is each grain's own way.
    pub(super) fn has_left_the_flow(&self) -> bool {
        let strain = self.periods.strain_since(&self.listed_periods);
        let limit = 0.5 * (self.skin - norm(&strain) * self.reach());
        let square = limit * limit;
        let centre = mean_place::<S>(self.listed_at.iter().copied());
        limit <= 0.0
            || self.grains.iter().zip(&self.listed_at).any(|(grain, listed)| {
                let lead = listed.minus(centre);
                let carried = apply(&strain, S::Vector::from_fn(|axis| lead.as_ref()[axis]));
                let own = grain.position.minus(*listed).minus(<S::Coordinates<f64>>::build(|axis| carried[axis]));
                own.dot(own) >= square || own.dot(own).is_nan()
            })
    }

    /// Longest branch of a listed pair, m.
    fn reach(&self) -> f64 {
        2.0 * self.grains.iter().fold(0.0, |largest: f64, grain| largest.max(grain.radius)) + self.skin
    }

    /// Gives the periodic sides these rates, m/s per axis.
    pub(crate) fn strain_sides(&mut self, rates: [S::Vector; 3]) {
        self.periods.rates = rates;
        self.place_images();
        self.side_forces = self.sum_of_side_forces();
    }

    /// Moves the periodic sides for `step` seconds.
    pub(crate) fn move_sides(&mut self, step: f64) {
        if self.periods.are_moving() {
            self.periods.advance(step);
            self.place_images();
        }
    }

    /// Power that the moving sides put into the grains, W.
    pub(crate) fn side_power(&self) -> f64 {
        (0..S::DIMENSION).map(|axis| Components::dot(self.side_forces[axis], self.periods.rate(axis))).sum()
    }

    pub(super) fn sum_of_side_forces(&self) -> [S::Vector; 3] {
        let mut sums = [S::Vector::ZERO; 3];
        if !self.periods.are_moving() {
            return sums;
        }
        for index in self.touching() {
            let (shift, force) = (self.keys[index].shift, self.pair_loads[index].force);
            for (axis, sum) in sums.iter_mut().enumerate().take(S::DIMENSION) {
                if shift[axis] != 0 {
                    let times = f64::from(shift[axis]);
                    *sum = Components::plus(*sum, S::Vector::from_fn(|i| times * force.as_ref()[i]));
                }
            }
        }
        sums
    }

    /// Translations and velocities of all images from the sides as they are.
    pub(super) fn place_images(&mut self) {
        let sum = |shift: &S::Shift, part: &dyn Fn(usize) -> S::Vector| {
            let whole = (0..S::DIMENSION)
                .filter(|axis| shift[*axis] != 0)
                .fold(S::Vector::ZERO, |sum, axis| Components::plus(sum, part(axis).times(f64::from(shift[axis]))));
            <S::Coordinates<f64>>::build(|axis| whole[axis])
        };
        let periods = &self.periods;
        let in_use: [S::Vector; 3] = std::array::from_fn(|axis| periods.in_use(axis).unwrap_or(S::Vector::ZERO));
        let rates: [S::Vector; 3] = std::array::from_fn(|axis| periods.rate(axis));
        self.images.clear();
        self.images.extend(self.shifts.iter().map(|shift| sum(shift, &|axis| in_use[axis])));
        self.image_velocities.clear();
        if periods.are_moving() {
            self.image_velocities.extend(self.shifts.iter().map(|shift| sum(shift, &|axis| rates[axis])));
        }
    }

    /// Folds periods that lean too much and names the listed pairs anew.
    pub(super) fn fold_periods(&mut self) {
        let foldings = if self.periods.are_moving() { self.periods.fold() } else { Vec::new() };
        if foldings.is_empty() {
            return;
        }
        let law = self.law;
        let mut renamed: Vec<(PairKey<S>, Slot<S, C>)> = (self.keys.iter().zip(&self.slots))
            .map(|(key, slot)| {
                let shift = foldings.iter().fold(key.shift, |shift, folding| folding.shift::<S>(shift));
                let renamed = PairKey::canonical(key.origin, key.end, shift);
                (renamed, if renamed.shift == shift { *slot } else { slot.seen_from_end(&law) })
            })
            .collect();
        renamed.sort_unstable_by_key(|(key, _)| *key);
        (self.keys, self.slots) = renamed.into_iter().unzip();
    }
}

/// Mean of these places.
pub(crate) fn mean_place<S: SpecimenSpace>(
    places: impl ExactSizeIterator<Item = S::Coordinates<f64>>,
) -> S::Coordinates<f64> {
    let count = places.len().max(1) as f64;
    places.fold(<S::Coordinates<f64>>::zero(), |sum, place| sum.plus(place)).scaled(1.0 / count)
}
