//! Estimated error of the stresses, from replicas: cells that follow some of the Gauss points more accurately.
//!
//! A replica starts in the state of its point and takes every committed deformation of it once more, with twice the ramp steps and
//! half the tolerance. The error of the grain solver falls about in proportion to both, so the difference between the two stresses
//! estimates the error of the point itself, accumulated over the whole path. A replica never changes its point: results are those of
//! a run without it, bit for bit. It costs about two evaluations per committed step, without a tangent.
//!
//! Most replicas follow points that are spread over the body from the first step to the last: only they know the error of a whole path. Some
//! roam: they follow some of the points that strain most, from the state that such a point has when its turn comes, with twice the ramp steps at the
//! point's own tolerance.

mod estimate;
mod roaming;
mod sample;

pub use estimate::ErrorEstimate;
pub use sample::{ErrorEstimateSettings, sample};

use super::stress_level::stress_level;
use super::{MaterialError, PointId, PointMaterial, PointTrial};
use crate::checkpoint::{Archive, CheckpointError};
use crate::formulation::tensor::{matrix, tensor};
use estimate::{ERROR_OF_DIFFERENCE, Finding, Sums, estimate, norm};
use nalgebra::Matrix3;
use protocol::{Observables, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};
use roaming::Strains;
use serde::{Deserialize, Serialize};

/// Increments of one ramp step that a replica follows together, so that small increments cost little.
const MERGED_INCREMENTS: u32 = 8;

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

/// Which Gauss points have replicas.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SamplePlan {
    /// Points that are followed from the start to the end.
    pub fixed: Vec<ReplicaPlan>,
    /// Numbers under which the material keeps the replicas that roam.
    pub roaming: Vec<PointId>,
    /// Points that can have a replica, in ascending order.
    pub points: Vec<PointId>,
}

impl SamplePlan {
    /// Whether there is no replica.
    pub fn is_empty(&self) -> bool {
        self.fixed.is_empty() && self.roaming.is_empty()
    }
}

/// Latest trial of a point.
#[derive(Clone, Copy, Debug)]
struct Latest {
    target: Tensor2,
    ramp_steps: u32,
    friction_reduction: f64,
    stress: Tensor2,
    bears_load: bool,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct State {
    /// The point that is followed.
    point: Option<PointId>,
    /// Estimated error of the point over its pressure when the replica began to follow it.
    before: f64,
    /// Deformation gradient that the replica has not followed yet, by rows.
    pending: [f64; 9],
    pending_ramp_steps: u32,
    pending_increments: u32,
    /// Largest [level](stress_level) of its stress so far, Pa.
    pressure: f64,
    /// Stress of the point minus that of the replica, Pa.
    difference: Option<[f64; 9]>,
    /// Whether the point had load-bearing contacts in the latest committed trial. Cells without any agree, and that says nothing about others.
    bears_load: bool,
    lost: bool,
}

#[derive(Clone, Debug)]
struct Replica {
    /// Number under which the material keeps it.
    number: PointId,
    latest: Option<Latest>,
    state: State,
}

/// Forwards everything to a material and moves the replicas along at every commit.
pub struct ErrorEstimator<'a> {
    material: &'a mut dyn PointMaterial,
    /// Axes that the mean pressure is taken over: 2 for discs, 3 for spheres.
    axes: usize,
    /// Fixed ones first.
    replicas: Vec<Replica>,
    /// So many of the replicas stay with their points.
    fixed: usize,
    /// Points that can have a replica.
    points: Vec<PointId>,
    strains: Strains,
    /// For each Gauss point the place of its replica.
    replica_of: Vec<Option<usize>>,
    estimate: Option<ErrorEstimate>,
    figures: ReplicaFigures,
    /// What a step may return to: states of the replicas, the estimate, strains.
    marked: (Vec<State>, Option<ErrorEstimate>, Strains, u64),
}

