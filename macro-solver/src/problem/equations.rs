//! What holds for the global equations of all stages: the keys of `[solver]` that a stage cannot change.

use super::{EquationSolver, Problem};
use crate::element::hourglass::HourglassControl;
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

/// The keys of `[solver]` about hourglass modes.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct HourglassKeys {
    /// What holds hourglass modes of elements with one Gauss point.
    #[schemars(extend("x-scope" = "run"))]
    hourglass: HourglassWord,
    /// Stiffness against hourglass modes relative to the first shear stiffness of the material; of "viscous" a fraction of critical
    /// damping. The energy taken is the probe "hourglass_energy" and `energy.hourglass` of the summary.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "x-scope" = "run"))]
    hourglass_coefficient: f64,
}

/// Kinds of hourglass control.
#[derive(Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum HourglassWord {
    /// Springs.
    #[default]
    Stiffness,
    /// Dashpots, for runs whose stages are all dynamic.
    Viscous,
}

impl Default for HourglassKeys {
    fn default() -> Self {
        Self::from(HourglassControl::default())
    }
}

impl From<HourglassKeys> for HourglassControl {
    fn from(HourglassKeys { hourglass, hourglass_coefficient: coefficient }: HourglassKeys) -> Self {
        match hourglass {
            HourglassWord::Stiffness => Self::Stiffness { coefficient },
            HourglassWord::Viscous => Self::Viscous { coefficient },
        }
    }
}

impl From<HourglassControl> for HourglassKeys {
    fn from(control: HourglassControl) -> Self {
        let hourglass = match control {
            HourglassControl::Stiffness { .. } => HourglassWord::Stiffness,
            HourglassControl::Viscous { .. } => HourglassWord::Viscous,
        };
        Self { hourglass, hourglass_coefficient: control.coefficient() }
    }
}
