//! `[economy]`: work that a run leaves out, and how to have it done all the same.

use schemars::JsonSchema;
use serde::Deserialize;

/// `[economy]`. Every key is a shortcut that is taken unless it is switched off; `summary.json` counts them in `economy`.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct EconomyTable {
    /// Whether a Gauss point whose target is equal in every bit to that of its last evaluation in the step keeps that reply. Exact.
    pub(crate) unchanged_targets: bool,
    /// Whether trials of one evaluation that are equal in every bit of state, target and options are solved once. Exact.
    pub(crate) duplicate_trials: bool,
    /// Whether an increment of exactly zero is answered by the committed state as it is, unasked unless a tangent is wanted. When switched off,
    /// the grains are relaxed once more, which changes the stress by less than the tolerance of the grain solver.
    pub(crate) zero_increments: bool,
}

impl Default for EconomyTable {
    fn default() -> Self {
        Self { unchanged_targets: true, duplicate_trials: true, zero_increments: true }
    }
}
