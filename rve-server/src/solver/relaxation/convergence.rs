//! Whether a relaxation gets nearer to rest, and what is done when it does not.
//!
//! Decided from the cell's own numbers alone, so the same trial takes the same steps in any batch and in any worker.

use super::criterion::Imbalance;
use super::damping::CHANGES;

/// The imbalance has to fall to this share of its least value to count as progress.
const WORTHWHILE: f64 = 0.9;

/// The load has to fall to this share of its least value: grains that flow are out of balance all the while, and yield.
const WORTHWHILE_LOAD: f64 = 0.97;

/// Steps without progress before each change of damping, and at last before the trial ends as it is. Usual cells stagnate for
/// some 200 steps at most, cells that flow for lack of friction for some 2000.
const MAX_STALLED_STEPS: [u32; CHANGES as usize + 1] = [500, 1000, 1000, 2000];

/// Cells of more grains than this across have slower modes; their limits grow in proportion.
const GRAINS_ACROSS: f64 = 20.0;

/// Advice for the next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Advice {
    /// Go on.
    GoOn,
    /// Go on with another damping or a smaller step.
    Change,
    /// End: no damping gets nearer to rest.
    End,
}

/// The best that a hold has reached, and when.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConvergenceMonitor {
    least_measure: f64,
    least_ratio: f64,
    least_load: f64,
    /// Step of the last progress or change.
    since: u32,
    changes: usize,
    /// Factor on [`MAX_STALLED_STEPS`].
    slowness: f64,
}

impl ConvergenceMonitor {
    /// For a cell of `grains` grains in two or three dimensions.
    pub(crate) fn new(grains: usize, dimension: usize) -> Self {
        let across = if dimension == 2 { (grains as f64).sqrt() } else { (grains as f64).cbrt() };
        Self {
            least_measure: f64::INFINITY,
            least_ratio: f64::INFINITY,
            least_load: f64::INFINITY,
            since: 0,
            changes: 0,
            slowness: (across / GRAINS_ACROSS).max(1.0),
        }
    }

    /// Takes note of an evaluation, `step` steps after the ramp, in which the normal forces add up to `load`, N.
    pub(crate) fn note(&mut self, step: u32, imbalance: &Imbalance, load: f64) -> Advice {
        let is_nearer = imbalance.measure < WORTHWHILE * self.least_measure
            || imbalance.ratio < WORTHWHILE * self.least_ratio
            || load < WORTHWHILE_LOAD * self.least_load;
        if is_nearer {
            self.least_measure = self.least_measure.min(imbalance.measure);
            self.least_ratio = self.least_ratio.min(imbalance.ratio);
            self.least_load = self.least_load.min(load);
            self.since = step;
            return Advice::GoOn;
        }
        if f64::from(step - self.since) < self.slowness * f64::from(MAX_STALLED_STEPS[self.changes]) {
            return Advice::GoOn;
        }
        if self.changes + 1 == MAX_STALLED_STEPS.len() {
            return Advice::End;
        }
        self.changes += 1;
        self.since = step;
        Advice::Change
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(measure: f64) -> Imbalance {
        Imbalance { measure, of_present: measure, ratio: measure }
    }

    /// Steps at which the advice is not to go on, while `measure` and `load` are functions of the step.
    fn verdicts(grains: usize, measure: impl Fn(u32) -> f64, load: impl Fn(u32) -> f64) -> Vec<(u32, Advice)> {
        let mut monitor = ConvergenceMonitor::new(grains, 2);
        let mut found = Vec::new();
        for step in 0..10_000 {
            let advice = monitor.note(step, &of(measure(step)), load(step));
            if advice != Advice::GoOn {
                found.push((step, advice));
            }
            if advice == Advice::End {
                break;
            }
        }
        found
    }

    #[test]
    fn a_limit_cycle_is_noticed_changed_three_times_and_ended() {
        let cycle = |step: u32| 0.1 + 0.05 * f64::from(step % 7);
        let change = |step| (step, Advice::Change);
        let expected = [change(500), change(1500), change(2500), (4500, Advice::End)];
        assert_eq!(verdicts(400, cycle, |_| 1.0), expected);
        // Twice as many grains across, twice the time.
        assert_eq!(verdicts(1600, cycle, |_| 1.0)[0], (1000, Advice::Change));
    }

    #[test]
    fn slow_decay_and_flow_are_convergence() {
        assert_eq!(verdicts(400, |step| (-f64::from(step) / 4000.0).exp(), |_| 1.0), []);
        assert_eq!(verdicts(400, |_| 0.3, |step| (-f64::from(step) / 15_000.0).exp()), []);
    }
}
