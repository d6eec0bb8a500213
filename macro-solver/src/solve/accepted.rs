//! How attempts at a step end, and what is known of an accepted one; the same for all procedures.

use crate::observer::{Convergence, DynamicsView, Statistics};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// A converged step, not yet committed.
#[derive(Clone, Debug)]
pub(super) struct Converged {
    /// Change of the displacements, m, by degree of freedom.
    pub(super) increment: Vec<f64>,
    /// Load factor reached.
    pub(super) load: f64,
    /// Iterations used.
    pub(super) iterations: usize,
    /// Force ratio reached.
    pub(super) force_ratio: f64,
    /// Displacement ratio reached.
    pub(super) displacement_ratio: f64,
    /// Correction that the state would still get, m, by degree of freedom; `None` for procedures that know none.
    pub(super) correction: Option<Vec<f64>>,
    /// How it met its criteria.
    pub(super) convergence: Convergence,
}

/// An iterate that is not in balance, and from which a step goes on.
#[derive(Clone, Debug)]
pub(super) struct Unfinished {
    /// Change of the displacements, m, by degree of freedom. The material has evaluated it last.
    pub(super) increment: Vec<f64>,
    /// Iterations used.
    pub(super) iterations: usize,
    /// Force ratio reached.
    pub(super) force_ratio: f64,
}

/// How an attempt at a step ends that has not failed.
#[derive(Clone, Debug)]
pub(super) enum Attempted {
    /// Within the tolerances.
    Converged(Converged),
    /// Iterations from the committed state do not contract: the step goes on from the last iterate.
    Unfinished(Unfinished),
}

/// What the last accepted load step tells about the next one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LastStep {
    /// Change of the displacements, m, by degree of freedom.
    pub(super) increment: Vec<f64>,
    /// Share of the stage's path that it took.
    pub(super) size: f64,
    /// Correction that the accepted state would still get, m, by degree of freedom; empty where the procedure knows none, or where
    /// the step converged slowly.
    pub(super) correction: Vec<f64>,
}

impl LastStep {
    /// Whether its displacements are those of a mesh with this number of degrees of freedom.
    pub(super) fn fits(&self, dofs: usize) -> bool {
        self.increment.len() == dofs && [0, dofs].contains(&self.correction.len())
    }
}

/// How a step ended that was stabilised or went on from a committed iterate.
pub(super) enum Followed {
    /// In equilibrium; the step has been accepted after this many iterations and increments.
    Accepted(usize),
    /// Without equilibrium, for this reason; the body is in the state before it again.
    TakenBack(String),
}

/// Counters at the start of a step, and what happened before it was accepted.
#[derive(Clone, Copy)]
pub(super) struct Counters {
    pub(super) evaluations: u64,
    pub(super) skipped: u64,
    /// Failed attempts.
    pub(super) cut_backs: usize,
    /// Increments of viscous stabilisation.
    pub(super) stabilisation_increments: usize,
    /// Iterates committed before the last.
    pub(super) committed_iterates: usize,
}

impl Counters {
    /// At this moment.
    pub(super) fn of(statistics: &Statistics) -> Self {
        Self {
            evaluations: statistics.evaluations,
            skipped: statistics.skipped + statistics.still_points,
            cut_backs: 0,
            stabilisation_increments: 0,
            committed_iterates: 0,
        }
    }
}

/// An accepted and committed state, as its procedure knows it. Forces run over all degrees of freedom, N, in the plane per metre
/// of thickness.
pub(super) struct AcceptedState<'a> {
    /// Load factor.
    pub(super) load: f64,
    /// Share of the stage's path.
    pub(super) stage_fraction: f64,
    /// Share of the path that the step covers.
    pub(super) step_size: f64,
    /// Iterations or time steps.
    pub(super) iterations: usize,
    /// See [`crate::observer::StepReport::force_ratio`].
    pub(super) force_ratio: f64,
    /// See [`crate::observer::StepReport::displacement_ratio`].
    pub(super) displacement_ratio: f64,
    /// See [`crate::observer::StepReport::convergence`].
    pub(super) convergence: Convergence,
    /// Displacement gradients of the points in the step.
    pub(super) gradients: &'a [Matrix3<f64>],
    /// Forces of supports and multi-point constraints.
    pub(super) reactions: &'a [f64],
    /// Forces of the loads.
    pub(super) loads: &'a [f64],
    /// Energy of the hourglass control, J, in the plane per metre.
    pub(super) hourglass_energy: f64,
    /// Motion, in a dynamic stage.
    pub(super) dynamics: Option<DynamicsView<'a>>,
}