impl<'a> ErrorEstimator<'a> {
    /// An estimator over `material`, whose cells have `axes` dimensions.
    pub fn new(material: &'a mut dyn PointMaterial, axes: usize, plan: &SamplePlan) -> Self {
        let points = plan.points.iter().map(|point| point + 1).max().unwrap_or(0);
        let replica = |number, point| Replica { number, latest: None, state: State::starting(point) };
        let fixed = plan.fixed.iter().map(|plan| replica(plan.replica, Some(plan.point)));
        let replicas = fixed.chain(plan.roaming.iter().map(|&number| replica(number, None))).collect();
        // Points and replicas start alike.
        let estimate = (!plan.is_empty()).then(ErrorEstimate::default);
        let mut estimator = Self {
            material,
            axes,
            replicas,
            fixed: plan.fixed.len(),
            points: plan.points.clone(),
            strains: if plan.roaming.is_empty() { Strains::default() } else { Strains::of(points) },
            replica_of: vec![None; points],
            estimate,
            figures: ReplicaFigures::default(),
            marked: Default::default(),
        };
        estimator.find_replicas();
        estimator
    }

    /// Fills [`ErrorEstimator::replica_of`].
    fn find_replicas(&mut self) {
        self.replica_of.fill(None);
        for (place, replica) in self.replicas.iter().enumerate() {
            if let Some(point) = replica.state.point {
                self.replica_of[point] = Some(place);
            }
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
                due.push((place, replica.state.trial(replica.number, latest.friction_reduction), latest.stress));
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
        let strained = self.strains.strained().len();
        let [mut rest, of_strained] = self.parts();
        let points = self.points.len() - strained;
        rest.contains_at_least(self.strains.left_squares(), points);
        self.estimate = estimate([(rest, points), (of_strained, strained)]);
        Ok(())
    }

    /// Lets the roaming replicas follow points that strain most now. After a commit: they begin in the points' committed states.
    fn roam(&mut self) {
        self.strains.commit();
        if self.fixed == self.replicas.len() || !self.strains.is_review_due(&self.points) {
            return;
        }
        let [_, strained_so_far] = self.parts();
        self.strains.review(&self.points);
        // What is not known of a point that joins is taken to be as in its part of the body, or as in the rest before there was one.
        let [rest, strained] = self.parts();
        let part = strained.mean_square().or(strained_so_far.mean_square()).or(rest.mean_square());
        let part = part.unwrap_or(0.0).sqrt();
        let (fixed, roaming) = self.replicas.split_at_mut(self.fixed);
        for replica in roaming.iter() {
            if let Some(point) = replica.state.point.filter(|_| replica.state.lost) {
                self.strains.refuse(point);
            }
        }
        let has_fixed = |point| fixed.iter().any(|replica| replica.state.point == Some(point) && !replica.state.lost);
        let followed = roaming.iter().map(|replica| replica.state.point.filter(|_| !replica.state.lost));
        let placed = self.strains.placed(has_fixed, followed);
        for (replica, point) in roaming.iter_mut().zip(placed) {
            if point == replica.state.point && !replica.state.lost {
                continue;
            }
            if let (Some(point), Some(error)) = (replica.state.point, replica.state.relative()) {
                self.strains.leave(point, error);
            }
            (replica.state, replica.latest) = (State::starting(point), None);
            if let Some(point) = point {
                self.material.copy_state(point, replica.number);
                replica.state.before = part.max(self.strains.left(point));
                replica.state.pressure = self.strains.level(point);
            }
        }
        self.find_replicas();
    }

    /// What replicas have found in the rest of the body and in its strained part.
    fn parts(&self) -> [Sums; 2] {
        let is_strained = |state: &&State| state.point.is_some_and(|point| self.strains.is_strained(point));
        let states = || self.replicas.iter().map(|replica| &replica.state);
        let part = |strained: bool| {
            Sums::over(states().filter(|state| is_strained(state) == strained).filter_map(State::finding))
        };
        [part(false), part(true)]
    }
}

impl State {
    /// Of a replica that begins to follow a point.
    fn starting(point: Option<PointId>) -> Self {
        Self {
            point,
            before: 0.0,
            pending: flat(&Matrix3::identity()),
            pending_ramp_steps: 0,
            pending_increments: 0,
            pressure: 0.0,
            difference: None,
            bears_load: true,
            lost: false,
        }
    }

