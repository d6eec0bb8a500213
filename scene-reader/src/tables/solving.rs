//! `[solver]`: a table that several settings of the solver share.

use macro_solver::problem::{EquationSettings, NamedStrategy, Strategy, Tolerances};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
