//! What holds for the global equations of all stages: the keys of `[solver]` that a stage cannot change.

use super::{EquationSolver, Problem};
use crate::element::hourglass::{HourglassControl, HourglassKeys};
use crate::formulation::Formulation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The choices of a [`Problem`] that concern all stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EquationSettings {
    /// Strain measure, and the configuration on which stress is integrated.
    #[schemars(extend("x-scope" = "run"))]
    pub formulation: Formulation,
    /// How the global linear equations are solved.
    #[schemars(extend("x-scope" = "run", "x-procedures" = "implicit"))]
    pub equations: EquationSolver,
    /// What holds the hourglass modes of elements with one point.
    #[serde(flatten)]
    #[schemars(with = "HourglassKeys")]
    pub hourglass: HourglassControl,
}

impl EquationSettings {
    /// Those of a problem.
    pub fn of(problem: &Problem) -> Self {
        let Problem { formulation, equations, hourglass, .. } = *problem;
        Self { formulation, equations, hourglass }
    }
}
