//! Estimated error of the stresses, from replicas: cells that follow some of the Gauss points more accurately.
//!
//! A replica starts in the state of its point and takes every committed deformation of it once more, with twice the ramp steps and
//! half the tolerance. The error of the grain solver falls about in proportion to both, so the difference between the two stresses
//! estimates the error of the point itself, accumulated over the whole path. A replica never changes its point: results are those of
//! a run without it, bit for bit. It costs about two evaluations per committed step, without a tangent.

mod sample;

pub use sample::{ErrorEstimateSettings, replicas};

use super::stress_level::stress_level;
use super::{MaterialError, PointId, PointMaterial, PointTrial};
use crate::checkpoint::{Archive, CheckpointError};
use crate::formulation::tensor::{matrix, tensor};
use nalgebra::Matrix3;
use protocol::{Observables, TangentKind, Tensor2, TrialOptions, TrialResult};
use serde::{Deserialize, Serialize};

/// True error over the difference between a point and its replica: between the 1 of errors that are independent of each other and the
/// 2 of errors in proportion to the strain per step. Measured in docs/lab-book/error-estimate.md.
const ERROR_OF_DIFFERENCE: f64 = 1.5;

/// Increments of one ramp step that a replica follows together, so that small increments cost little.
const MERGED_INCREMENTS: u32 = 8;

/// Estimated error over all replicas, after a commit. Relative to the mean pressure of a point (the [level](stress_level) of its stress):
/// the largest it has had so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// Points compared with their replicas; 0 before anything has been committed.
    pub points: u64,
    /// Root mean square of the estimated stress errors (Frobenius norm) over the pressure.
    pub rms: f64,
    /// Largest of them.
    pub largest: f64,
    /// Norm of their mean over the mean pressure: what is left in averages over the body.
    pub of_mean: f64,
}

/// What the replicas have cost and found so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReplicaFigures {
    /// Trials solved.
    pub evaluations: u64,
    /// Their force evaluations.
    pub force_evaluations: u64,
    /// Replicas given up because a trial was refused.
    pub lost: u64,
}

/// A Gauss point and its replica, which the material keeps as another point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplicaPlan {
    /// Gauss point.
    pub point: PointId,
    /// Number under which the material keeps the replica.
    pub replica: PointId,
}

/// Latest trial of a point.
#[derive(Clone, Copy, Debug)]
struct Latest {
    target: Tensor2,
    ramp_steps: u32,
    friction_reduction: f64,
    stress: Tensor2,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct State {
    /// Deformation gradient that the replica has not followed yet, by rows.
    pending: [f64; 9],
    pending_ramp_steps: u32,
    pending_increments: u32,
    /// Largest [level](stress_level) of its stress so far, Pa.
    pressure: f64,
    /// Stress of the point minus that of the replica, Pa.
    difference: Option<[f64; 9]>,
    lost: bool,
}

#[derive(Clone, Debug)]
struct Replica {
    plan: ReplicaPlan,
    latest: Option<Latest>,
    state: State,
}

/// Forwards everything to a material and moves the replicas along at every commit.
pub struct ErrorEstimator<'a> {
    material: &'a mut dyn PointMaterial,
    /// Axes that the mean pressure is taken over: 2 for discs, 3 for spheres.
    axes: usize,
    replicas: Vec<Replica>,
    /// For each Gauss point the place of its replica.
    replica_of: Vec<Option<usize>>,
    estimate: Option<ErrorEstimate>,
    figures: ReplicaFigures,
    /// States of the replicas and the estimate that a step may return to.
    marked: (Vec<State>, Option<ErrorEstimate>),
}

