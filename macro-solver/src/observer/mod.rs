//! What a run reports to the outside: events, the state after every accepted step, and final statistics.
//!
//! Outputs, progress bars and logs are [`Observer`]s; they need nothing but what is handed to them here. Counts are
//! deterministic. Times are not, are named `*_nanoseconds`, and must not reach a file that is compared bit by bit.

mod accuracy;
mod energy;
mod fields;
mod statistics;
pub mod trial_costs;

pub use accuracy::{AccuracyFigures, BalanceError, StepAccuracy};
pub use energy::EnergyBalance;
pub use fields::{DynamicsView, FieldsView, PointFields};
pub use statistics::{FlagCounts, Statistics};

use crate::checkpoint::{Archive, CheckpointError};
use crate::problem::{Problem, ProblemError, Stage};
use thiserror::Error;

/// An observer can no longer do its work, for example because the disk is full; the run ends.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{reason}")]
pub struct StopRequest {
    /// For people, with the remedy.
    pub reason: String,
}

/// Listens to a run. Every method has an empty default.
pub trait Observer {
    /// The problem is valid and the first evaluation is about to start.
    ///
    /// # Errors
    /// Ends the run before it starts.
    fn started(&mut self, _problem: &Problem) -> Result<(), StopRequest> {
        Ok(())
    }

    /// A stage, counted from 0, is about to begin. Not reported again when an interrupted run continues within it.
    fn stage_started(&mut self, _number: usize, _stage: &Stage) {}

    /// One iteration of a step is done: all points have answered, the residual is known.
    fn iterated(&mut self, _report: &IterationReport) {}

    /// A step was accepted and committed. Step 0 is the initial equilibrium at load 0 of the first stage; numbers go on
    /// over all stages.
    ///
    /// # Errors
    /// Ends the run after this step.
    fn accepted(&mut self, _report: &StepReport, _fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        Ok(())
    }

    /// A step failed and is tried again with a smaller size.
    fn cut_back(&mut self, _event: &CutBack) {}

    /// A step that found no balance was stabilised; it is accepted next.
    fn stabilised(&mut self, _event: &Stabilised) {}

    /// A step whose iterations did not contract went on from committed iterates, without viscosity; it is accepted next.
    fn iterates_committed(&mut self, _event: &Stabilised) {}

    /// The run is over; nothing follows.
    fn finished(&mut self, _run: &Run) {}

    /// Saves what must not be lost between two processes of a run, see [`PointMaterial::save`](crate::material::PointMaterial::save).
    fn save(&self, _archive: &mut Archive) {}

    /// Takes up what was saved, after [`Observer::started`].
    ///
    /// # Errors
    /// See [`PointMaterial::restore`](crate::material::PointMaterial::restore).
    fn restore(&mut self, _archive: &Archive) -> Result<(), CheckpointError> {
        Ok(())
    }
}

/// An observer that does nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Observer for Silent {}

/// One iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationReport {
    /// Step being solved, counted over accepted steps; 0 is the initial equilibrium.
    pub step: usize,
    /// Load factor aimed at; 1 is the whole load of the stage. Where it is an unknown, as with an arc length, it may fall.
    pub load: f64,
    /// From 1.
    pub iteration: usize,
    /// Points evaluated in this iteration.
    pub evaluations: u64,
    /// Out-of-balance over reactions and loads, see [`crate::problem::ForceMeasure`].
    pub force_ratio: f64,
    /// Next correction over the displacements of a full step, see [`crate::problem::DisplacementMeasure`]; `None` when
    /// the iterate was rejected before a correction was computed.
    pub displacement_ratio: Option<f64>,
    /// Whether this iterate was rejected by the globalisation, so that the next one goes back towards the last accepted one, or is a
    /// rejected increment of viscous stabilisation.
    pub rejected: bool,
}

/// One accepted step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Counted over accepted steps; 0 is the initial equilibrium.
    pub step: usize,
    /// Stage, from 0.
    pub stage: usize,
    /// Load factor reached; 1 is the whole load of the stage. Where it is an unknown, as with an arc length, it may fall.
    pub load: f64,
    /// Time since the start of the run, s.
    pub time: f64,
    /// Share of the whole path reached, 0 to 1; every stage counts the same.
    pub share: f64,
    /// Share of the path of the stage covered by this step.
    pub size: f64,
    /// Iterations of the successful attempt.
    pub iterations: usize,
    /// Point evaluations of this step, failed attempts included.
    pub evaluations: u64,
    /// Evaluations saved because a target had not changed in any bit, or a point stood still.
    pub skipped: u64,
    /// Failed attempts before this step.
    pub cut_backs: usize,
    /// Increments of viscous stabilisation in this step, see [`Stabilised`]; 0 unless it was stabilised.
    pub stabilisation_increments: usize,
    /// Iterates of this step that were committed before the last; 0 in stabilised steps, whose increments are counted there.
    pub committed_iterates: usize,
    /// Out-of-balance ratio of the accepted state.
    pub force_ratio: f64,
    /// Displacement ratio of the accepted state; 0 for an initial equilibrium that needed no iteration.
    pub displacement_ratio: f64,
    /// Whether the stage ends with it.
    pub ends_stage: bool,
    /// How these ratios met their tolerances.
    pub convergence: Convergence,
    /// Shortcuts in the accepted answers, counted by point.
    pub flags: FlagCounts,
    /// Strain per ramp step, and the error of the stresses as far as it is estimated.
    pub accuracy: StepAccuracy,
}

