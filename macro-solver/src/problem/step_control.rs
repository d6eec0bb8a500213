//! How a stage goes along its path: number and size of its steps, the table `[loading]`.

use super::path_control::PathControl;
use super::stabilisation::{Stabilisation, StabilisationKeys, stabilisation_keys};
use super::stage::Stage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How long a stage is and how it goes along its path: the table `[loading]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LoadingSettings {
    /// Length of the stage: the time of histories, and real time in a dynamic stage. In quasi-static stages it counts for tables, sines,
    /// velocities and accelerations, and for the column `time`.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub duration: f64,
    /// Load steps.
    #[serde(flatten)]
    pub control: StepControl,
}

impl LoadingSettings {
    /// Those of a stage.
    pub fn of(stage: &Stage) -> Self {
        Self { duration: stage.duration, control: stage.control.clone() }
    }
}

impl Default for LoadingSettings {
    fn default() -> Self {
        Self { duration: 1.0, control: StepControl::default() }
    }
}

/// How a stage goes along its path, by default the load factor from 0 to 1: keys of `[loading]`. All sizes are shares of the stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct StepControl {
    /// Number of equal steps if nothing is cut back. No step is larger.
    #[schemars(range(min = 1), extend("x-procedures" = "implicit relaxation"))]
    pub increments: usize,
    /// Smallest step, as a share of the stage. A step that fails at this size is stabilised; if that fails too, or is switched off,
    /// the run ends with exit code 1.
    #[serde(rename = "smallest_increment")]
    #[schemars(
        extend(
            "x-unit" = "-", "exclusiveMinimum" = 0, "x-most-inverse-of" = "increments", "x-procedures" = "implicit relaxation"
        ),
        range(max = 1.0)
    )]
    pub min: f64,
    /// Factor on the step size after an easy step.
    #[schemars(extend("x-unit" = "-", "x-procedures" = "implicit relaxation"), range(min = 1.0))]
    pub growth: f64,
    /// Factor on the step size after a failed step.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "exclusiveMaximum" = 1, "x-procedures" = "implicit relaxation"))]
    pub cut: f64,
    /// A step with at most this many iterations is easy; with `adapt` = "target" the number that step sizes aim at.
    #[schemars(extend("x-procedures" = "implicit"))]
    pub target_iterations: usize,
    /// A step that has not converged after this many iterations is cut back.
    #[schemars(range(min = 1), extend("x-procedures" = "implicit"))]
    pub max_iterations: usize,
    /// How the step size follows the iterations that a step took.
    #[serde(rename = "adapt")]
    #[schemars(extend("x-procedures" = "implicit"))]
    pub rule: StepAdaptation,
    /// What a step prescribes: the load factor, or a measure of displacement with the load factor as an unknown.
    #[serde(rename = "control")]
    #[schemars(extend("x-procedures" = "implicit"))]
    pub path: PathControl,
    /// What happens where no step converges; `None`: the run ends.
    #[serde(flatten, with = "stabilisation_keys")]
    #[schemars(with = "StabilisationKeys")]
    pub stabilisation: Option<Stabilisation>,
}

/// How the size of the next step follows from the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepAdaptation {
    /// Grows by `growth` after an easy step and stays otherwise.
    #[default]
    Easy,
    /// Is multiplied by the square root of `target_iterations` over the iterations taken, at most by `growth` and at least by
    /// `cut` [Crisfield 1981].
    Target,
}

impl StepControl {
    /// Size of the step after one of `size` that took `iterations`.
    pub fn next_size(&self, size: f64, iterations: usize) -> f64 {
        let factor = match self.rule {
            StepAdaptation::Easy if iterations <= self.target_iterations => self.growth,
            StepAdaptation::Easy => 1.0,
            StepAdaptation::Target => {
                let wanted = self.target_iterations.max(1) as f64 / iterations.max(1) as f64;
                wanted.sqrt().clamp(self.cut, self.growth)
            }
        };
        (size * factor).clamp(self.min, 1.0 / self.increments as f64)
    }
}

impl Default for StepControl {
    fn default() -> Self {
        Self {
            increments: 20,
            min: 1e-4,
            growth: 1.5,
            cut: 0.5,
            target_iterations: 6,
            max_iterations: 15,
            rule: StepAdaptation::Easy,
            path: PathControl::Load,
            stabilisation: Some(Stabilisation::default()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_the_iterations() {
        let easy = StepControl { increments: 10, ..StepControl::default() };
        assert_eq!([1, 6, 7].map(|iterations| easy.next_size(0.04, iterations)), [0.06, 0.06, 0.04]);
        let target = StepControl { rule: StepAdaptation::Target, target_iterations: 4, growth: 2.0, ..easy };
        assert_eq!([1, 4, 16, 100].map(|iterations| target.next_size(0.04, iterations)), [0.08, 0.04, 0.02, 0.02]);
        assert_eq!((target.next_size(0.09, 1), target.next_size(1.5e-4, 100)), (0.1, 1e-4));
    }
}
