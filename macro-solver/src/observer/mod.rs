//! What a run reports to the outside: events, the state after every accepted step, and final statistics.
//!
//! Outputs, progress bars and logs are [`Observer`]s; they need nothing but what is handed to them here. Counts are
//! deterministic. Times are not, are named `*_nanoseconds`, and must not reach a file that is compared bit by bit.

mod accuracy;
mod energy;
pub mod trial_costs;

pub use accuracy::{AccuracyFigures, BalanceError, StepAccuracy};
pub use energy::EnergyBalance;

use crate::checkpoint::{Archive, CheckpointError};
use crate::mesh::Mesh;
use crate::observer::trial_costs::TrialCosts;
use crate::problem::{Problem, ProblemError, Stage};
use protocol::{Cost, Observed, Scalars, Tensor2, TrialFlags};
use serde::{Deserialize, Serialize};
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
    /// Load factor aimed at, 0 to 1.
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
    /// Share of the stage reached, 0 to 1.
    pub load: f64,
    /// Time since the start of the run, s.
    pub time: f64,
    /// Share of the whole path reached, 0 to 1; every stage counts the same.
    pub share: f64,
    /// Load factor covered by this step.
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
    /// Whether iterations had stopped to make progress, and one of these ratios is above its tolerance, see
    /// [`crate::problem::Tolerances::stagnated`].
    pub stagnated: bool,
    /// Shortcuts in the accepted answers, counted by point.
    pub flags: FlagCounts,
    /// Strain per ramp step, and the error of the stresses as far as it is estimated.
    pub accuracy: StepAccuracy,
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

/// How often each shortcut of [`TrialFlags`] was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlagCounts {
    /// The relaxation ended at its step cap.
    pub not_equilibrated: u64,
    /// The uniform-strain tangent replaced the requested one.
    pub tangent_fallback: u64,
    /// The network tangent needed a diagonal shift.
    pub tangent_regularised: u64,
    /// Overlap above 10 % of a grain.
    pub large_overlap: u64,
    /// No load-bearing contacts.
    #[serde(alias = "fluid")]
    pub no_load_bearing_contacts: u64,
    /// The target was exactly zero.
    pub null_targets: u64,
    /// The relaxation made no headway and went on in another way.
    pub damping_changed: u64,
    /// The event-driven solver answered by a stored linear response.
    #[serde(default)]
    pub elastic_increments: u64,
    /// The event-driven solver answered by new linear responses.
    #[serde(default)]
    pub event_increments: u64,
    /// The event-driven solver handed over to relaxation.
    #[serde(default)]
    pub handed_over: u64,
}

impl FlagCounts {
    /// Counts one answer.
    pub fn add(&mut self, flags: TrialFlags) {
        let counters = [
            (TrialFlags::NOT_EQUILIBRATED, &mut self.not_equilibrated),
            (TrialFlags::TANGENT_FALLBACK, &mut self.tangent_fallback),
            (TrialFlags::TANGENT_REGULARISED, &mut self.tangent_regularised),
            (TrialFlags::LARGE_OVERLAP, &mut self.large_overlap),
            (TrialFlags::NO_LOAD_BEARING_CONTACTS, &mut self.no_load_bearing_contacts),
            (TrialFlags::SKIPPED_NULL_TARGET, &mut self.null_targets),
            (TrialFlags::DAMPING_CHANGED, &mut self.damping_changed),
            (TrialFlags::ELASTIC_INCREMENT, &mut self.elastic_increments),
            (TrialFlags::EVENT_INCREMENT, &mut self.event_increments),
            (TrialFlags::HANDED_OVER, &mut self.handed_over),
        ];
        for (flag, counter) in counters {
            *counter += u64::from(flags.contains(flag));
        }
    }
}

