//! The table `[rve.operator]`: perturbations and averages of tangent operators.

use crate::error::{DefinitionError, positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The table `[rve.operator]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OperatorOptions {
    /// Displacement gradient of the perturbations of a consistent operator.
    // Definitions keep the old name of the key: their bytes are the identity of an RVE.
    #[serde(rename(serialize = "probe"), alias = "probe")]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-5", "exclusiveMinimum" = 0))]
    pub perturbation: Option<f64>,
    /// Displacement gradient of the perturbations of a quasi-static operator.
    #[serde(rename(serialize = "quasi_static_probe"), alias = "quasi_static_probe")]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-6", "exclusiveMinimum" = 0))]
    pub quasi_static_perturbation: Option<f64>,
    /// Value that the `max_force` criterion must reach in the perturbations of a quasi-static operator.
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-6", "exclusiveMinimum" = 0))]
    pub quasi_static_tolerance: Option<f64>,
    /// Committed steps whose consistent operators make the elastic average.
    #[schemars(extend("x-default" = "5"), range(min = 1))]
    pub average_steps: Option<u32>,
}

impl OperatorOptions {
    /// Checks every key.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub(super) fn validate(&self) -> Result<(), DefinitionError> {
        positive("rve.operator.perturbation", self.perturbation())?;
        positive("rve.operator.quasi_static_perturbation", self.quasi_static_perturbation())?;
        positive("rve.operator.quasi_static_tolerance", self.quasi_static_tolerance())?;
        for (key, size) in
            [("perturbation", self.perturbation()), ("quasi_static_perturbation", self.quasi_static_perturbation())]
        {
            if size > LARGEST_PERTURBATION {
                return Err(DefinitionError(format!(
                    "rve.operator.{key} = {size:e} is too large for a perturbation; use {LARGEST_PERTURBATION:e} or less"
                )));
            }
        }
        if self.average_steps() == 0 {
            return Err(DefinitionError("rve.operator.average_steps must be at least 1".into()));
        }
        Ok(())
    }

    /// Perturbation of a consistent operator in force.
    pub fn perturbation(&self) -> f64 {
        self.perturbation.unwrap_or(1e-5)
    }

    /// Perturbation of a quasi-static operator in force.
    pub fn quasi_static_perturbation(&self) -> f64 {
        self.quasi_static_perturbation.unwrap_or(1e-6)
    }

    /// Tolerance of a quasi-static operator in force.
    pub fn quasi_static_tolerance(&self) -> f64 {
        self.quasi_static_tolerance.unwrap_or(1e-6)
    }

    /// Steps of an elastic average in force.
    pub fn average_steps(&self) -> u32 {
        self.average_steps.unwrap_or(5)
    }
}

/// A probe must stay small against any step.
const LARGEST_PERTURBATION: f64 = 1e-2;
