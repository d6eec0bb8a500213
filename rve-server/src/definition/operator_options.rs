//! The table `[rve.operator]`: perturbations and averages of tangent operators.

use crate::error::{DefinitionError, in_declared_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};

/// The table `[rve.operator]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OperatorOptions {
    /// Displacement gradient of the perturbations of a consistent operator.
    // Perturbations must stay small against any step.
    #[serde(alias = "probe")]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-5", "exclusiveMinimum" = 0), range(max = 0.01))]
    pub perturbation: Option<f64>,
    /// Displacement gradient of the perturbations of a quasi-static operator.
    #[serde(alias = "quasi_static_probe")]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-6", "exclusiveMinimum" = 0), range(max = 0.01))]
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
        in_declared_ranges(self, "rve.operator")
    }

    /// As definitions hold it, with the old names of two keys: the bytes of a definition are the identity of an RVE.
    ///
    /// # Errors
    /// Those of the serializer.
    pub(super) fn with_old_names<S: Serializer>(options: &Self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct OldNames {
            probe: Option<f64>,
            quasi_static_probe: Option<f64>,
            quasi_static_tolerance: Option<f64>,
            average_steps: Option<u32>,
        }
        let Self { perturbation, quasi_static_perturbation, quasi_static_tolerance, average_steps } = *options;
        let names = OldNames {
            probe: perturbation,
            quasi_static_probe: quasi_static_perturbation,
            quasi_static_tolerance,
            average_steps,
        };
        names.serialize(serializer)
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
