//! Strategies by name: each presets the detailed choices, which may then be changed one by one.

use super::quasi_newton::QuasiNewton;
use super::strategy::{Predictor, SecantSettings, Strategy};
use super::tangent_update::TangentUpdate;
use protocol::TangentKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solution strategy, by the name that scenes use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NamedStrategy {
    /// Full Newton: the frozen-network tangent at every iterate.
    Newton,
    /// Modified Newton: the same tangent, kept until it converges slowly.
    ModifiedNewton,
    /// Newton with the tangent whose sliding contacts are those of the evaluation's own ramp: none in steps whose first iterate is in
    /// balance, one in others, and more where it converges slowly.
    SlipNewton,
    /// The same with a rank-one secant correction of each point's tangent.
    SlipSecant,
    /// One elastic tangent per point, then secant corrections from stresses alone, carried from step to step: for engines
    /// whose tangents are missing or dear.
    PointSecant,
    /// The frozen-network tangent and limited-memory BFGS on the global equations: no tangent in steps whose first iterate is in
    /// balance, one in others.
    QuasiNewton,
}

protocol::keywords! {
    pub NamedStrategy {
        Newton => "newton",
        ModifiedNewton => "modified_newton",
        SlipNewton => "slip_newton",
        SlipSecant => "slip_secant",
        PointSecant => "point_secant",
        QuasiNewton => "quasi_newton",
    }
}

impl NamedStrategy {
    /// The one used where none is named, for cells of this dimension. Measured (docs/concepts/strategies.md): slip tangents of large cells of
    /// spheres cost many times what they save, and fail where the cell next to flows.
    pub fn default_of(dimension: usize) -> Self {
        if dimension == 3 { Self::QuasiNewton } else { Self::SlipNewton }
    }

    /// The detailed choices.
    pub fn preset(self) -> Strategy {
        let plain = Strategy {
            tangent: TangentKind::TrussLike,
            predictor: Predictor::Linear,
            secant: None,
            tangent_update: TangentUpdate::Always,
            quasi_newton: None,
            tangent_floor: Some(0.02),
            capped_change: 1e-3,
            keep_unchanged: true,
            target_grid: None,
        };
        let slip = Strategy { tangent: TangentKind::TrussLikeSlip, ..plain.clone() };
        match self {
            Self::Newton => plain,
            Self::ModifiedNewton => Strategy { tangent_update: TangentUpdate::WHEN_SLOW, ..plain },
            Self::SlipNewton => Strategy { tangent_update: TangentUpdate::SECOND_ITERATE_OR_SLOW, ..slip },
            Self::SlipSecant => Strategy { secant: Some(SecantSettings::default()), ..slip },
            Self::PointSecant => Strategy {
                tangent_update: TangentUpdate::Once,
                secant: Some(SecantSettings { carried: true, ..SecantSettings::default() }),
                ..plain
            },
            Self::QuasiNewton => Strategy {
                tangent_update: TangentUpdate::SecondIterate,
                quasi_newton: Some(QuasiNewton::default()),
                ..plain
            },
        }
    }
}

impl Default for Strategy {
    fn default() -> Self {
        NamedStrategy::default_of(2).preset()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::Formulation;
    use crate::nonlocal::Kernel;

    #[test]
    fn the_default_is_one_of_the_named_strategies() {
        let defaults = NamedStrategy::ALL.into_iter().filter(|named| named.preset() == Strategy::default());
        assert_eq!(defaults.count(), 1);
    }

    #[test]
    fn keywords_are_those_of_scenes() {
        for named in NamedStrategy::ALL {
            assert_eq!(serde_json::to_value(named).unwrap(), named.keyword());
        }
        for formulation in Formulation::ALL {
            assert_eq!(serde_json::to_value(formulation).unwrap(), formulation.keyword());
        }
        for kernel in Kernel::ALL {
            assert_eq!(serde_json::to_value(kernel).unwrap(), kernel.keyword());
        }
    }
}
