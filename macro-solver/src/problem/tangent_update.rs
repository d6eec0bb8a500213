//! When points are asked for tangents.

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
    /// the first one too after a failed attempt, after a step with a rejected iterate and where supports, links or loads turn back.
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
    /// `tangent_update_contraction` of the out-of-balance force, after a rejected iterate and after a failed attempt. Where the
    /// out-of-balance force grows in two iterations of an attempt, the frozen network replaces tangents with slip for the rest of it.
    EachStepOrSlow,
    /// At the second iterate of every attempt if it has one; at the first one too after a failed attempt, after a step with a
    /// rejected iterate and where supports, links or loads turn back.
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
