//! The driver of a run: stage after stage, step after step, whatever the procedure.
//!
//! A load step starts from the last committed configuration and requests from every Gauss point the stress at the total
//! displacement gradient of the step; points that a step does not deform, or whose target is that of their latest answer, are not
//! asked. Every evaluation restarts from the committed state, so the accepted state does not depend on the iterations that led to
//! it, except through the choice of the ramp. What iterations leave behind (kept tangents, secant corrections of points,
//! quasi-Newton pairs, the last correction) changes how the next iterates and steps are found, not what they have to fulfil.
//! Exceptions are steps whose iterations do not contract, which go on from an iterate that is committed, and stabilised ones. A
//! step is accepted when all criteria hold that its stage has chosen
//! ([`crate::problem::Tolerances`]), is cut back when it does not converge, and the run ends with a reason when the
//! smallest step does not.

use super::accepted::{AcceptedState, Attempted, Converged, Counters, Followed, LastStep};
use super::equations::Equations;
use super::explicit::{Handover, Integrator};
use super::linear_solver::LinearSolver;
use super::newton::path::PathConstraint;
use super::newton::quasi_newton::Memory;
use super::newton::tangent_update::TangentUpdater;
use super::procedure::{LoadStepMethod, StageMethod};
use super::step_ends::{StepEnds, is_smallest};
use super::vectors::norm;
use crate::checkpoint::{CheckpointStore, NoCheckpoints, Progress};
use crate::material::PointMaterial;
use crate::model::assembly::balance::Balance;
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use crate::model::failure::{Failure, failure};
use crate::model::friction::Frictions;
use crate::model::loads::Loads;
use crate::model::points::Points;
use crate::observer::{AttemptCost, Convergence, CutBack, Observer, Outcome, Run, Statistics, StepAccuracy};
use crate::problem::{PathControl, Problem, ProblemError};
use nalgebra::Matrix3;
use protocol::{TangentKind, nanoseconds_since};
use std::time::Instant;

/// Solves a problem: all its stages, each from load 0 to load 1, counting steps through.
///
/// Step 0 is the equilibrium at load 0 of the first stage with whatever stress the material starts with; it is iterated only if that
/// stress is out of balance. The material is left with the last accepted state committed, however the run ends, with one exception:
/// viscous stabilisation commits each of its increments. If it is interrupted, the material is left with the state after its last
/// increment, which is not in balance; reports and checkpoints are those of the last accepted step.
pub fn solve(problem: &Problem, material: &mut dyn PointMaterial, observer: &mut dyn Observer) -> Run {
    solve_with_checkpoints(problem, material, observer, &mut NoCheckpoints)
}

/// As [`solve`], from the checkpoint that `store` holds, and saved to it after every accepted step. A run that continues from a
/// checkpoint writes the same bytes as one without interruption.
pub fn solve_with_checkpoints(
    problem: &Problem,
    material: &mut dyn PointMaterial,
    observer: &mut dyn Observer,
    store: &mut dyn CheckpointStore,
) -> Run {
    let run = match Solver::new(problem) {
        Err(error) => {
            let statistics = Statistics::default();
            Run { outcome: Outcome::Refused(error), stage: 0, load: 0.0, step: 0, statistics }
        }
        Ok(mut solver) => {
            let session = &mut Session { material: &mut *material, observer: &mut *observer, store };
            let outcome = match solver.run(session) {
                Ok(()) => Outcome::Completed,
                Err(outcome) => outcome,
            };
            session.material.rollback();
            let Solver { stage, load, step, statistics, .. } = solver;
            Run { outcome, stage, load, step, statistics }
        }
    };
    observer.finished(&run);
    run
}

/// The partners of a run.
pub(super) struct Session<'a> {
    pub(super) material: &'a mut dyn PointMaterial,
    pub(super) observer: &'a mut dyn Observer,
    pub(super) store: &'a mut dyn CheckpointStore,
}

