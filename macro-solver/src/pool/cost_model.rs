//! Expected cost of a trial: orders the queue and distinguishes a long job from a hung worker.
//!
//! Expectations are made of deterministic counts, never of times, so the order of the queue is reproducible; only the
//! allowance of a hung worker turns them into time.

use crate::material::PointTrial;
use protocol::Cost;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Strain per explicit step that a trial without a fixed ramp is assumed to be applied with; only the ratio between
/// points matters.
const ASSUMED_STRAIN_PER_STEP: f64 = 1e-6;

/// What the last trial of a point cost, per unit of effort.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct CostModel {
    evaluations_per_effort: f64,
}

impl Default for CostModel {
    fn default() -> Self {
        Self { evaluations_per_effort: 1.0 }
    }
}

impl CostModel {
    /// Expected force evaluations of `trial`.
    pub(super) fn expect(&self, trial: &PointTrial) -> u64 {
        // A saturating cast: NaN targets count as nothing and infinite ones as the longest of all.
        (self.evaluations_per_effort * effort(trial)).round() as u64
    }

    /// Learns from what `trial` did cost.
    pub(super) fn learn(&mut self, trial: &PointTrial, cost: &Cost) {
        let effort = effort(trial);
        if effort > 0.0 && effort.is_finite() && cost.force_evaluations > 0 {
            self.evaluations_per_effort = cost.force_evaluations as f64 / effort;
        }
    }
}

/// Ramp increments that the trial will take, about.
fn effort(trial: &PointTrial) -> f64 {
    if trial.options.ramp_steps > 0 {
        return f64::from(trial.options.ramp_steps);
    }
    let norm = trial.target.0.iter().map(|component| component * component).sum::<f64>().sqrt();
    norm / ASSUMED_STRAIN_PER_STEP
}

/// Time per force evaluation of one definition: the slowest seen, for the hang allowance only.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Throughput {
    nanoseconds_per_evaluation: Option<f64>,
    has_answered: bool,
}

impl Throughput {
    /// Learns from a finished job.
    pub(super) fn learn(&mut self, cost: &Cost) {
        self.has_answered = true;
        if cost.force_evaluations == 0 {
            return;
        }
        let nanoseconds = (cost.solve_nanoseconds + cost.tangent_nanoseconds) as f64;
        let seen = nanoseconds / cost.force_evaluations as f64;
        self.nanoseconds_per_evaluation = Some(self.nanoseconds_per_evaluation.unwrap_or(0.0).max(seen));
    }

    /// Whether a job of the definition has been answered, by an engine that counts its force evaluations or one that does not.
    pub(super) fn has_answered(&self) -> bool {
        self.has_answered
    }

    /// Expected duration of this many force evaluations; `None` before the first job, and of engines that count none.
    pub(super) fn duration(&self, evaluations: u64) -> Option<Duration> {
        let nanoseconds = self.nanoseconds_per_evaluation? * evaluations as f64;
        Some(Duration::from_secs_f64((nanoseconds * 1e-9).min(86_400.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{Tensor2, TrialOptions};

    fn trial(strain: f64, ramp_steps: u32) -> PointTrial {
        let target = Tensor2::from_plane([[0.0, 0.0], [0.0, strain]]);
        PointTrial { point: 0, target, options: TrialOptions { ramp_steps, ..TrialOptions::default() } }
    }

    #[test]
    fn cost_per_strain_is_learnt_and_scaled() {
        let mut cost_model = CostModel::default();
        assert_eq!(cost_model.expect(&trial(-1e-3, 0)), 1000);
        let cost = Cost { force_evaluations: 3000, ..Cost::default() };
        cost_model.learn(&trial(-1e-3, 0), &cost);
        assert_eq!(cost_model.expect(&trial(-2e-3, 0)), 6000);
        cost_model.learn(&trial(-1e-3, 100), &cost);
        assert_eq!(cost_model.expect(&trial(-5e-3, 50)), 1500);
    }

    #[test]
    fn bad_targets_do_not_spoil_the_forecast() {
        let mut cost_model = CostModel::default();
        cost_model.learn(&trial(f64::NAN, 0), &Cost { force_evaluations: 5, ..Cost::default() });
        assert_eq!(cost_model, CostModel::default());
        assert_eq!(cost_model.expect(&trial(f64::NAN, 0)), 0);
        assert_eq!(cost_model.expect(&trial(f64::INFINITY, 0)), u64::MAX);
    }

    #[test]
    fn pace_is_the_slowest_seen() {
        let mut throughput = Throughput::default();
        assert_eq!(throughput.duration(10), None);
        throughput.learn(&Cost::default());
        assert!(throughput.has_answered() && throughput.duration(1).is_none());
        throughput.learn(&Cost { force_evaluations: 10, solve_nanoseconds: 1_000, ..Cost::default() });
        throughput.learn(&Cost { force_evaluations: 10, solve_nanoseconds: 500, ..Cost::default() });
        assert_eq!(throughput.duration(1_000_000), Some(Duration::from_micros(100_000)));
    }
}