impl<'a> ErrorEstimator<'a> {
    /// An estimator over `material`, whose cells have `axes` dimensions.
    pub fn new(material: &'a mut dyn PointMaterial, axes: usize, plans: &[ReplicaPlan]) -> Self {
        let points = plans.iter().map(|plan| plan.point + 1).max().unwrap_or(0);
        let mut replica_of = vec![None; points];
        for (place, plan) in plans.iter().enumerate() {
            replica_of[plan.point] = Some(place);
        }
        let replicas = plans.iter().map(|&plan| Replica { plan, latest: None, state: State::new() }).collect();
        // Points and replicas start alike.
        let estimate = (!plans.is_empty()).then(ErrorEstimate::default);
        Self {
            material,
            axes,
            replicas,
            replica_of,
            estimate,
            figures: ReplicaFigures::default(),
            marked: Default::default(),
        }
    }

    /// What the replicas have cost so far.
    pub fn figures(&self) -> ReplicaFigures {
        self.figures
    }

    /// Takes up the trials that are about to be committed; the replicas that follow now, with their trials and the stresses to
    /// compare with.
    fn due(&mut self) -> Vec<(usize, PointTrial, Tensor2)> {
        let axes = self.axes;
        let mut due = Vec::new();
        for (place, replica) in self.replicas.iter_mut().enumerate() {
            let Some(latest) = replica.latest.take().filter(|_| !replica.state.lost) else { continue };
            replica.state.take_up(&latest, axes);
            if latest.ramp_steps > 1 || replica.state.pending_increments >= MERGED_INCREMENTS {
                due.push((
                    place,
                    replica.state.trial(replica.plan.replica, latest.friction_reduction),
                    latest.stress,
                ));
            }
        }
        due
    }

    /// Solves the replicas' trials, one by one if any of them is refused.
    ///
    /// # Errors
    /// Those that end a run; a refused trial only ends its replica.
    fn solve(&mut self, trials: &[PointTrial]) -> Result<Vec<Option<TrialResult>>, MaterialError> {
        match self.material.evaluate(trials) {
            Ok(results) => return Ok(results.into_iter().map(Some).collect()),
            Err(MaterialError::Point { .. }) => {}
            Err(error) => return Err(error),
        }
        let mut results = Vec::with_capacity(trials.len());
        for trial in trials {
            match self.material.evaluate(std::slice::from_ref(trial)) {
                Ok(mut found) => results.push(found.pop()),
                Err(MaterialError::Point { .. }) => results.push(None),
                Err(error) => return Err(error),
            }
        }
        Ok(results)
    }

    fn follow(&mut self) -> Result<(), MaterialError> {
        let due = self.due();
        if due.is_empty() {
            return Ok(());
        }
        let trials: Vec<PointTrial> = due.iter().map(|(_, trial, _)| *trial).collect();
        let results = self.solve(&trials)?;
        for ((place, _, stress), result) in due.into_iter().zip(results) {
            let state = &mut self.replicas[place].state;
            let Some(result) = result else {
                state.lost = true;
                state.difference = None;
                self.figures.lost += 1;
                continue;
            };
            state.followed(std::array::from_fn(|k| stress.0[k] - result.stress.0[k]));
            self.figures.evaluations += 1;
            self.figures.force_evaluations += result.cost.force_evaluations;
        }
        self.estimate = estimate(self.replicas.iter().map(|replica| &replica.state));
        Ok(())
    }
}

impl State {
    fn new() -> Self {
        Self {
            pending: flat(&Matrix3::identity()),
            pending_ramp_steps: 0,
            pending_increments: 0,
            pressure: 0.0,
            difference: None,
            lost: false,
        }
    }

    fn take_up(&mut self, latest: &Latest, axes: usize) {
        let deformation = Matrix3::identity() + matrix(&latest.target);
        self.pending = flat(&(deformation * Matrix3::from_row_slice(&self.pending)));
        self.pending_ramp_steps = self.pending_ramp_steps.saturating_add(latest.ramp_steps);
        self.pending_increments += 1;
        self.pressure = self.pressure.max(stress_level(axes, &matrix(&latest.stress)));
    }

