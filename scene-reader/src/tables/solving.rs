//! `[loading]` and `[solver]`: tables that several settings of the solver share.

use macro_solver::problem::{EquationSettings, NamedStrategy, StepControl, Strategy, Tolerances};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[loading]`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct LoadingTable {
    /// Length of the stage: the time of histories, and real time in a dynamic stage. In quasi-static stages it scales the column
    /// `time` alone.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub(crate) duration: f64,
    #[serde(flatten)]
    pub(crate) control: StepControl,
}

impl Default for LoadingTable {
    fn default() -> Self {
        Self { duration: 1.0, control: StepControl::default() }
    }
}

/// `[solver]`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct SolverTable {
    /// Solution strategy by name, which presets `tangent`, `tangent_update`, `secant` and `quasi_newton_pairs`;
    /// `docs/concepts/strategies.md` compares them.
    #[schemars(
        with = "Option<NamedStrategy>",
        extend(
            "x-default" = "\"slip_newton\"; for spheres \"quasi_newton\" unless `tangent` or `loading.control` is given",
            "x-procedures" = "implicit"
        )
    )]
    #[serde(rename = "strategy")]
    pub(crate) named: Option<NamedStrategy>,
    #[serde(flatten)]
    pub(crate) equations: EquationSettings,
    #[serde(flatten)]
    pub(crate) tolerances: Tolerances,
    #[serde(flatten)]
    pub(crate) choices: Strategy,
}
