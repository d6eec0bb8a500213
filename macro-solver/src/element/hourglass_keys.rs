//! Hourglass control as the keys of `[solver]` write it.

use super::hourglass::HourglassControl;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