    /// The pending deformation with twice the ramp steps.
    fn trial(&self, replica: PointId, friction_reduction: f64) -> PointTrial {
        let options = TrialOptions {
            friction_reduction,
            tangent: TangentKind::None,
            observables: Observables::NONE,
            ramp_steps: self.pending_ramp_steps.saturating_mul(2),
        };
        let target = tensor(&(Matrix3::from_row_slice(&self.pending) - Matrix3::identity()));
        PointTrial { point: replica, target, options }
    }

    fn followed(&mut self, difference: [f64; 9]) {
        self.pending = flat(&Matrix3::identity());
        (self.pending_ramp_steps, self.pending_increments) = (0, 0);
        self.difference = Some(difference);
    }
}

/// Entries by rows.
fn flat(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| matrix[(k / 3, k % 3)])
}

/// The estimate over all replicas that have been compared with a point under stress; `None` without any.
fn estimate<'s>(states: impl Iterator<Item = &'s State>) -> Option<ErrorEstimate> {
    let (mut points, mut squares, mut largest, mut pressures, mut sum) = (0_u64, 0.0, 0.0_f64, 0.0, [0.0; 9]);
    for state in states {
        let Some(difference) = state.difference.filter(|_| state.pressure > 0.0) else { continue };
        let relative = norm(&difference) / state.pressure;
        points += 1;
        squares += relative * relative;
        largest = largest.max(relative);
        pressures += state.pressure;
        sum.iter_mut().zip(difference).for_each(|(sum, component)| *sum += component);
    }
    (points > 0).then(|| ErrorEstimate {
        points,
        rms: ERROR_OF_DIFFERENCE * (squares / points as f64).sqrt(),
        largest: ERROR_OF_DIFFERENCE * largest,
        of_mean: ERROR_OF_DIFFERENCE * norm(&sum) / pressures,
    })
}

fn norm(components: &[f64; 9]) -> f64 {
    components.iter().map(|component| component * component).sum::<f64>().sqrt()
}

impl PointMaterial for ErrorEstimator<'_> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let results = self.material.evaluate(trials)?;
        for (trial, result) in trials.iter().zip(&results) {
            if let Some(place) = self.replica_of.get(trial.point).copied().flatten() {
                let TrialOptions { ramp_steps, friction_reduction, .. } = trial.options;
                let (target, stress) = (trial.target, result.stress);
                self.replicas[place].latest = Some(Latest { target, ramp_steps, friction_reduction, stress });
            }
        }
        Ok(results)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.follow()?;
        self.material.commit()
    }

    fn rollback(&mut self) {
        self.replicas.iter_mut().for_each(|replica| replica.latest = None);
        self.material.rollback();
    }

    fn mark(&mut self) {
        self.marked = (self.replicas.iter().map(|replica| replica.state.clone()).collect(), self.estimate);
        self.material.mark();
    }

    fn return_to_mark(&mut self) {
        let (states, estimate) = &self.marked;
        for (replica, state) in self.replicas.iter_mut().zip(states) {
            (replica.state, replica.latest) = (state.clone(), None);
        }
        self.estimate = *estimate;
        self.material.return_to_mark();
    }

    fn error_estimate(&self) -> Option<ErrorEstimate> {
        self.estimate
    }

    fn save(&self, archive: &mut Archive) {
        let states: Vec<&State> = self.replicas.iter().map(|replica| &replica.state).collect();
        archive.put(SECTION, VERSION, &(states, self.estimate, self.figures));
        self.material.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let (states, estimate, figures): (Vec<State>, _, _) = archive.get(SECTION, VERSION)?;
        if states.len() != self.replicas.len() {
            return Err(CheckpointError::unfit(SECTION, "it holds another number of replicas"));
        }
        for (replica, state) in self.replicas.iter_mut().zip(states) {
            (replica.state, replica.latest) = (state, None);
        }
        (self.estimate, self.figures) = (estimate, figures);
        self.material.restore(archive)
    }
}

const SECTION: &str = "error estimate";

/// Counts changes of what [`ErrorEstimator`] saves.
const VERSION: u32 = 1;

#[cfg(test)]
mod tests;
