//! The table `[rve.operator]`: how operators are probed, averaged and solved for.

use crate::error::{DefinitionError, positive};
use serde::{Deserialize, Serialize};

/// The table `[rve.operator]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OperatorOptions {
    /// Displacement gradient of the probes of a consistent operator, dimensionless; default 1e-5.
    pub probe: Option<f64>,
    /// The same of a quasi-static operator; default 1e-6.
    pub quasi_static_probe: Option<f64>,
    /// Value that the `max_force` criterion must reach in its probes; default 1e-6.
    pub quasi_static_tolerance: Option<f64>,
    /// Committed steps whose consistent operators make the elastic average; default 5.
    pub average_steps: Option<u32>,
}

impl OperatorOptions {
    /// Checks every key.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub(super) fn validate(&self) -> Result<(), DefinitionError> {
        positive("rve.operator.probe", self.probe())?;
        positive("rve.operator.quasi_static_probe", self.quasi_static_probe())?;
        positive("rve.operator.quasi_static_tolerance", self.quasi_static_tolerance())?;
        for (key, probe) in [("probe", self.probe()), ("quasi_static_probe", self.quasi_static_probe())] {
            if probe > LARGEST_PROBE {
                return Err(DefinitionError(format!(
                    "rve.operator.{key} = {probe:e} is no small probe; use {LARGEST_PROBE:e} or less"
                )));
            }
        }
        if self.average_steps() == 0 {
            return Err(DefinitionError("rve.operator.average_steps must be at least 1".into()));
        }
        Ok(())
    }

    /// Probe of a consistent operator in force.
    pub fn probe(&self) -> f64 {
        self.probe.unwrap_or(1e-5)
    }

    /// Probe of a quasi-static operator in force.
    pub fn quasi_static_probe(&self) -> f64 {
        self.quasi_static_probe.unwrap_or(1e-6)
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
const LARGEST_PROBE: f64 = 1e-2;