    fn take_up(&mut self, latest: &Latest, axes: usize) {
        let deformation = Matrix3::identity() + matrix(&latest.target);
        self.pending = flat(&(deformation * Matrix3::from_row_slice(&self.pending)));
        self.pending_ramp_steps = self.pending_ramp_steps.saturating_add(latest.ramp_steps);
        self.pending_increments += 1;
        self.bears_load = latest.bears_load;
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

    /// Estimated error over the pressure: by the difference from the point, or what the point had when the replica joined it. `None` of a
    /// replica that has nothing to tell, or whose point has borne no stress.
    fn relative(&self) -> Option<f64> {
        if self.lost || self.pressure <= 0.0 || (self.difference.is_none() && self.before == 0.0) {
            return None;
        }
        let since = self.difference.map_or(0.0, |difference| norm(&difference));
        Some(self.before.hypot(ERROR_OF_DIFFERENCE * since / self.pressure))
    }

    /// What the replica tells about its point, if anything.
    fn finding(&self) -> Option<Finding> {
        let relative = self.relative().filter(|_| self.bears_load)?;
        Some(Finding { relative, pressure: self.pressure, difference: self.difference })
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

impl PointMaterial for ErrorEstimator<'_> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let results = self.material.evaluate(trials)?;
        for (trial, result) in trials.iter().zip(&results) {
            let level = || stress_level(self.axes, &matrix(&result.stress));
            self.strains.trial(trial.point, &trial.target, level);
            if let Some(place) = self.replica_of.get(trial.point).copied().flatten() {
                let TrialOptions { ramp_steps, friction_reduction, .. } = trial.options;
                let (target, stress) = (trial.target, result.stress);
                let bears_load = !result.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS);
                self.replicas[place].latest =
                    Some(Latest { target, ramp_steps, friction_reduction, stress, bears_load });
            }
        }
        Ok(results)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.follow()?;
        self.material.commit()?;
        self.roam();
        Ok(())
    }

    fn rollback(&mut self) {
        self.replicas.iter_mut().for_each(|replica| replica.latest = None);
        self.strains.rollback();
        self.material.rollback();
    }

    fn mark(&mut self) {
        let states = self.replicas.iter().map(|replica| replica.state.clone()).collect();
        self.marked = (states, self.estimate, self.strains.clone(), self.figures.lost);
        self.material.mark();
    }

    fn return_to_mark(&mut self) {
        let (states, estimate, strains, lost) = &self.marked;
        // Those lost since then follow their points again.
        self.figures.lost = *lost;
        for (replica, state) in self.replicas.iter_mut().zip(states) {
            (replica.state, replica.latest) = (state.clone(), None);
        }
        self.estimate = *estimate;
        self.strains.clone_from(strains);
        self.strains.rollback();
        self.find_replicas();
        self.material.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.material.copy_state(from, to);
    }

    fn error_estimate(&self) -> Option<ErrorEstimate> {
        self.estimate
    }

    fn save(&self, archive: &mut Archive) {
        let states: Vec<&State> = self.replicas.iter().map(|replica| &replica.state).collect();
        archive.put(SECTION, VERSION, &(states, self.estimate, self.figures, self.strains.kept()));
        self.material.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let (states, estimate, figures, kept): (Vec<State>, _, _, _) = archive.get(SECTION, VERSION)?;
        if states.len() != self.replicas.len() || !self.strains.restore(kept) {
            return Err(CheckpointError::unfit(SECTION, "it holds another number of replicas"));
        }
        if states.iter().filter_map(|state| state.point).any(|point| point >= self.replica_of.len()) {
            return Err(CheckpointError::unfit(SECTION, "a replica follows no point of this run"));
        }
        for (replica, state) in self.replicas.iter_mut().zip(states) {
            (replica.state, replica.latest) = (state, None);
        }
        (self.estimate, self.figures) = (estimate, figures);
        self.find_replicas();
        self.material.restore(archive)
    }
}

const SECTION: &str = "error estimate";

/// Counts changes of what [`ErrorEstimator`] saves.
const VERSION: u32 = 4;

#[cfg(test)]
mod tests;
