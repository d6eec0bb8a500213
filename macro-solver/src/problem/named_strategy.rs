//! Strategies by name: each presets the detailed choices, which may then be changed one by one.

use super::strategy::{Predictor, SecantGates, Strategy};
use protocol::TangentKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When points are asked for tangents. The global matrix is factorized with fresh tangents, and in every iteration if
/// point tangents are corrected by secants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "TangentUpdateKeys", into = "TangentUpdateKeys")]
pub enum TangentUpdate {
    /// At every iterate: full Newton.
    #[default]
    Always,
    /// Kept over iterations and steps until an iteration leaves more than `contraction` of the out-of-balance force or
    /// the tangents have served for `most_uses` iterations: modified Newton. A failed attempt renews them too.
    WhenSlow {
        /// Share of the out-of-balance force, between 0 and 1.
        contraction: f64,
        /// Iterations.
        most_uses: usize,
    },
    /// At the first iterate of every attempt.
    EachStep,
    /// The same, and at every further iterate after an iteration that leaves more than `contraction` of the out-of-balance force, a
    /// rejected iterate or a failed attempt.
    EachStepOrSlow {
        /// Share of the out-of-balance force, between 0 and 1.
        contraction: f64,
    },
    /// At the second iterate of every attempt if it has one, the first being judged and corrected by the tangents of the step before; at
    /// the first one too after a failed attempt, after a step with a rejected iterate and where supports turn back.
    SecondIterate,
    /// As [`Self::EachStepOrSlow`], from the second iterate of every attempt on: the first is judged and corrected by the tangents of the step before,
    /// unless that was slow or failed.
    SecondIterateOrSlow {
        /// Share of the out-of-balance force, between 0 and 1.
        contraction: f64,
    },
    /// At the start, and after a failed attempt.
    Once,
}

impl TangentUpdate {
    /// Modified Newton with the values that were measured to need the fewest evaluations.
    pub const WHEN_SLOW: Self = Self::WhenSlow { contraction: 0.5, most_uses: 12 };

    /// Less than what full Newton needs: the last iterate of a step, which is only checked, gets no tangents of its own, and steps whose
    /// first iterate is in balance get none at all.
    pub const SECOND_ITERATE_OR_SLOW: Self = Self::SecondIterateOrSlow { contraction: 0.5 };

    /// Whether a factorization outlives the iterate that it was made at.
    pub fn keeps(self) -> bool {
        self != Self::Always
    }
}

/// The keys of `[solver]` that say when tangents are updated.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct TangentUpdateKeys {
    /// When points are asked for tangents.
    #[schemars(extend("x-default" = "by `strategy`", "x-procedures" = "implicit"))]
    tangent_update: TangentUpdateWord,
    /// Of "when_slow", "each_step_or_slow" and "second_iterate_or_slow": share of the out-of-balance force that an iteration may leave before
    /// tangents are updated.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "x-procedures" = "implicit"), range(max = 1.0))]
    tangent_update_contraction: f64,
    /// Of "when_slow": iterations for which tangents serve at most.
    #[schemars(extend("x-procedures" = "implicit"), range(min = 1))]
    tangent_max_uses: usize,
}

/// When tangents are updated.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum TangentUpdateWord {
    /// At every iterate: full Newton.
    Always,
    /// Kept over iterations and steps until an iteration leaves more than `tangent_update_contraction` of the out-of-balance
    /// force, or for `tangent_max_uses` iterations: modified Newton.
    WhenSlow,
    /// At the first iterate of every attempt.
    EachStep,
    /// At the first iterate of every attempt; at every further one after an iteration that leaves more than
    /// `tangent_update_contraction` of the out-of-balance force, after a rejected iterate and after a failed attempt.
    EachStepOrSlow,
    /// At the second iterate of every attempt if it has one; at the first one too after a failed attempt, after a step with a
    /// rejected iterate and where supports turn back.
    SecondIterate,
    /// As `"each_step_or_slow"`, but from the second iterate on: the first is judged and corrected by the tangents of the step before,
    /// unless that was slow or failed.
    SecondIterateOrSlow,
    /// At the start, and after a failed attempt.
    Once,
}

impl Default for TangentUpdateKeys {
    fn default() -> Self {
        let word = TangentUpdateWord::Always;
        Self { tangent_update: word, tangent_update_contraction: 0.5, tangent_max_uses: 12 }
    }
}

