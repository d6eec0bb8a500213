//! Settings of dynamic relaxation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which equations are followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RelaxationForm {
    /// With the errata put right.
    #[default]
    Corrected,
    /// As printed in [Liu2018], for the comparison that shows why not. A step beyond the element bound is not followed: the
    /// attempt fails with that reason.
    AsPrinted,
}

/// How an equilibrium is relaxed to: the keys of `[relaxation]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RelaxationSettings {
    /// Equations that are followed. "as_printed" also changes the defaults of `safety` (0.5) and `hits` (1).
    pub form: RelaxationForm,
    /// Damping ratio `xi` of the moving mode.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub damping_ratio: f64,
    /// Share of the critical step; in the printed form `gamma`.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0), range(max = 1.0))]
    pub safety: f64,
    /// Kinetic energy below which the body is at rest, over its largest value in the attempt or, if that is larger, over what a critically damped
    /// motion from the last equilibrium would have had; `solver.force_tolerance` must hold too. "as_printed" knows the first only.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub kinetic_tolerance: f64,
    /// Iterations in a row in which all criteria must hold.
    #[schemars(range(min = 1))]
    pub hits: usize,
    /// Iterations after which an increment has failed and is cut back.
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
}

impl Default for RelaxationSettings {
    fn default() -> Self {
        Self {
            form: RelaxationForm::Corrected,
            damping_ratio: 1.0,
            safety: 0.9,
            kinetic_tolerance: 1e-3,
            hits: 3,
            max_iterations: 20_000,
        }
    }
}

impl RelaxationSettings {
    /// As printed in [Liu2018] section 4.1: `xi = 1`, `gamma = 0.5`, one hit of the kinetic criterion.
    pub fn as_printed() -> Self {
        Self { form: RelaxationForm::AsPrinted, safety: 0.5, hits: 1, ..Self::default() }
    }

    /// The settings with which a form begins.
    pub fn of_form(form: RelaxationForm) -> Self {
        match form {
            RelaxationForm::Corrected => Self::default(),
            RelaxationForm::AsPrinted => Self::as_printed(),
        }
    }
}