/// State of one Gauss point after an accepted step.
#[derive(Clone, Debug, PartialEq)]
pub struct PointFields {
    /// Element, from 0.
    pub element: usize,
    /// Gauss point of the element, from 0.
    pub local: usize,
    /// Initial position, m.
    pub initial_position: [f64; 3],
    /// Current position, m.
    pub position: [f64; 3],
    /// Current volume of the point (weight times Jacobian), m3; in the plane per metre of thickness.
    pub volume: f64,
    /// Total deformation gradient since the start of the run.
    pub deformation: Tensor2,
    /// Displacement gradient of this step, relative to the configuration at its start (the initial one for small
    /// strain).
    pub step_gradient: Tensor2,
    /// Cauchy stress of the grains (the effective stress where pores hold fluid), Pa, tension positive.
    pub stress: Tensor2,
    /// Excess pressure of pore fluid that cannot drain, Pa, compression positive; the total stress is `stress` minus this on the
    /// diagonal. `None` where pores drain.
    pub pore_pressure: Option<f64>,
    /// Cheap scalars of the accepted answer.
    pub scalars: Scalars,
    /// Optional results of the accepted answer; only what [`Problem::observables`] asked for is meaningful.
    pub observed: Observed,
    /// Shortcuts of the accepted answer.
    pub flags: TrialFlags,
    /// Evaluations of this point in this step, failed attempts included.
    pub step_evaluations: u64,
    /// Evaluations of this point since the start.
    pub evaluations: u64,
    /// Cost of this point's evaluations since the start.
    pub cost: Cost,
    /// Cost of this point's evaluations in this step, failed attempts included.
    pub step_cost: Cost,
}

/// The whole body after an accepted step.
#[derive(Clone, Copy, Debug)]
pub struct FieldsView<'a> {
    /// The mesh as given, with initial positions.
    pub mesh: &'a Mesh,
    /// Displacements since the start, m.
    pub displacements: &'a [[f64; 3]],
    /// Force that supports exert on each node, N, in the plane per metre of thickness; zero at free components.
    pub reactions: &'a [[f64; 3]],
    /// Force of the loads on each node, N, in the plane per metre of thickness.
    pub loads: &'a [[f64; 3]],
    /// Energy of the hourglass control of elements with one point, J, in the plane per metre of thickness.
    pub hourglass_energy: f64,
    /// Energy of pore fluid that cannot drain, J, in the plane per metre of thickness.
    pub fluid_energy: f64,
    /// Motion and energies; `None` in a quasi-static stage.
    pub dynamics: Option<DynamicsView<'a>>,
    /// Gauss points, by [`crate::material::PointId`].
    pub points: &'a [PointFields],
    /// Counts and times so far.
    pub statistics: &'a Statistics,
}

/// Motion of the body at a reported instant.
#[derive(Clone, Copy, Debug)]
pub struct DynamicsView<'a> {
    /// Velocities, m/s.
    pub velocities: &'a [[f64; 3]],
    /// Accelerations, m/s2.
    pub accelerations: &'a [[f64; 3]],
    /// Energies since the stage began.
    pub energy: EnergyBalance,
    /// Time step, s.
    pub time_step: f64,
    /// Bound of the stable time step by the elastic tangents of the elements, s.
    pub stable_step: f64,
    /// Mass added by mass scaling, kg, in the plane per metre of thickness.
    pub added_mass: f64,
    /// Mass of the body, added mass included, kg, in the plane per metre of thickness.
    pub mass: f64,
}