impl From<TangentUpdateKeys> for TangentUpdate {
    fn from(keys: TangentUpdateKeys) -> Self {
        match keys.tangent_update {
            TangentUpdateWord::Always => Self::Always,
            TangentUpdateWord::WhenSlow => {
                Self::WhenSlow { contraction: keys.tangent_update_contraction, most_uses: keys.tangent_max_uses }
            }
            TangentUpdateWord::EachStep => Self::EachStep,
            TangentUpdateWord::EachStepOrSlow => {
                Self::EachStepOrSlow { contraction: keys.tangent_update_contraction }
            }
            TangentUpdateWord::SecondIterate => Self::SecondIterate,
            TangentUpdateWord::SecondIterateOrSlow => {
                Self::SecondIterateOrSlow { contraction: keys.tangent_update_contraction }
            }
            TangentUpdateWord::Once => Self::Once,
        }
    }
}

impl From<TangentUpdate> for TangentUpdateKeys {
    fn from(update: TangentUpdate) -> Self {
        let with = |tangent_update| Self { tangent_update, ..Self::default() };
        match update {
            TangentUpdate::Always => with(TangentUpdateWord::Always),
            TangentUpdate::WhenSlow { contraction, most_uses } => Self {
                tangent_update: TangentUpdateWord::WhenSlow,
                tangent_update_contraction: contraction,
                tangent_max_uses: most_uses,
            },
            TangentUpdate::EachStep => with(TangentUpdateWord::EachStep),
            TangentUpdate::EachStepOrSlow { contraction } => {
                Self { tangent_update_contraction: contraction, ..with(TangentUpdateWord::EachStepOrSlow) }
            }
            TangentUpdate::SecondIterate => with(TangentUpdateWord::SecondIterate),
            TangentUpdate::SecondIterateOrSlow { contraction } => {
                Self { tangent_update_contraction: contraction, ..with(TangentUpdateWord::SecondIterateOrSlow) }
            }
            TangentUpdate::Once => with(TangentUpdateWord::Once),
        }
    }
}

/// Limited-memory BFGS on the free degrees of freedom, on top of the kept factors [Nocedal and Wright, algorithm 7.4].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuasiNewton {
    /// Pairs of changes of displacement and out-of-balance force that are remembered, over steps too.
    pub pairs: usize,
    /// Pairs between whose iterates no point's displacement gradient has changed by this much are noise and are not
    /// used; dimensionless.
    pub min_change: f64,
}

impl Default for QuasiNewton {
    fn default() -> Self {
        Self { pairs: 20, min_change: 2e-5 }
    }
}

/// The keys of `[solver]` about quasi-Newton corrections.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct QuasiNewtonKeys {
    /// Pairs that limited-memory BFGS keeps, over steps too; 0 switches it off.
    #[schemars(extend("x-default" = "by `strategy`", "x-procedures" = "implicit"))]
    quasi_newton_pairs: usize,
    /// Pairs between whose iterates no point's displacement gradient has changed by this much are noise and are not used.
    #[schemars(extend("x-unit" = "-", "x-procedures" = "implicit"), range(min = 0.0))]
    quasi_newton_min_change: f64,
}

impl Default for QuasiNewtonKeys {
    fn default() -> Self {
        Self { quasi_newton_pairs: 0, quasi_newton_min_change: QuasiNewton::default().min_change }
    }
}

pub(super) mod quasi_newton_keys {
    use super::{QuasiNewton, QuasiNewtonKeys};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::problem) fn serialize<S: Serializer>(
        settings: &Option<QuasiNewton>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let keys = settings.map_or(QuasiNewtonKeys::default(), |settings| QuasiNewtonKeys {
            quasi_newton_pairs: settings.pairs,
            quasi_newton_min_change: settings.min_change,
        });
        keys.serialize(serializer)
    }

    pub(in crate::problem) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<QuasiNewton>, D::Error> {
        let keys = QuasiNewtonKeys::deserialize(deserializer)?;
        let settings = QuasiNewton { pairs: keys.quasi_newton_pairs, min_change: keys.quasi_newton_min_change };
        Ok((settings.pairs > 0).then_some(settings))
    }
}

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
            Self::SlipSecant => Strategy { secant: Some(SecantGates::default()), ..slip },
            Self::PointSecant => Strategy {
                tangent_update: TangentUpdate::Once,
                secant: Some(SecantGates { carried: true, ..SecantGates::default() }),
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
