//! How the work of the grain solver is spread over trials: a few slow ones may cost more than all others.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Classes per doubling of the cost: the share of the slowest trials is then known to some 10 %.
const CLASSES_PER_DOUBLING: u32 = 8;

/// Trials by their cost in force evaluations, in classes of equal ratio. Counts only, so it is the same for any number of workers.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrialCosts {
    /// Number of trials and their force evaluations by class.
    classes: BTreeMap<u32, (u64, u64)>,
    largest: u64,
}

/// The slowest trials of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SlowestTrials {
    /// How many trials these are: the share asked for, rounded up.
    pub trials: u64,
    /// All of them needed at least this number of force evaluations.
    pub from_force_evaluations: u64,
    /// Force evaluations of the slowest trial.
    pub largest_force_evaluations: u64,
    /// Their share of all force evaluations.
    pub share_of_force_evaluations: f64,
}

impl TrialCosts {
    /// Takes note of a trial.
    pub fn add(&mut self, force_evaluations: u64) {
        let (count, sum) = self.classes.entry(class(force_evaluations)).or_default();
        *count += 1;
        *sum += force_evaluations;
        self.largest = self.largest.max(force_evaluations);
    }

    /// The slowest `share` of all trials.
    pub fn slowest(&self, share: f64) -> SlowestTrials {
        let (trials, evaluations) =
            self.classes.values().fold((0, 0), |(trials, sum), (count, part)| (trials + count, sum + part));
        let wanted = (share * trials as f64 - 1e-9).ceil().max(0.0) as u64;
        let mut found = SlowestTrials { largest_force_evaluations: self.largest, ..SlowestTrials::default() };
        let mut spent = 0.0;
        for (class, (count, sum)) in self.classes.iter().rev() {
            if found.trials >= wanted {
                break;
            }
            // Of the class in which the share ends its trials count with their mean.
            let taken = (wanted - found.trials).min(*count);
            found.trials += taken;
            found.from_force_evaluations = lower_bound(*class);
            spent += *sum as f64 * (taken as f64 / *count as f64);
        }
        found.share_of_force_evaluations = spent / (evaluations.max(1)) as f64;
        found
    }
}

/// Class of a cost: its binary exponent and the bits after its leading one.
fn class(cost: u64) -> u32 {
    if cost < u64::from(CLASSES_PER_DOUBLING) {
        return cost as u32;
    }
    let bits = CLASSES_PER_DOUBLING.ilog2();
    let exponent = cost.ilog2();
    let rest = (cost >> (exponent - bits)) as u32 - CLASSES_PER_DOUBLING;
    (exponent - bits + 1) * CLASSES_PER_DOUBLING + rest
}

/// Smallest cost of a class.
fn lower_bound(class: u32) -> u64 {
    if class < CLASSES_PER_DOUBLING {
        return u64::from(class);
    }
    let (doubling, rest) = (class / CLASSES_PER_DOUBLING, class % CLASSES_PER_DOUBLING);
    u64::from(CLASSES_PER_DOUBLING + rest) << (doubling - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_ordered_and_begin_at_their_bound() {
        for cost in (0..5000).chain([u64::MAX / 3, u64::MAX]) {
            let class = class(cost);
            assert!(lower_bound(class) <= cost, "{cost}");
            assert!(class == 0 || lower_bound(class - 1) < lower_bound(class));
        }
        assert!((1..5000u64).all(|cost| class(cost - 1) <= class(cost)));
    }

    #[test]
    fn one_slow_trial_among_a_hundred_is_found_with_its_share() {
        let mut costs = TrialCosts::default();
        (0..99).for_each(|_| costs.add(100));
        costs.add(9_900);
        let slowest = costs.slowest(0.01);
        assert_eq!((slowest.trials, slowest.largest_force_evaluations), (1, 9_900));
        assert!(slowest.from_force_evaluations <= 9_900 && slowest.from_force_evaluations > 8_000);
        assert!((slowest.share_of_force_evaluations - 0.5).abs() < 1e-12);
        assert_eq!(TrialCosts::default().slowest(0.01), SlowestTrials::default());
        // Trials that all cost about the same: a hundredth of them, not their whole class.
        let mut alike = TrialCosts::default();
        (0..1000).for_each(|number| alike.add(208 + number % 5));
        let slowest = alike.slowest(0.01);
        assert_eq!(slowest.trials, 10);
        assert!((slowest.share_of_force_evaluations - 0.01).abs() < 1e-12, "{slowest:?}");
    }
}
