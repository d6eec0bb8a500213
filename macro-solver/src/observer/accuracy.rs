//! Accuracy of the stresses as a run reports it.

use crate::material::error_estimate::ErrorEstimate;
use serde::{Deserialize, Serialize};

/// Accuracy of an accepted step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepAccuracy {
    /// Strain per ramp step that the step was solved with; 0 for materials without a ramp.
    pub strain_per_step: f64,
    /// Estimated error of the committed stresses; `None` if nothing estimates it, or not yet.
    pub estimate: Option<ErrorEstimate>,
}

/// Accuracy over all accepted steps of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AccuracyFigures {
    /// Accepted steps with an estimate.
    pub estimated_steps: u64,
    /// The last of them.
    pub last: ErrorEstimate,
    /// Largest root mean square of a step.
    pub largest_rms: f64,
    /// Sum of the squares of all steps' root mean squares.
    squares: f64,
    /// Steps whose estimated error is above `rve.error`.
    pub missed_steps: u64,
    /// Smallest and largest strain per ramp step.
    pub strain_per_step: [f64; 2],
}

impl AccuracyFigures {
    /// Takes note of an accepted step; `wanted` is the error that the run keeps to.
    pub(crate) fn add(&mut self, step: &StepAccuracy, wanted: Option<f64>) {
        let [smallest, largest] = &mut self.strain_per_step;
        *smallest = if *largest == 0.0 { step.strain_per_step } else { smallest.min(step.strain_per_step) };
        *largest = largest.max(step.strain_per_step);
        let Some(estimate) = step.estimate.filter(|estimate| estimate.points > 0) else { return };
        self.estimated_steps += 1;
        self.last = estimate;
        self.largest_rms = self.largest_rms.max(estimate.rms);
        self.squares += estimate.rms * estimate.rms;
        self.missed_steps += u64::from(wanted.is_some_and(|wanted| estimate.rms > wanted));
    }

    /// Root mean square over the steps.
    pub fn rms(&self) -> f64 {
        (self.squares / self.estimated_steps.max(1) as f64).sqrt()
    }
}