/// State of a run.
pub(super) struct Solver<'a> {
    pub(super) problem: &'a Problem,
    /// Number of the stage under way.
    pub(super) stage: usize,
    /// Displacements at the beginning of the stage, m, by degree of freedom.
    pub(super) stage_start: Vec<f64>,
    pub(super) constraints: Constraints,
    pub(super) loads: Loads,
    pub(super) frictions: Frictions,
    pub(super) linear: LinearSolver,
    pub(super) body: Body,
    pub(super) points: Points,
    /// Tangent of the strategy.
    pub(super) tangent_kind: TangentKind,
    pub(super) tangents: TangentUpdater,
    pub(super) memory: Option<Memory>,
    /// Of the latest iterate.
    pub(super) balance: Balance,
    /// Of the committed state.
    pub(super) committed_balance: Balance,
    /// Of this stage; `None` after a stabilised step, whose path predicts nothing.
    pub(super) last_step: Option<LastStep>,
    /// Load factor of the committed state.
    pub(super) load: f64,
    /// Share of the stage's path that is done; the load factor, unless that is an unknown.
    pub(super) stage_fraction: f64,
    /// Condition on the path that is prescribed in place of the load factor.
    pub(super) path_constraint: Option<PathConstraint>,
    /// Length of a full step under arc-length control.
    pub(super) arc_length: Option<f64>,
    /// Change of the load factor in the last accepted step.
    pub(super) last_load_change: f64,
    pub(super) step: usize,
    /// The dynamic stage that runs or has just ended.
    pub(super) integrator: Option<Integrator>,
    /// What the stage before leaves to a dynamic one that has not begun.
    pub(super) handover: Handover,
    /// Share of the stage that the next step tries.
    pub(super) step_size: f64,
    /// Share of the path to which a step has been stabilised in vain, until that is reached.
    pub(super) stabilised_in_vain: Option<f64>,
    pub(super) statistics: Statistics,
    /// Of the last accepted step.
    pub(super) accuracy: StepAccuracy,
    /// Strain per ramp step of the last step whose estimated error was not above the one that was asked for.
    pub(super) strain_within_error: Option<f64>,
}

impl<'a> Solver<'a> {
    pub(super) fn new(problem: &'a Problem) -> Result<Self, ProblemError> {
        problem.validate()?;
        let first = &problem.stages[0];
        let body = Body::new(problem.mesh.clone(), problem.formulation, problem.hourglass);
        let stage_start = body.zero();
        let points = Points::new(problem);
        let Equations { constraints, loads, frictions, linear } =
            Equations::new(problem, first, &body, &stage_start, points.coupling())?;
        let empty =
            Balance { internal: body.zero(), external: body.zero(), blocks: Vec::new(), hourglass_energy: 0.0 };
        let statistics = Statistics {
            evaluations_per_point: vec![0; problem.point_count()],
            unknowns: constraints.free().len(),
            ..Statistics::default()
        };
        Ok(Self {
            problem,
            stage: 0,
            stage_start,
            constraints,
            loads,
            frictions,
            linear,
            points,
            body,
            // No ramp has been seen yet that could tell which contacts slip.
            tangent_kind: TangentKind::TrussLike,
            tangents: TangentUpdater::new(first.strategy.tangent_update, first.strategy.secant.is_some()),
            memory: first.strategy.quasi_newton.as_ref().map(Memory::new),
            balance: empty.clone(),
            committed_balance: empty,
            last_step: None,
            load: 0.0,
            stage_fraction: 0.0,
            path_constraint: PathConstraint::new(problem, first)?,
            arc_length: None,
            last_load_change: 0.0,
            step: 0,
            integrator: None,
            handover: Handover::default(),
            step_size: 1.0 / first.control.increments as f64,
            stabilised_in_vain: None,
            statistics,
            accuracy: StepAccuracy::default(),
            strain_within_error: None,
        })
    }

