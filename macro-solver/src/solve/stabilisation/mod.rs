//! Viscous stabilisation: where no equilibrium lies near the committed state, the body moves to one further on.
//!
//! When grains rearrange suddenly, the stress of a point jumps, and Newton's method finds no equilibrium near the committed
//! state. Then the body follows the viscous motion `C du/dt = -R(u)`, where `C` is its first stiffness, taken as isotropic.
//! Supports and loads move to the end of the step as fast as no point is strained by more than the cap in one increment, and
//! stay there; they also stay while the linear answer of the body at fixed supports and loads strains some point by more than
//! half the cap. Increments are linearly implicit (`(K + viscosity C) du = -R`), each evaluated once and **committed** though it
//! is not in balance, because the material depends on its history: a restart from the old state would meet the same jump again.
//! The viscosity falls with the out-of-balance force and rises when that changes direction, so that the last increments are
//! Newton's. The state that is accepted in the end fulfils the criteria of every other step, without viscosity. If there is none,
//! the body is returned to the state before the step, which is cut back to its smallest size before it is stabilised once more.
//! A step that goes on from a [committed iterate](committed_iterates) takes the same path from there, at first without viscosity.

mod committed_iterates;
mod increments;
mod limits;
mod noise;
mod path;

use super::accepted::{Converged, Counters, Followed};
use super::driver::{Session, Solver};
use super::linear_solver::LinearSolverError;
use super::newton::tangent_update::TangentUpdater;
use super::procedure::LoadStepMethod;
use super::step_ends::is_smallest;
use super::vectors::{dot, norm};
use crate::material::MaterialError;
use crate::model::assembly::balance::Balance;
use crate::model::body::Body;
use crate::model::failure::{Failure, failure};
use crate::model::points::Points;
use crate::observer::{AttemptCost, Convergence, Outcome, Stabilised as Event};
use crate::problem::{Stabilisation, Tolerances};
use increments::Trial;
use limits::{MOST_WITHOUT_GAIN, PathLimits};
use noise::CorrectionNoise;
use path::StabilisedPath;

/// Growth of the out-of-balance force at which an increment is rejected and made smaller.
const LARGEST_GROWTH: f64 = 2.0;

/// Times that increments are rejected before the out-of-balance force has fallen: a jump of the material does not get smaller with the
/// increment, and increments that end before it only postpone it.
const MAX_REJECTIONS: usize = 3;

/// An increment in which supports and loads cover less than this share of the step counts as one at fixed loads.
const LEAST_ADVANCE: f64 = 1e-3;

/// Motion of the supports in a step, over the smallest extent of the body, up to which a failed step is stabilised before it is cut back: a
/// longer one takes many increments, and smaller steps may need none.
const LARGEST_MOTION: f64 = 0.02;

/// The same below which it is rounding: displacements are sums of increments.
const ROUNDED_MOTION: f64 = 1e-12;

/// Share of the out-of-balance force that an increment has to leave at most if the path is to go on towards the tolerances from a state
/// that is good enough for a step without progress.
const LARGEST_PROGRESS: f64 = 0.5;

/// A state that a path may end at, with what its evaluation has left: the next increment may have to be dropped.
struct Acceptable {
    end: Converged,
    points: Points,
    tangents: TangentUpdater,
}

/// A balanced state at the end of the loads.
struct Reached {
    /// Size of the correction that it would still get, as the displacement criterion measures it.
    correction: f64,
    /// Whether that is noise.
    is_noise: bool,
    /// The end of the path, if the state meets the tolerances or its correction is noise.
    end: Option<Converged>,
}

/// The state before a stabilised step. The material keeps its own.
struct StateBefore {
    body: Body,
    points: Points,
    committed_balance: Balance,
    stabilisation_work: f64,
}

