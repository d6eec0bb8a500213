//! Accuracy of the stresses as a run reports it.

use crate::material::error_estimate::ErrorEstimate;
use serde::{Deserialize, Serialize};

/// Estimated error over the pressure above which a step is counted where none was asked for.
const LARGE_ERROR: f64 = 0.05;

/// Change of the stresses that the next correction of Newton's method would bring by the tangents at hand: what an accepted step
/// leaves of an error because forces balance within a tolerance only. Relative to the largest mean pressure of the body so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BalanceError {
    /// Root mean square over the Gauss points (Frobenius norm).
    pub rms: f64,
    /// Norm of the mean over the points.
    pub of_mean: f64,
}

/// Accuracy of an accepted step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepAccuracy {
    /// Strain per ramp step that the step was solved with; 0 for materials without a ramp.
    pub strain_per_step: f64,
    /// Error of the committed stresses by the strain per ramp step; `None` if nothing estimates it, or not yet.
    pub estimate: Option<ErrorEstimate>,
    /// Error by the balance of forces; `None` for procedures that know no correction.
    pub balance: Option<BalanceError>,
}

impl StepAccuracy {
    /// The estimate with the error by the balance of forces, the two taken as independent.
    pub fn combined(&self) -> Option<ErrorEstimate> {
        let balance = self.balance.unwrap_or_default();
        self.estimate.map(|estimate| ErrorEstimate {
            rms: estimate.rms.hypot(balance.rms),
            of_mean: estimate.of_mean.hypot(balance.of_mean),
            ..estimate
        })
    }
}

/// Accuracy over all accepted steps of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AccuracyFigures {
    /// Accepted steps with an estimate.
    pub estimated_steps: u64,
    /// The estimate of the last of them.
    pub last: ErrorEstimate,
    /// Accepted steps since then: no followed cell bears load in them, or none is followed any more.
    pub steps_since: u64,
    /// Largest root mean square of a step.
    pub largest_rms: f64,
    /// Sum of the squares of all steps' root mean squares.
    squares: f64,
    /// Steps whose estimated error is above `rve.error` or, in runs that keep to none, above 5 %.
    pub missed_steps: u64,
    /// Smallest and largest strain per ramp step.
    pub strain_per_step: [f64; 2],
    /// Error by the balance of forces in the last step that knows it.
    pub balance: Option<BalanceError>,
    /// Largest errors by the balance of forces of any step.
    pub largest_balance: BalanceError,
}

impl AccuracyFigures {
    /// Takes note of an accepted step; `wanted` is the error that the run keeps to.
    pub(crate) fn add(&mut self, step: &StepAccuracy, wanted: Option<f64>) {
        let [smallest, largest] = &mut self.strain_per_step;
        *smallest = if *largest == 0.0 { step.strain_per_step } else { smallest.min(step.strain_per_step) };
        *largest = largest.max(step.strain_per_step);
        if let Some(balance) = step.balance {
            self.balance = Some(balance);
            self.largest_balance.rms = self.largest_balance.rms.max(balance.rms);
            self.largest_balance.of_mean = self.largest_balance.of_mean.max(balance.of_mean);
        }
        let Some(estimate) = step.estimate.filter(|estimate| estimate.points > 0) else {
            self.steps_since += u64::from(self.estimated_steps > 0);
            return;
        };
        self.estimated_steps += 1;
        self.steps_since = 0;
        self.last = estimate;
        self.largest_rms = self.largest_rms.max(estimate.rms);
        self.squares += estimate.rms * estimate.rms;
        self.missed_steps += u64::from(estimate.rms > wanted.unwrap_or(LARGE_ERROR));
    }

    /// Root mean square over the steps.
    pub fn rms(&self) -> f64 {
        (self.squares / self.estimated_steps.max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_errors_of_a_step_add_as_independent_ones_do() {
        let estimate = ErrorEstimate { points: 4, rms: 3e-3, largest: 5e-3, of_mean: 0.0 };
        let balance = BalanceError { rms: 4e-3, of_mean: 1e-3 };
        let step = StepAccuracy { strain_per_step: 1e-5, estimate: Some(estimate), balance: Some(balance) };
        let combined = step.combined().unwrap();
        assert!((combined.rms - 5e-3).abs() < 1e-15 && (combined.of_mean - 1e-3).abs() < 1e-15);
        assert_eq!(StepAccuracy { balance: None, ..step }.combined(), Some(estimate));
        assert_eq!(StepAccuracy { estimate: None, ..step }.combined(), None, "half an estimate is none");
    }

    #[test]
    fn steps_behind_the_last_estimate_are_counted() {
        let known = StepAccuracy {
            estimate: Some(ErrorEstimate { points: 1, rms: 2e-3, ..ErrorEstimate::default() }),
            ..StepAccuracy::default()
        };
        let mut figures = AccuracyFigures::default();
        let mut since = |step: &StepAccuracy| {
            figures.add(step, None);
            (figures.steps_since, figures.last.rms)
        };
        let nothing = StepAccuracy::default();
        assert_eq!(since(&nothing).0, 0, "nothing is known yet");
        assert_eq!(
            [since(&known), since(&nothing), since(&nothing), since(&known)],
            [0, 1, 2, 0].map(|steps| (steps, 2e-3))
        );
    }

    #[test]
    fn large_errors_count_with_and_without_a_wanted_one() {
        let of = |rms| StepAccuracy {
            estimate: Some(ErrorEstimate { points: 1, rms, ..ErrorEstimate::default() }),
            ..StepAccuracy::default()
        };
        let missed = |wanted| {
            let mut figures = AccuracyFigures::default();
            [2e-3, 8e-3, 0.2].into_iter().for_each(|rms| figures.add(&of(rms), wanted));
            figures.missed_steps
        };
        assert_eq!([missed(Some(5e-3)), missed(Some(0.1)), missed(None)], [2, 1, 1]);
    }
}