/// Counts and times of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Accepted load steps, without the initial equilibrium, and reports of dynamic stages.
    pub steps: u64,
    /// Time steps of dynamic stages.
    #[serde(default)]
    pub time_steps: u64,
    /// Out-of-balance force of the initial stress over the reactions or loads, whichever is larger.
    pub initial_imbalance: f64,
    /// Largest deviation of the initial stress from what [`crate::problem::InitialState`] expects, over the largest
    /// component expected; 0 if nothing is expected.
    pub initial_deviation: f64,
    /// Largest norm of the reactions or of the loads in an accepted step, N, in the plane per metre: what forces are measured by when
    /// little is left of them.
    pub largest_forces: f64,
    /// Iterations of accepted and failed attempts.
    pub iterations: u64,
    /// Iterates rejected by the globalisation, and rejected increments of viscous stabilisation.
    pub rejected: u64,
    /// Point evaluations of these iterates.
    pub rejected_evaluations: u64,
    /// Point evaluations.
    pub evaluations: u64,
    /// Point evaluations by point.
    pub evaluations_per_point: Vec<u64>,
    /// Point evaluations that were evaluated with a tangent operator.
    pub tangents: u64,
    /// Evaluations saved because a target had not changed in any bit.
    pub skipped: u64,
    /// Force evaluations of the replies that were kept instead.
    pub skipped_force_evaluations: u64,
    /// Evaluations saved because a step did not deform the point.
    pub still_points: u64,
    /// Failed attempts.
    pub cut_backs: u64,
    /// Point evaluations of attempts that were taken back.
    #[serde(default)]
    pub failed_evaluations: u64,
    /// Their force evaluations.
    #[serde(default)]
    pub failed_force_evaluations: u64,
    /// Steps in which nothing changed and the body stayed in balance as it was: not held to the displacement criterion.
    pub idle_steps: u64,
    /// Steps accepted although iterations had stopped to make progress, see [`crate::problem::Tolerances::stagnated_force`].
    pub stagnated_steps: u64,
    /// Largest out-of-balance force ratio of these steps.
    pub largest_stagnated_force_ratio: f64,
    /// Largest mean [level](crate::material::stress_level::stress_level) of the stresses in an accepted step of Newton's method, Pa.
    pub largest_pressure: f64,
    /// Largest out-of-balance force ratio of an accepted step, see [`StepReport::force_ratio`].
    pub largest_force_ratio: f64,
    /// Largest displacement ratio of an accepted step, see [`StepReport::displacement_ratio`].
    pub largest_displacement_ratio: f64,
    /// Steps that reached equilibrium by viscous stabilisation, see [`Stabilised`].
    pub stabilised_steps: u64,
    /// Times that viscous stabilisation found no equilibrium and the body was returned to the state before the step.
    pub stabilisations_taken_back: u64,
    /// Committed increments of viscous stabilisation, none of them in balance but the last of each stabilised step. Like the
    /// evaluations they include attempts that did not reach equilibrium.
    pub stabilisation_increments: u64,
    /// Point evaluations of viscous stabilisation, those of rejected increments included.
    pub stabilisation_evaluations: u64,
    /// Viscous work of stabilised steps, and of the forces out of balance along steps with committed iterates, J, in the plane per metre.
    pub stabilisation_work: f64,
    /// Steps that went on from committed iterates, without viscosity.
    #[serde(default)]
    pub steps_with_committed_iterates: u64,
    /// These iterates, the last of each step not among them.
    #[serde(default)]
    pub committed_iterates: u64,
    /// Secant corrections applied to point tangents.
    pub secant_corrections: u64,
    /// Secant corrections that a gate or the floor rejected.
    pub secant_refusals: u64,
    /// Evaluations whose tangent was stiffened in at least one direction by
    /// [`crate::problem::Strategy::tangent_floor`].
    pub floored_tangents: u64,
    /// Shortcuts, counted over all evaluations.
    pub flags: FlagCounts,
    /// Force evaluations of the answers that the event-driven solver found itself.
    #[serde(default)]
    pub event_driven_force_evaluations: u64,
    /// Evaluations of all points that ended without an answer because grains did not come to rest within their step cap.
    pub unfinished_trials: u64,
    /// Answers whose Cauchy stress was not symmetric: the engine lets couples act on the grains that nothing carries.
    pub asymmetric_stresses: u64,
    /// Sub-steps into which refused trials of single points were divided in dynamic stages.
    pub sub_steps: u64,
    /// Cost of all evaluations, as the engine counted it.
    pub cost: Cost,
    /// How the force evaluations are spread over the trials.
    pub trial_costs: TrialCosts,
    /// Accuracy of the accepted steps.
    pub accuracy: AccuracyFigures,
    /// Symbolic factorizations of the global matrix.
    pub symbolic_factorizations: u64,
    /// Numeric factorizations of the global matrix.
    pub numeric_factorizations: u64,
    /// Iterations of the iterative solver of the global equations since the run was started or continued.
    pub linear_iterations: u64,
    /// Times that the iterative solver failed and the equations were solved directly, since the run was started or
    /// continued.
    pub direct_fallbacks: u64,
    /// Degrees of freedom solved for.
    pub unknowns: usize,
    /// Wall time spent waiting for points, ns.
    pub material_nanoseconds: u64,
    /// Wall time of assembling, ns.
    pub assembly_nanoseconds: u64,
    /// Wall time of factorizing and solving, ns.
    pub linear_solver_nanoseconds: u64,
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
    /// Load factor within its stage of the last accepted step, 0 to 1.
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