    /// Step 0 alone, with the material left in it.
    pub(super) fn solve_start(&mut self, session: &mut Session<'_>) -> Result<(), Outcome> {
        match self.method() {
            StageMethod::LoadSteps(method) => self.equilibrate(method, session),
            StageMethod::Motion(_) => Ok(()),
        }
    }

    fn run(&mut self, session: &mut Session<'_>) -> Result<(), Outcome> {
        session.observer.started(self.problem).map_err(Outcome::Stopped)?;
        if !self.resume(session).map_err(Outcome::CheckpointRefused)? {
            session.observer.stage_started(self.stage, self.stage());
            if let StageMethod::LoadSteps(method) = self.method() {
                self.equilibrate(method, session)?;
                self.save_step(session);
            }
        }
        loop {
            match self.method() {
                StageMethod::LoadSteps(method) => self.take_load_steps(method, session)?,
                StageMethod::Motion(settings) => self.integrate(settings, session)?,
            }
            if !self.enter_next_stage(session)? {
                return Ok(());
            }
        }
    }

    /// How the stage is taken to its end.
    pub(super) fn method(&self) -> StageMethod<'a> {
        StageMethod::of(&self.stage().procedure)
    }

    /// Takes load steps to the end of the stage.
    fn take_load_steps(&mut self, method: &dyn LoadStepMethod, session: &mut Session<'_>) -> Result<(), Outcome> {
        let control = &self.stage().control;
        while !self.is_at_end() {
            self.step += 1;
            let mut size = self.step_size;
            let iterations = self.advance(method, &mut size, session)?;
            self.step_size =
                control.next_size(size, if method.iterations_govern_step_size() { iterations } else { 1 });
            self.save_step(session);
        }
        Ok(())
    }

    /// Whether the stage's path has been followed to its end.
    fn is_at_end(&self) -> bool {
        self.ends_stage(self.stage_fraction)
    }

    /// Whether the stage ends at this share of its path and the present load factor.
    pub(super) fn ends_stage(&self, stage_fraction: f64) -> bool {
        let reaches_load = matches!(self.stage().control.path, PathControl::ArcLength { .. });
        // The load factor is the sum of what steps have added, and rounds.
        stage_fraction >= 1.0 || (reaches_load && self.load >= 1.0 - 1e-9)
    }

    /// Saves the accepted step.
    pub(super) fn save_step(&self, session: &mut Session<'_>) {
        let progress = Progress { step: self.step as u64, stage: self.stage as u64, load: self.load };
        self.save_all(progress, session);
    }

    /// Step 0. A start in balance is accepted as it is; its null trial is dropped, so committed states stay initial.
    fn equilibrate(&mut self, method: &dyn LoadStepMethod, session: &mut Session<'_>) -> Result<(), Outcome> {
        let explain = |reason: &str| Outcome::DidNotConverge { reason: format!("initial equilibrium: {reason}") };
        let ended = |failure| match failure {
            Failure::Attempt(reason) => explain(&reason),
            Failure::Run(outcome) => outcome,
        };
        let counters = Counters::of(&self.statistics);
        let still = self.body.zero();
        let start = self.evaluate(&still, 0.0, session).map_err(ended)?;
        self.check_initial_state(&start).map_err(|defect| explain(&defect.to_string()))?;
        self.tangents.started(self.tangent_kind == self.stage().strategy.tangent);
        self.tangent_kind = self.stage().strategy.tangent;
        self.committed_balance.clone_from(&self.balance);
        session.material.rollback();
        self.points.forget_trials();
        let ratio = start.force_ratio(&self.stage().tolerances);
        let converged = if ratio <= self.stage().tolerances.force {
            Converged {
                increment: still,
                load: 0.0,
                iterations: 0,
                force_ratio: ratio,
                displacement_ratio: 0.0,
                correction: None,
                convergence: Convergence::Full,
            }
        } else {
            let Attempted::Converged(converged) = method.attempt(self, 0.0, false, session).map_err(ended)? else {
                return Err(explain("the iterations do not contract"));
            };
            session.material.commit().map_err(|error| ended(failure(error)))?;
            converged
        };
        let gradients = self.settle(&converged.increment);
        self.accept(&converged, 0.0, &gradients, &counters, session)
    }

    /// Takes one load step, cutting it back as often as needed; returns the iterations of the successful attempt.
    fn advance(
        &mut self,
        method: &dyn LoadStepMethod,
        size: &mut f64,
        session: &mut Session<'_>,
    ) -> Result<usize, Outcome> {
        let control = &self.stage().control;
        let counters = Counters::of(&self.statistics);
        let first_size = *size;
        // After a snap the next step may be as large as ever, unless that has just failed.
        let was_stabilised = self.last_step.is_none() && self.stage_fraction > 0.0;
        let ends = StepEnds::of(self.stage());
        self.points.start_step();
        for cut_backs in 0.. {
            let target = ends.next(self.stage_fraction, *size);
            let counters = Counters { cut_backs, ..counters };
            let begun = AttemptCost::of(&self.statistics);
            let mut reason = match method.attempt(self, target, cut_backs > 0, session) {
                Ok(Attempted::Converged(converged)) => {
                    self.commit_step(&converged, target, &counters, session)?;
                    return Ok(converged.iterations);
                }
                Ok(Attempted::Unfinished(unfinished)) => {
                    match self.continue_from_iterate(&unfinished, target, &counters, session)? {
                        Followed::Accepted(iterations) => return Ok(iterations),
                        Followed::TakenBack(reason) => reason,
                    }
                }
                Err(Failure::Run(outcome)) => return Err(outcome),
                Err(Failure::Attempt(reason)) => {
                    session.material.rollback();
                    self.points.forget_trials();
                    self.points.forget_corrections();
                    reason
                }
            };
            self.statistics.cut_backs += 1;
            self.count_failed(begun);
            let tried = AttemptCost::of(&self.statistics);
            let failed = tried.since(begun);
            let from = target - self.stage_fraction;
            let shorter = (from * control.cut).max(control.min);
            // Close to where steps have to end a shorter one ends there too. The second attempt where nothing changes differs from the first in how
            // it begins.
            let is_last = is_smallest(from, control.min)
                || ends.next(self.stage_fraction, shorter) >= target
                || (cut_backs > 0 && self.stage().changes_nothing());
            if let Some(settings) = self.stabilises(method, cut_backs + 1, from, is_last) {
                let counters = Counters { cut_backs: cut_backs + 1, ..counters };
                match self.stabilise(settings, target, &reason, failed, &counters, session)? {
                    Followed::Accepted(_) => {
                        *size = if was_stabilised && cut_backs > 0 {
                            (from / control.cut).min(first_size)
                        } else {
                            first_size
                        };
                        return Ok(1);
                    }
                    Followed::TakenBack(why) => {
                        self.count_failed(tried);
                        reason = why;
                    }
                }
            }
            let cost = AttemptCost::of(&self.statistics).since(begun);
            if is_last {
                return Err(Outcome::DidNotConverge { reason: self.explained(target, &reason) });
            }
            *size = shorter;
            session.observer.cut_back(&CutBack { step: self.step, load: target, from, to: *size, cost, reason });
        }
        unreachable!("the loop only ends by returning")
    }

    /// Counts what has been taken since `begun` as spent in vain.
    fn count_failed(&mut self, begun: AttemptCost) {
        let cost = AttemptCost::of(&self.statistics).since(begun);
        self.statistics.failed_evaluations += cost.evaluations;
        self.statistics.failed_force_evaluations += cost.force_evaluations;
    }

    /// Commits a converged step and reports it.
    fn commit_step(
        &mut self,
        converged: &Converged,
        stage_fraction: f64,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<(), Outcome> {
        session.material.commit().map_err(|error| failure(error).into_outcome())?;
        let gradients = self.settle(&converged.increment);
        self.accept(converged, stage_fraction, &gradients, before, session)
    }

    /// Why the last attempt, which aimed at the share `target` of the path, was the last.
    pub(super) fn explained(&self, target: f64, reason: &str) -> String {
        let (size, stage) = (target - self.stage_fraction, self.of_stage());
        let smallest = if is_smallest(size, self.stage().control.min) { "the smallest" } else { "a" };
        // Where the load factor is an unknown, the share of the path is no load.
        let place = if self.path_constraint.is_some() {
            format!("at {target:.6} of the path")
        } else {
            format!("at load {target:.6}")
        };
        format!("{place}{stage} with {smallest} step {size:.2e}: {reason}")
    }

    /// Moves the reference to the configuration after `increment`, which the material has committed; the displacement
    /// gradients of the points.
    pub(super) fn settle(&mut self, increment: &[f64]) -> Vec<Matrix3<f64>> {
        let gradients = self.gradients(increment);
        self.body.commit(increment);
        self.points.commit(&gradients);
        self.committed_balance.clone_from(&self.balance);
        gradients
    }

    /// Ends a step, whose state has been settled, and reports it; `gradients` are those of the whole step.
    pub(super) fn accept(
        &mut self,
        converged: &Converged,
        stage_fraction: f64,
        gradients: &[Matrix3<f64>],
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<(), Outcome> {
        let (load, step_size) = (converged.load, stage_fraction - self.stage_fraction);
        if step_size > 0.0 {
            // The path of a stabilised step predicts nothing about the next step, and a body that stood still has none.
            let is_regular = before.stabilisation_increments == 0;
            let has_moved = converged.increment.iter().any(|change| *change != 0.0);
            self.last_step = (is_regular && has_moved).then(|| LastStep {
                increment: converged.increment.clone(),
                size: step_size,
                // Where cells snap, corrections lead from branch to branch.
                correction: converged.correction.clone().filter(|_| self.tangents.is_smooth()).unwrap_or_default(),
            });
            self.last_load_change = load - self.load;
            self.statistics.steps += 1;
            if self.stabilised_in_vain.is_some_and(|target| stage_fraction >= target) {
                self.stabilised_in_vain = None;
            }
        }
        (self.load, self.stage_fraction) = (load, stage_fraction);
        let statistics = &mut self.statistics;
        match converged.convergence {
            Convergence::Full => {}
            Convergence::Stagnated => {
                statistics.stagnated_steps += 1;
                statistics.largest_stagnated_force_ratio =
                    statistics.largest_stagnated_force_ratio.max(converged.force_ratio);
            }
            Convergence::Noise => statistics.steps_with_noisy_corrections += 1,
        }
        statistics.largest_force_ratio = statistics.largest_force_ratio.max(converged.force_ratio);
        statistics.largest_displacement_ratio =
            statistics.largest_displacement_ratio.max(converged.displacement_ratio);
        let balance = converged.correction.as_ref().and_then(|correction| self.balance_error(correction));
        self.note_accuracy(balance, session);
        let mut reactions = self.committed_balance.residual();
        for (dof, reaction) in reactions.iter_mut().enumerate() {
            if self.constraints.is_unloaded(dof) {
                *reaction = 0.0;
            }
        }
        let forces = norm(&reactions).max(norm(&self.committed_balance.external));
        self.statistics.largest_forces = self.statistics.largest_forces.max(forces);
        self.statistics.largest_force_sum = self.statistics.largest_force_sum.max(self.force_sum());
        let state = AcceptedState {
            load,
            stage_fraction,
            step_size,
            iterations: converged.iterations,
            force_ratio: converged.force_ratio,
            displacement_ratio: converged.displacement_ratio,
            convergence: converged.convergence,
            gradients,
            reactions: &reactions,
            loads: &self.committed_balance.external,
            hourglass_energy: self.committed_balance.hourglass_energy,
            dynamics: None,
        };
        self.report_accepted(&state, before, session)
    }
}

/// Runs `work` and adds its wall time to `total`, ns.
pub(super) fn timed<T>(total: &mut u64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *total += nanoseconds_since(start);
    result
}