impl Solver<'_> {
    /// Whether a step that has failed `failed` times, last with the size `from`, is to be stabilised now. Where a larger step has
    /// been stabilised in vain, or the supports move far in this one, smaller ones are tried without it first, unless this is the last
    /// attempt.
    pub(super) fn stabilises(
        &self,
        method: &dyn LoadStepMethod,
        failed: usize,
        from: f64,
        is_last: bool,
    ) -> Option<Stabilisation> {
        let control = &self.stage().control;
        let is_soon = |settings: &Stabilisation| {
            settings.after.is_some_and(|after| after > 0 && failed >= after)
                && self.stabilised_in_vain.is_none()
                && self.motion_of_supports(self.stage_fraction + from) <= LARGEST_MOTION
        };
        control
            .stabilisation
            .filter(|settings| is_last || is_soon(settings))
            .filter(|_| self.path_constraint.is_none() && method.can_be_stabilised())
    }

    /// Largest relative motion of two prescribed displacements along an axis on the way to the share `to` of the path, over the smallest
    /// extent of the body.
    fn motion_of_supports(&self, to: f64) -> f64 {
        let axes = self.body.mesh().dimension.count();
        let (moment, displacements) = (self.moment(to), &self.body.displacements);
        let given = |dof: usize| Some(self.constraints.prescribed(dof, moment)? - displacements[dof]);
        let range = |values: &mut dyn Iterator<Item = f64>| {
            let [least, most] = values
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| [least.min(value), most.max(value)]);
            most - least
        };
        let along = |axis: usize| (axis..displacements.len()).step_by(axes).filter_map(given);
        let motion = (0..axes).map(|axis| range(&mut along(axis))).fold(0.0, f64::max);
        let nodes = &self.body.mesh().nodes;
        let extents = (0..axes).map(|axis| range(&mut nodes.iter().map(|node| node[axis])));
        motion / extents.fold(f64::INFINITY, f64::min)
    }

    /// Takes a step to the share `target` of the path by viscous stabilisation, after attempts of which the last failed for
    /// `reason` and took `failed`; `before` are the counters of the step with these attempts.
    pub(super) fn stabilise(
        &mut self,
        settings: Stabilisation,
        target: f64,
        reason: &str,
        failed: AttemptCost,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<Followed, Outcome> {
        let state = self.state_before(session);
        let mut path = self.stabilised_path(settings.viscosity, target, reason.to_owned());
        path.event.failed = failed;
        self.take_path(path, state, settings, target, before, session)
    }

    /// Follows a path that begins at the committed state, which is not that of `state` after a committed iterate, and accepts its end or
    /// returns to `state`.
    fn take_path(
        &mut self,
        mut path: StabilisedPath,
        state: StateBefore,
        settings: Stabilisation,
        target: f64,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<Followed, Outcome> {
        // Viscous forces are no part of the pairs that quasi-Newton updates are made of.
        let mut memory = self.memory.take();
        let followed = self.follow(&mut path, settings, target, session);
        if let Some(memory) = &mut memory {
            memory.begin_attempt(true);
        }
        self.memory = memory;
        let converged = match followed {
            Ok(converged) => converged,
            Err(failure) => {
                self.count_stabilisation(&path.event);
                let Failure::Attempt(lost) = failure else { return Err(failure.into_outcome()) };
                self.return_to(state, target, session);
                return Ok(Followed::TakenBack(format!("{}; stabilised: {lost}", path.event.reason)));
            }
        };
        let increments = path.event.increments;
        let before = if path.is_viscous {
            self.statistics.stabilised_steps += 1;
            self.count_stabilisation(&path.event);
            session.observer.stabilised(&path.event);
            Counters { stabilisation_increments: increments, ..*before }
        } else {
            self.statistics.steps_with_committed_iterates += 1;
            self.statistics.committed_iterates += increments as u64;
            session.observer.iterates_committed(&path.event);
            Counters { committed_iterates: increments, ..*before }
        };
        self.accept(&converged, target, &path.gradients, &before, session)?;
        Ok(Followed::Accepted(converged.iterations))
    }

    /// Counts what a path has cost that needed viscosity, or that led nowhere.
    fn count_stabilisation(&mut self, path: &Event) {
        self.statistics.stabilisation_increments += path.increments as u64;
        self.statistics.stabilisation_evaluations += path.evaluations;
    }

    /// Keeps the committed state, of the material too.
    fn state_before(&self, session: &mut Session<'_>) -> StateBefore {
        session.material.mark();
        StateBefore {
            body: self.body.clone(),
            points: self.points.clone(),
            committed_balance: self.committed_balance.clone(),
            stabilisation_work: self.statistics.stabilisation_work,
        }
    }

    /// Takes a stabilised step to the share `target` of the path back. What it has cost stays counted.
    fn return_to(&mut self, before: StateBefore, target: f64, session: &mut Session<'_>) {
        session.material.return_to_mark();
        self.points.return_to(before.points);
        (self.body, self.committed_balance) = (before.body, before.committed_balance);
        self.statistics.stabilisation_work = before.stabilisation_work;
        self.statistics.stabilisations_taken_back += 1;
        self.stabilised_in_vain = Some(self.stabilised_in_vain.map_or(target, |before| before.max(target)));
        // Factors of a viscous body predict nothing.
        let strategy = &self.stage().strategy;
        self.tangents = TangentUpdater::new(strategy.tangent_update, strategy.secant.is_some());
    }

    /// A path that begins at the committed state, for a step that takes it for `reason`.
    fn stabilised_path(&self, viscosity: f64, target: f64, reason: String) -> StabilisedPath {
        let event = Event {
            step: self.step,
            load: target,
            increments: 0,
            evaluations: 0,
            failed: AttemptCost::default(),
            largest_imbalance: 0.0,
            work: 0.0,
            reason,
        };
        let mut path =
            StabilisedPath::new(&self.body, self.points.all().len(), viscosity, self.stage_fraction, event);
        let stage = self.stage();
        if !is_smallest(target - self.stage_fraction, stage.control.min) && !stage.changes_nothing() {
            path.most_without_gain = Some(MOST_WITHOUT_GAIN);
        }
        path
    }

    /// Follows the path to a balanced state at the share `target` of the stage's path, which is settled then. Increments are
    /// committed and counted one by one, also if no balanced state is found.
    fn follow(
        &mut self,
        path: &mut StabilisedPath,
        settings: Stabilisation,
        target: f64,
        session: &mut Session<'_>,
    ) -> Result<Converged, Failure> {
        let supports_rest = self.motion_of_supports(target) < ROUNDED_MOTION;
        // The number of increments in which loads move follows from the cap; those at fixed loads are limited.
        let mut limits = PathLimits::new(settings.most_increments, path.most_without_gain, supports_rest);
        let least_advance = LEAST_ADVANCE * (target - self.stage_fraction);
        // Of a committed iterate that the path begins with.
        let mut before = path.event.largest_imbalance;
        let (mut last, mut acceptable, mut noise) = (String::new(), None::<Acceptable>, CorrectionNoise::new());
        let mut iteration = path.iterations;
        loop {
            iteration += 1;
            let held = match (limits.reached(path.mean_gradient()), acceptable.take()) {
                (Some(_), Some(held)) => return Ok(held.end),
                (Some(reason), None) => return Err(Failure::Attempt(format!("{reason}: {last}"))),
                (None, held) => held,
            };
            if held.is_none() {
                path.limit_plain_increments();
            }
            self.statistics.iterations += 1;
            let from = path.stage_fraction;
            let tried = self.try_increment(path, target, iteration, held.is_some(), session);
            let force_ratio = match (tried, held) {
                (Ok(_), Some(held)) if path.backtracks > 0 => return Ok(self.end_at(held, iteration)),
                (Err(Failure::Attempt(_)), Some(held)) => return Ok(self.end_at(held, iteration)),
                (tried, _) => tried?,
            };
            let mut progresses = false;
            if path.backtracks == 0 {
                progresses = force_ratio <= LARGEST_PROGRESS * std::mem::replace(&mut before, force_ratio);
            }
            let is_fixed = path.stage_fraction >= target || path.stage_fraction - from < least_advance;
            limits.add(is_fixed, force_ratio);
            last = format!("out-of-balance {force_ratio:.2e}");
            if path.stage_fraction < target {
                continue;
            }
            let tolerances = self.stage().tolerances.stagnated();
            if path.backtracks > 0 || (force_ratio > tolerances.force && tolerances.criteria.force.is_some()) {
                noise = CorrectionNoise::new();
                continue;
            }
            let reached = match self.reached(path, target, iteration, force_ratio, &mut noise) {
                Ok(reached) => reached,
                Err(error) => {
                    last = error.to_string();
                    continue;
                }
            };
            if let Some(end) = reached.end {
                if reached.is_noise || end.convergence == Convergence::Full || !progresses {
                    return Ok(end);
                }
                acceptable = Some(Acceptable { end, points: self.points.clone(), tangents: self.tangents.clone() });
            }
            last = format!("{last}, correction {:.2e}", reached.correction);
            // Newton's method from here: factors on increments belong to viscous ones.
            (path.viscosity, path.step_factor) = (0.0, 1.0);
        }
    }

    /// What the committed state at the end of the loads is to a path. It begins where iterations have stagnated, and may end where such steps
    /// end.
    fn reached(
        &mut self,
        path: &StabilisedPath,
        target: f64,
        iteration: usize,
        force_ratio: f64,
        noise: &mut CorrectionNoise,
    ) -> Result<Reached, LinearSolverError> {
        let (strict, weak) = (self.stage().tolerances, self.stage().tolerances.stagnated());
        // Without viscosity: the correction of Newton's method.
        let correction = self.newton_correction()?;
        let full_step = self.full_step(target);
        let measures = self.convergence_measures(force_ratio, &path.increment, &correction, full_step);
        // Smaller steps have more of it.
        let is_noise = weak.accept_noise() && noise.is_noise(&correction, measures.displacement);
        let meets = |tolerances: &Tolerances| tolerances.excess(&measures).iter().all(|excess| *excess <= 1.0);
        let convergence = match (meets(&strict), meets(&weak)) {
            (true, _) => Some(Convergence::Full),
            (false, true) => Some(Convergence::Stagnated),
            (false, false) => is_noise.then_some(Convergence::Noise),
        };
        let end = convergence.map(|convergence| Converged {
            increment: path.increment.clone(),
            load: target,
            iterations: iteration,
            force_ratio: measures.force,
            displacement_ratio: measures.displacement,
            correction: Some(correction),
            convergence,
        });
        Ok(Reached { correction: measures.displacement, is_noise, end })
    }

    /// Ends a path where an increment began that has been dropped.
    fn end_at(&mut self, held: Acceptable, iteration: usize) -> Converged {
        let Acceptable { end, points, tangents } = held;
        self.points.return_to(points);
        self.tangents = tangents;
        self.balance = self.committed_balance.clone();
        Converged { iterations: iteration, ..end }
    }

    /// One increment; the out-of-balance ratio after it. It has been rejected if the path has backtracks then, as any without gain that
    /// `has_to_gain`.
    fn try_increment(
        &mut self,
        path: &mut StabilisedPath,
        target: f64,
        iteration: usize,
        has_to_gain: bool,
        session: &mut Session<'_>,
    ) -> Result<f64, Failure> {
        let trial = self.viscous_increment(path, target).map_err(failed)?;
        self.tangents.begin_attempt(true);
        let predicted = self.body.gradients(&trial.increment);
        self.points.begin_attempt(&predicted);
        let mut report = self.blank_report(target, iteration);
        let norms = match self.evaluate(&trial.increment, trial.to, session) {
            Err(Failure::Attempt(reason)) => {
                self.reject(report, session);
                if path.backtracks >= MAX_REJECTIONS {
                    return Err(Failure::Attempt(reason));
                }
                self.drop_trial(path, session);
                return Ok(f64::INFINITY);
            }
            other => other?,
        };
        path.event.evaluations += norms.evaluations;
        let after = self.constraints.restrict(&self.balance.residual());
        let growth = norm(&after) / norm(&trial.residual);
        let tolerances = &self.stage().tolerances;
        let force_ratio = norms.force_ratio(tolerances);
        (report.evaluations, report.force_ratio) = (norms.evaluations, force_ratio);
        let goes_too_far =
            growth > LARGEST_GROWTH && force_ratio > tolerances.force && path.rejections < MAX_REJECTIONS;
        if goes_too_far || (has_to_gain && growth >= 1.0) {
            self.reject(report, session);
            self.drop_trial(path, session);
            return Ok(force_ratio);
        }
        session.observer.iterated(&report);
        self.commit_increment(path, &trial, &after, growth, session)?;
        path.event.largest_imbalance = path.event.largest_imbalance.max(force_ratio);
        Ok(force_ratio)
    }

    /// Commits an increment that left the out-of-balance force `after` along the unknowns, `growth` times that before it.
    fn commit_increment(
        &mut self,
        path: &mut StabilisedPath,
        trial: &Trial,
        after: &[f64],
        growth: f64,
        session: &mut Session<'_>,
    ) -> Result<(), Failure> {
        let loads_moved = trial.to > path.stage_fraction;
        self.commit_part(path, &trial.increment, trial.to, after, session).map_err(failure)?;
        path.is_viscous |= path.viscosity > 0.0;
        path.adapt(growth, dot(&trial.residual, after) < 0.0, loads_moved);
        path.event.increments += 1;
        Ok(())
    }

    /// Commits a part of a path, at the end of which supports and loads are at the share `to` and the out-of-balance force along the
    /// unknowns is `after`.
    fn commit_part(
        &mut self,
        path: &mut StabilisedPath,
        increment: &[f64],
        to: f64,
        after: &[f64],
        session: &mut Session<'_>,
    ) -> Result<(), MaterialError> {
        session.material.commit()?;
        let along = self.constraints.select(increment);
        // The part that supports and loads add does no viscous work.
        let at_its_begin = dot(&self.constraints.restrict(&self.committed_balance.residual()), &along);
        let work = -0.5 * (at_its_begin + dot(after, &along));
        let gradients = self.settle(increment);
        path.stage_fraction = to;
        path.add(increment, &gradients, self.body.formulation());
        path.event.work += work;
        self.statistics.stabilisation_work += work;
        Ok(())
    }

    /// Drops an increment that went too far.
    fn drop_trial(&mut self, path: &mut StabilisedPath, session: &mut Session<'_>) {
        session.material.rollback();
        self.points.forget_trials();
        self.points.forget_corrections();
        path.backtrack();
    }

    /// Newton's correction of the committed state.
    fn newton_correction(&mut self) -> Result<Vec<f64>, LinearSolverError> {
        self.factorize()?;
        let residual = self.constraints.restrict(&self.balance.residual());
        self.solve_linear(&residual.iter().map(|value| -value).collect::<Vec<f64>>())
    }
}

fn failed(error: LinearSolverError) -> Failure {
    Failure::Attempt(error.to_string())
}
