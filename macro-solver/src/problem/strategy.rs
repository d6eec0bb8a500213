//! Choices that change the path to the answer, not the equations.

use super::quasi_newton::{QuasiNewton, QuasiNewtonKeys, quasi_newton_keys};
use super::tangent_update::{TangentUpdate, TangentUpdateKeys};
use protocol::TangentKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the first iterate of a step is guessed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Predictor {
    /// The last accepted step's displacements, scaled by the motion of supports and links in this step over that in the last, or by the change
    /// of the loads where none moves. The tangent predictor where there is no such step, where that ratio is more than four times that of the
    /// step sizes, or where the motion or change has another direction.
    #[default]
    Linear,
    /// One linear solve with the last tangent.
    Tangent,
}

/// Rank-one correction of the tangent of each point from its last two evaluations: when it is made, and how long it serves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SecantSettings {
    /// Pairs of targets closer than this strain are noise and are not used.
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub min_change: f64,
    /// Pairs whose stress change over target change exceeds this many times the norm of the point's first tangent
    /// are not used (Frobenius norms).
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub max_ratio: f64,
    /// The smallest eigenvalue of the corrected symmetric part in strain space must stay above this share of the
    /// point's first tangent's `C_2222`; the correction is halved twice, then dropped.
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub floor: f64,
    /// Whether corrections outlive their iterate: they add up over iterations and steps until the load turns back or an
    /// attempt fails. Then also the step from the committed state to its first iterate is such a pair.
    #[schemars(extend("x-default" = "by `strategy`"))]
    pub carried: bool,
}

impl Default for SecantSettings {
    fn default() -> Self {
        Self { min_change: 2e-5, max_ratio: 3.0, floor: 0.02, carried: false }
    }
}

/// `[solver.secant]`: the settings, and whether they are in use.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct SecantKeys {
    /// Whether tangents are corrected by secants. A table that is written switches them on unless it says otherwise.
    #[schemars(extend("x-when-written" = true, "x-default" = "true"))]
    enabled: bool,
    #[serde(flatten)]
    settings: SecantSettings,
}

mod secant_keys {
    use super::{SecantKeys, SecantSettings};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(
        settings: &Option<SecantSettings>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        SecantKeys { enabled: settings.is_some(), settings: settings.unwrap_or_default() }.serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<SecantSettings>, D::Error> {
        let keys = SecantKeys::deserialize(deserializer)?;
        Ok(keys.enabled.then_some(keys.settings))
    }
}

/// Choices that change the path to the answer, not the equations: keys of `[solver]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Strategy {
    /// Tangent operator asked of every point.
    #[schemars(extend("x-default" = "by `strategy`", "x-procedures" = "implicit", "x-without" = "none"))]
    pub tangent: TangentKind,
    /// First iterate of a step.
    #[schemars(extend("x-procedures" = "implicit relaxation"))]
    pub predictor: Predictor,
    /// Rank-one correction of each point's tangent from its last two evaluations.
    #[serde(with = "secant_keys")]
    #[schemars(with = "SecantKeys", extend("x-default" = "by `strategy`", "x-procedures" = "implicit"))]
    pub secant: Option<SecantSettings>,
    /// When points are asked for tangents.
    #[serde(flatten)]
    #[schemars(with = "TangentUpdateKeys")]
    pub tangent_update: TangentUpdate,
    /// Global quasi-Newton corrections; `None` switches them off.
    #[serde(flatten, with = "quasi_newton_keys")]
    #[schemars(with = "QuasiNewtonKeys")]
    pub quasi_newton: Option<QuasiNewton>,
    /// Smallest stiffness against any strain that the global tangent takes from a point, as a share of the `C_2222`
    /// of the point's first tangent; weaker directions are stiffened to it. Tangents of slipping networks can be
    /// nearly singular and would send corrections anywhere; the equations solved are not touched. 0 takes tangents as they are.
    #[serde(with = "keys::forms::zero_is_none")]
    #[schemars(with = "f64", extend("x-unit" = "-", "exclusiveMaximum" = 1), range(min = 0.0))]
    pub tangent_floor: Option<f64>,
    /// Largest change of any component of any point's `H` from one iterate to the next, dimensionless. Until the
    /// residual of an attempt grows, changes up to the step's own largest predicted `|H_ij|` are allowed too.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "x-procedures" = "implicit"))]
    pub capped_change: f64,
    /// Whether a point whose target has not changed in any bit since its last evaluation of this step keeps that
    /// answer instead of being asked again. Exact: a trial is a pure function of its target.
    pub keep_unchanged: bool,
    /// Rounds the targets of points to multiples of this share of the step's largest strain; dimensionless. Points that
    /// are to deform alike, but for the round-off of the global solution, then have the same target in every bit:
    /// it is computed once, and round-off does not set them apart where they soften. 0 takes targets as they are.
    #[serde(with = "keys::forms::zero_is_none")]
    #[schemars(with = "f64", extend("x-unit" = "-", "x-procedures" = "implicit"), range(min = 0.0, max = 1e-3))]
    pub target_grid: Option<f64>,
}

impl Strategy {
    /// Whether the tangents know which contacts slide, without which they are too stiff.
    pub(crate) fn follows_sliding_contacts(&self) -> bool {
        let knows = matches!(
            self.tangent,
            TangentKind::TrussLikeSlip
                | TangentKind::TrussLikeSlipAtRest
                | TangentKind::TrussLikeReleased
                | TangentKind::TrussLikeReleasedAtRest
                | TangentKind::Consistent
                | TangentKind::ConsistentCentral
        );
        knows && self.quasi_newton.is_none()
    }
}