/// How an accepted step met its criteria.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convergence {
    /// Within the tolerances.
    #[default]
    Full,
    /// Iterations had stopped to make progress: within the weaker ones alone, see [`crate::problem::Tolerances::stagnated`].
    Stagnated,
    /// Forces are in balance, and the correction is noise, see [`crate::problem::Tolerances::accept_noise`].
    Noise,
}

/// A failed attempt that is repeated with a smaller step.
#[derive(Clone, Debug, PartialEq)]
pub struct CutBack {
    /// Step being solved.
    pub step: usize,
    /// Load factor that was aimed at.
    pub load: f64,
    /// Size that failed.
    pub from: f64,
    /// Size tried next.
    pub to: f64,
    /// What the attempt took, its stabilisation included.
    pub cost: AttemptCost,
    /// Why.
    pub reason: String,
}

/// What a failed attempt at a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AttemptCost {
    /// Iterations.
    pub iterations: u64,
    /// Point evaluations.
    pub evaluations: u64,
    /// Their force evaluations.
    pub force_evaluations: u64,
}

impl AttemptCost {
    /// What has been taken so far by all attempts.
    pub(crate) fn of(statistics: &Statistics) -> Self {
        Self {
            iterations: statistics.iterations,
            evaluations: statistics.evaluations,
            force_evaluations: statistics.cost.force_evaluations,
        }
    }

    /// What has been taken since `before`.
    pub(crate) fn since(self, before: Self) -> Self {
        Self {
            iterations: self.iterations - before.iterations,
            evaluations: self.evaluations - before.evaluations,
            force_evaluations: self.force_evaluations - before.force_evaluations,
        }
    }
}

/// A step that reached equilibrium by viscous stabilisation, or by iterates that were committed, see [`crate::problem::Stabilisation`].
#[derive(Clone, Debug, PartialEq)]
pub struct Stabilised {
    /// Step.
    pub step: usize,
    /// Load factor.
    pub load: f64,
    /// Increments committed.
    pub increments: usize,
    /// Point evaluations, those of rejected increments included.
    pub evaluations: u64,
    /// What the failed attempt before it took; nothing where iterates were committed instead.
    pub failed: AttemptCost,
    /// Largest out-of-balance force of an intermediate state over reactions and loads.
    pub largest_imbalance: f64,
    /// Viscous work, J, in the plane per metre.
    pub work: f64,
    /// Why the last attempt without it failed or ended.
    pub reason: String,
}

/// How a run ended.
#[derive(Debug)]
pub enum Outcome {
    /// The end of the last stage was reached.
    Completed,
    /// The smallest step did not converge; everything up to the last accepted step is valid.
    DidNotConverge {
        /// Why the last attempt failed.
        reason: String,
    },
    /// An explicit run has lost its stability; everything up to the last report is valid.
    Unstable {
        /// Time step of the stage at which it was seen.
        step: u64,
        /// Time since the stage began, s.
        time: f64,
        /// Size of the time step, s.
        time_step: f64,
        /// What was seen.
        reason: String,
    },
    /// A stop was requested.
    Interrupted,
    /// The workers are gone or the channel to them broke.
    WorkersLost {
        /// What happened.
        reason: String,
    },
    /// An observer could not go on.
    Stopped(StopRequest),
    /// The problem is not solvable as posed; nothing was evaluated.
    Refused(ProblemError),
    /// An engine cannot solve an RVE of the run.
    DefinitionRefused {
        /// Its worker, Gauss point and reason.
        reason: String,
    },
    /// The checkpoint to continue from does not fit the problem; nothing was evaluated.
    CheckpointRefused(CheckpointError),
}

/// A finished run.
#[derive(Debug)]
pub struct Run {
    /// How it ended.
    pub outcome: Outcome,
    /// Stage of the last accepted step, from 0.
    pub stage: usize,
    /// Load factor within its stage of the last accepted step.
    pub load: f64,
    /// Number of the step that was taken last, accepted or not.
    pub step: usize,
    /// Counts and times.
    pub statistics: Statistics,
}

impl Run {
    /// Whether the run ended because it found no equilibrium to start from: step 0 was not accepted.
    pub fn has_no_start(&self) -> bool {
        self.step == 0 && matches!(self.outcome, Outcome::DidNotConverge { .. })
    }
}
