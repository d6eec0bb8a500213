//! `[dynamics]` and `[relaxation]`.

use super::Components;
use keys::Located;
use schemars::JsonSchema;
use serde::Deserialize;

/// `[dynamics]`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct DynamicsTable {
    pub(crate) density: Option<f64>,
    pub(crate) lumping: Option<LumpingKeyword>,
    pub(crate) safety: Option<f64>,
    pub(crate) time_step: Option<Located<f64>>,
    pub(crate) mass_factor: Option<f64>,
    pub(crate) mass_scaled_step: Option<Located<f64>>,
    pub(crate) mass_damping: Option<f64>,
    pub(crate) stiffness_damping: Option<f64>,
    pub(crate) linear_viscosity: Option<f64>,
    pub(crate) quadratic_viscosity: Option<f64>,
    pub(crate) absorbing: Option<Vec<Located<String>>>,
    pub(crate) initial_velocity: Option<Vec<InitialVelocityTable>>,
    pub(crate) output_steps: Option<u64>,
    pub(crate) output_interval: Option<Located<f64>>,
    pub(crate) energy_tolerance: Option<f64>,
    pub(crate) longest_excess: Option<u64>,
    pub(crate) tangent_every: Option<u64>,
}

/// `[[dynamics.initial_velocity]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct InitialVelocityTable {
    pub(crate) set: Located<String>,
    pub(crate) value: Components,
}

/// How elements give their mass to their nodes.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum LumpingKeyword {
    Hrz,
    RowSum,
}

/// `[relaxation]`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RelaxationTable {
    pub(crate) form: Option<FormKeyword>,
    pub(crate) damping_ratio: Option<f64>,
    pub(crate) safety: Option<f64>,
    pub(crate) kinetic_tolerance: Option<f64>,
    pub(crate) hits: Option<usize>,
    pub(crate) max_iterations: Option<usize>,
}

/// Equations of dynamic relaxation.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FormKeyword {
    Corrected,
    AsPrinted,
}
