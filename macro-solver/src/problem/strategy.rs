//! Choices that change the path to the answer, not the equations.

use super::{NamedStrategy, QuasiNewton, Renewal};
use protocol::TangentKind;

/// How the first iterate of a step is guessed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Predictor {
    /// The last accepted step's displacements scaled by the ratio of step sizes; the tangent predictor where there
    /// is no such step.
    #[default]
    Linear,
    /// One linear solve with the last tangent.
    Tangent,
}

/// Rank-one correction of the tangent of each point from its last two evaluations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecantGates {
    /// Pairs of targets closer than this are noise and are not used; dimensionless strain.
    pub min_change: f64,
    /// Pairs whose stress change over target change exceeds this many times the norm of the point's first tangent
    /// are not used (Frobenius norms).
    pub max_ratio: f64,
    /// The smallest eigenvalue of the corrected symmetric part in strain space must stay above this share of the
    /// point's first tangent's `C_2222`; the correction is halved twice, then dropped.
    pub floor: f64,
    /// Whether corrections outlive their iterate: they add up over iterations and steps until the load turns back or an
    /// attempt fails. Then also the step from the committed state to its first iterate is such a pair.
    pub carried: bool,
}

impl Default for SecantGates {
    fn default() -> Self {
        Self { min_change: 2e-5, max_ratio: 3.0, floor: 0.02, carried: false }
    }
}

/// Choices that change the path to the answer, not the equations.
#[derive(Clone, Debug, PartialEq)]
pub struct Strategy {
    /// Tangent operator asked of every point.
    pub tangent: TangentKind,
    /// First iterate of a step.
    pub predictor: Predictor,
    /// Per-point secant correction; `None` switches it off.
    pub secant: Option<SecantGates>,
    /// When points are asked for tangents.
    pub renewal: Renewal,
    /// Global quasi-Newton corrections; `None` switches them off.
    pub quasi_newton: Option<QuasiNewton>,
    /// Smallest stiffness against any strain that the global tangent takes from a point, as a share of the `C_2222`
    /// of the point's first tangent; weaker directions are stiffened to it. Tangents of slipping networks can be
    /// nearly singular and would send corrections anywhere; the equations solved are not touched. `None` takes
    /// tangents as they are.
    pub tangent_floor: Option<f64>,
    /// Largest change of any component of any point's `H` from one iterate to the next, dimensionless. Until the
    /// residual of an attempt grows, changes up to the step's own largest predicted `|H_ij|` are allowed too.
    pub capped_change: f64,
    /// Whether a point whose target has not changed in any bit since its last evaluation of this step keeps that
    /// answer instead of being asked again. Exact: a trial is a pure function of its target.
    pub keep_unchanged: bool,
    /// Rounds the targets of points to multiples of this share of the step's largest strain; dimensionless. Points that
    /// are to deform alike, but for the round-off of the global solution, are then asked the same question in every bit:
    /// it is computed once, and round-off does not set them apart where they soften. `None` takes targets as they are.
    pub target_grid: Option<f64>,
}

impl Default for Strategy {
    fn default() -> Self {
        NamedStrategy::default_of(2).preset()
    }
}
