//! `[loading]` and `[solver]`.

use keys::Located;
use macro_solver::problem::Axis;
use protocol::TangentKind;
use schemars::JsonSchema;
use serde::Deserialize;

/// `[loading]`; what is left out takes the solver's default.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LoadingTable {
    pub(crate) increments: Option<Located<usize>>,
    pub(crate) duration: Option<Located<f64>>,
    pub(crate) smallest_increment: Option<Located<f64>>,
    pub(crate) growth: Option<Located<f64>>,
    pub(crate) cut: Option<Located<f64>>,
    pub(crate) easy_iterations: Option<Located<usize>>,
    pub(crate) max_iterations: Option<Located<usize>>,
    pub(crate) control: Option<ControlTable>,
    pub(crate) adapt: Option<AdaptKeyword>,
    pub(crate) stabilise: Option<Located<bool>>,
    pub(crate) stabilise_after: Option<Located<usize>>,
    pub(crate) stabilise_increments: Option<Located<usize>>,
    pub(crate) stabilise_drag: Option<Located<f64>>,
}

/// How the step size follows the iterations.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum AdaptKeyword {
    Easy,
    Target,
}

/// `control` of `[loading]`: what a step prescribes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ControlTable {
    Load,
    ArcLength(ArcLengthTable),
    Indirect(IndirectTable),
}

/// `arc_length`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ArcLengthTable {
    pub(crate) first_load: f64,
    pub(crate) set: Option<String>,
    pub(crate) component: Option<Axis>,
}

/// `indirect`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IndirectTable {
    pub(crate) set: String,
    pub(crate) relative_to: Option<String>,
    pub(crate) component: Axis,
    pub(crate) growth: f64,
}

/// `[solver]`; what is left out takes the solver's default.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SolverTable {
    pub(crate) formulation: Option<Located<FormulationKeyword>>,
    pub(crate) equations: Option<Located<EquationKeyword>>,
    pub(crate) hourglass: Option<Located<HourglassKeyword>>,
    pub(crate) strategy: Option<Located<String>>,
    pub(crate) renewal: Option<RenewalKeyword>,
    pub(crate) renewal_contraction: Option<Located<f64>>,
    pub(crate) renewal_uses: Option<Located<usize>>,
    pub(crate) quasi_newton_pairs: Option<Located<usize>>,
    pub(crate) target_grid: Option<Located<f64>>,
    pub(crate) criteria: Option<Located<Vec<CriterionKeyword>>>,
    pub(crate) energy_tolerance: Option<Located<f64>>,
    pub(crate) hourglass_coefficient: Option<Located<f64>>,
    pub(crate) tangent: Option<Located<TangentKind>>,
    pub(crate) force_tolerance: Option<Located<f64>>,
    pub(crate) displacement_tolerance: Option<Located<f64>>,
    pub(crate) predictor: Option<PredictorKeyword>,
    pub(crate) secant: Option<SecantTable>,
    pub(crate) tangent_floor: Option<Located<f64>>,
    pub(crate) capped_change: Option<Located<f64>>,
    pub(crate) keep_unchanged: Option<bool>,
}

/// What holds hourglass modes.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum HourglassKeyword {
    #[default]
    Stiffness,
    Viscous,
}

/// When tangents are asked for.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RenewalKeyword {
    Always,
    WhenSlow,
    EachStep,
    Once,
}

/// Criteria of convergence.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum CriterionKeyword {
    Force,
    ForceOverReactions,
    Displacement,
    CorrectionOverStep,
    Energy,
}

/// Ways to solve the global equations.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EquationKeyword {
    #[default]
    Direct,
    Iterative,
}

/// Formulations.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FormulationKeyword {
    SmallStrain,
    TotalLagrangian,
    #[default]
    Updated,
    Corotational,
}

/// Predictors.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PredictorKeyword {
    Linear,
    Tangent,
}

/// `[solver.secant]`.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SecantTable {
    #[serde(default = "yes")]
    pub(crate) enabled: bool,
    pub(crate) min_change: Option<f64>,
    pub(crate) max_ratio: Option<f64>,
    pub(crate) floor: Option<f64>,
    pub(crate) carried: Option<bool>,
}

fn yes() -> bool {
    true
}
