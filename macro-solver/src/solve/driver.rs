//! Implicit quasi-static solution by Newton's method.
//!
//! A load step starts from the last committed configuration and asks every Gauss point for its answer to the total
//! displacement gradient of the step. Nothing of an iterate survives into the next but displacements: every
//! evaluation restarts from the committed state, so the accepted state does not depend on the iterations that led to
//! it, except through the choice of the ramp. A step is accepted when force and displacement criteria both hold, is
//! cut back when it does not converge, and the run ends in an honest failure when the smallest step does not.

use crate::checkpoint::{Keeper, Mark, NoKeeper, keep, resume};
use crate::material::PointMaterial;
use crate::model::assembly::balance::Balance;
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use crate::model::failure::{Failure, failure};
use crate::model::loads::Loads;
use crate::model::points::Points;
use crate::observer::{CutBack, FieldsView, Observer, Outcome, Run, Statistics, StepReport, StopRequest};
use crate::problem::{PathControl, Problem, ProblemError, Procedure};
use crate::solve::explicit::Integrator;
use crate::solve::linear_solver::{LinearSolver, norm};
use crate::solve::newton::Converged;
use crate::solve::newton::path::Constraint;
use crate::solve::newton::quasi_newton::Memory;
use crate::solve::newton::tangent_update::Renewer;
use crate::solve::stage::Equations;
use nalgebra::Matrix3;
use protocol::TangentKind;
use std::time::Instant;

/// Solves a problem: all its stages, each from load 0 to load 1, counting steps through.
///
/// Step 0 is the equilibrium at load 0 of the first stage with whatever stress the material starts with; it is iterated only if that
/// stress is out of balance. The material is left with the last accepted state committed, however the run ends, with one exception:
/// creep through a snap commits as it goes. Where it is broken off or comes to no balance, the material is left with the state
/// after its last increment, which is not in balance, while everything that was reported or kept is that of the last accepted step.
pub fn solve(problem: &Problem, material: &mut dyn PointMaterial, observer: &mut dyn Observer) -> Run {
    solve_kept(problem, material, observer, &mut NoKeeper)
}

/// As [`solve`], from where `keeper` says, and saved by it after every accepted step. What an earlier process has saved
/// continues to the same bytes as if there had been no interruption.
pub fn solve_kept(
    problem: &Problem,
    material: &mut dyn PointMaterial,
    observer: &mut dyn Observer,
    keeper: &mut dyn Keeper,
) -> Run {
    let run = match Solver::new(problem) {
        Err(error) => {
            Run { outcome: Outcome::Refused(error), stage: 0, load: 0.0, statistics: Statistics::default() }
        }
        Ok(mut solver) => {
            let session = &mut Session { material: &mut *material, observer: &mut *observer, keeper };
            let outcome = match solver.run(session) {
                Ok(()) => Outcome::Completed,
                Err(outcome) => outcome,
            };
            session.material.rollback();
            Run { outcome, stage: solver.stage, load: solver.load, statistics: solver.statistics }
        }
    };
    observer.finished(&run);
    run
}

/// The partners of a run.
pub(super) struct Session<'a> {
    pub(super) material: &'a mut dyn PointMaterial,
    pub(super) observer: &'a mut dyn Observer,
    pub(super) keeper: &'a mut dyn Keeper,
}

/// State of a run.
pub(super) struct Solver<'a> {
    pub(super) problem: &'a Problem,
    /// Number of the stage under way.
    pub(super) stage: usize,
    /// Displacements when it began, m, by degree of freedom.
    pub(super) stage_start: Vec<f64>,
    pub(super) constraints: Constraints,
    pub(super) loads: Loads,
    pub(super) linear: LinearSolver,
    pub(super) body: Body,
    pub(super) points: Points,
    pub(super) tangent_asked: TangentKind,
    pub(super) renewer: Renewer,
    pub(super) memory: Option<Memory>,
    /// Of the latest iterate.
    pub(super) balance: Balance,
    /// Of the committed state.
    pub(super) committed_balance: Balance,
    /// Displacements and size of the last accepted load step.
    pub(super) last_increment: Option<(Vec<f64>, f64)>,
    /// Load factor of the committed state.
    pub(super) load: f64,
    /// Share of the stage's path that has passed; the load factor, unless that is an unknown.
    pub(super) passed: f64,
    /// What is prescribed in place of the load factor.
    pub(super) constraint: Option<Constraint>,
    /// Length of a full step under arc-length control.
    pub(super) arc_length: Option<f64>,
    /// Change of the load factor in the last accepted step.
    pub(super) last_load_change: f64,
    pub(super) step: usize,
    /// The dynamic stage under way or just over.
    pub(super) integrator: Option<Integrator>,
    /// Velocities that a dynamic stage has left to the next one, m/s.
    pub(super) carried_velocity: Option<Vec<f64>>,
    /// Share of the stage that the next step tries.
    pub(super) size: f64,
    pub(super) statistics: Statistics,
}

impl<'a> Solver<'a> {
    pub(super) fn new(problem: &'a Problem) -> Result<Self, ProblemError> {
        problem.validate()?;
        let first = &problem.stages[0];
        let body = Body::new(problem.mesh.clone(), problem.formulation, problem.hourglass);
        let stage_start = body.zero();
        let Equations { constraints, loads, linear } = Equations::new(problem, first, &body, &stage_start)?;
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
            linear,
            points: Points::new(problem),
            body,
            // No ramp has been seen yet that could tell which contacts slip.
            tangent_asked: TangentKind::TrussLike,
            renewer: Renewer::new(first.strategy.renewal, first.strategy.secant.is_some()),
            memory: first.strategy.quasi_newton.as_ref().map(Memory::new),
            balance: empty.clone(),
            committed_balance: empty,
            last_increment: None,
            load: 0.0,
            passed: 0.0,
            constraint: Constraint::new(problem, &first.control.path)?,
            arc_length: None,
            last_load_change: 0.0,
            step: 0,
            integrator: None,
            carried_velocity: None,
            size: 1.0 / first.control.increments as f64,
            statistics,
        })
    }

    fn run(&mut self, session: &mut Session<'_>) -> Result<(), Outcome> {
        session.observer.started(self.problem).map_err(Outcome::Stopped)?;
        let unfit = |error| Outcome::Stopped(StopRequest { reason: format!("{error}") });
        if !resume(session.keeper, self, session.material, session.observer).map_err(unfit)? {
            session.observer.stage_started(self.stage, self.stage());
            if !matches!(self.stage().procedure, Procedure::Dynamic(_)) {
                self.equilibrate(session)?;
                self.keep(session);
            }
        }
        loop {
            match &self.stage().procedure {
                Procedure::Implicit | Procedure::Relaxation(_) => self.follow(session)?,
                Procedure::Dynamic(settings) => self.integrate(settings, session)?,
            }
            if !self.enter_next_stage(session)? {
                return Ok(());
            }
        }
    }

    /// Takes load steps to the end of the stage.
    fn follow(&mut self, session: &mut Session<'_>) -> Result<(), Outcome> {
        let control = &self.stage().control;
        while !self.is_at_end() {
            self.step += 1;
            let mut size = self.size;
            let iterations = self.advance(&mut size, session)?;
            // Iterations of a motion say nothing about how hard the step was.
            let is_relaxed = matches!(self.stage().procedure, Procedure::Relaxation(_));
            self.size = control.next_size(size, if is_relaxed { 1 } else { iterations });
            self.keep(session);
        }
        Ok(())
    }

    /// Whether the stage's path has been followed to its end.
    fn is_at_end(&self) -> bool {
        let reaches_load = matches!(self.stage().control.path, PathControl::ArcLength { .. });
        self.passed >= 1.0 || (reaches_load && self.load >= 1.0)
    }

    pub(super) fn keep(&self, session: &mut Session<'_>) {
        let mark = Mark { step: self.step as u64, stage: self.stage as u64, load: self.load };
        keep(session.keeper, mark, self, session.material, session.observer);
    }

    /// Step 0. A start in balance is accepted as it is; its null trial is dropped, so committed states stay initial.
    fn equilibrate(&mut self, session: &mut Session<'_>) -> Result<(), Outcome> {
        let explain = |reason| Outcome::DidNotConverge { reason: format!("initial equilibrium: {reason}") };
        let ended = |failure| match failure {
            Failure::Attempt(reason) => explain(reason),
            Failure::Run(outcome) => outcome,
        };
        let counters = Counters::of(&self.statistics);
        let still = self.body.zero();
        let start = self.evaluate(&still, 0.0, session).map_err(ended)?;
        self.check_initial_state(&start).map_err(explain)?;
        self.renewer.started(self.tangent_asked == self.stage().strategy.tangent);
        self.tangent_asked = self.stage().strategy.tangent;
        self.committed_balance.clone_from(&self.balance);
        session.material.rollback();
        self.points.forget_trials();
        let ratio = start.ratio(self.stage().tolerances.criteria.force.unwrap_or_default());
        let converged = if ratio <= self.stage().tolerances.force {
            Converged { increment: still, load: 0.0, iterations: 0, force_ratio: ratio, displacement_ratio: 0.0 }
        } else {
            let converged = self.approach(0.0, false, session).map_err(ended)?;
            session.material.commit().map_err(|error| ended(failure(error)))?;
            converged
        };
        let gradients = self.settle(&converged.increment);
        self.accept(&converged, 0.0, &gradients, &counters, session)
    }

    /// Takes one load step, cutting it back as often as needed; returns the iterations of the successful attempt.
    fn advance(&mut self, size: &mut f64, session: &mut Session<'_>) -> Result<usize, Outcome> {
        let control = &self.stage().control;
        let counters = Counters::of(&self.statistics);
        let begun_with = *size;
        self.points.start_step();
        for cut_backs in 0.. {
            let passed = next_load(self.passed, *size, control.increments, control.min);
            match self.approach(passed, cut_backs > 0, session) {
                Ok(converged) => {
                    session.material.commit().map_err(|error| match failure(error) {
                        Failure::Run(outcome) => outcome,
                        Failure::Attempt(reason) => Outcome::WorkersLost { reason },
                    })?;
                    let gradients = self.settle(&converged.increment);
                    self.accept(&converged, passed, &gradients, &Counters { cut_backs, ..counters }, session)?;
                    return Ok(converged.iterations);
                }
                Err(Failure::Run(outcome)) => return Err(outcome),
                Err(Failure::Attempt(reason)) => {
                    session.material.rollback();
                    self.points.forget_trials();
                    self.points.forget_corrections();
                    let (load, from) = (passed, passed - self.passed);
                    if let Some(settings) = self.stabilises(cut_backs + 1, from) {
                        let counters = Counters { cut_backs: cut_backs + 1, ..counters };
                        self.stabilise(settings, passed, reason, &counters, session)?;
                        *size = begun_with;
                        return Ok(1);
                    }
                    *size = from * control.cut;
                    if *size < control.min {
                        return Err(Outcome::DidNotConverge { reason: self.explained(passed, &reason) });
                    }
                    self.statistics.cut_backs += 1;
                    session.observer.cut_back(&CutBack { step: self.step, load, from, to: *size, reason });
                }
            }
        }
        unreachable!("the loop only ends by returning")
    }

    /// Tries to reach `load` from the committed state in the way of the stage; `again` after a failed attempt at this step.
    fn approach(&mut self, load: f64, again: bool, session: &mut Session<'_>) -> Result<Converged, Failure> {
        match &self.stage().procedure {
            Procedure::Relaxation(settings) => self.relax(settings, load, session),
            Procedure::Implicit | Procedure::Dynamic(_) => self.attempt(load, again, session),
        }
    }

    /// Why the last attempt, which aimed at the share `passed` of the path, was the last.
    pub(super) fn explained(&self, passed: f64, reason: &str) -> String {
        let (size, stage) = (passed - self.passed, self.of_stage());
        let smallest = if size * self.stage().control.cut < self.stage().control.min { "the smallest" } else { "a" };
        format!("at load {passed:.6}{stage} with {smallest} step {size:.2e}: {reason}")
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
        passed: f64,
        gradients: &[Matrix3<f64>],
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<(), Outcome> {
        let (load, size) = (converged.load, passed - self.passed);
        if size > 0.0 {
            // The way through a snap says nothing about the next step.
            self.last_increment = (before.creep == 0).then(|| (converged.increment.clone(), size));
            self.last_load_change = load - self.load;
            self.statistics.steps += 1;
        }
        (self.load, self.passed) = (load, passed);
        let report = StepReport {
            step: self.step,
            stage: self.stage,
            load,
            time: self.problem.begin_of(self.stage) + self.moment(passed).time,
            share: (self.stage as f64 + passed) / self.problem.stages.len() as f64,
            size,
            iterations: converged.iterations,
            evaluations: self.statistics.evaluations - before.evaluations,
            skipped: self.statistics.skipped - before.skipped,
            cut_backs: before.cut_backs,
            creep: before.creep,
            force_ratio: converged.force_ratio,
            displacement_ratio: converged.displacement_ratio,
            flags: self.points.flags(),
        };
        let mut reactions = self.committed_balance.residual();
        for (dof, reaction) in reactions.iter_mut().enumerate() {
            if self.constraints.is_unloaded(dof) {
                *reaction = 0.0;
            }
        }
        let forces = norm(&reactions).max(norm(&self.committed_balance.external));
        self.statistics.largest_forces = self.statistics.largest_forces.max(forces);
        let fields = self.fields(gradients, &reactions, &self.committed_balance.external);
        let view = FieldsView {
            mesh: self.body.mesh(),
            displacements: &fields.displacements,
            reactions: &fields.reactions,
            loads: &fields.loads,
            hourglass_energy: self.committed_balance.hourglass_energy,
            dynamics: None,
            points: &fields.points,
            statistics: &self.statistics,
        };
        session.observer.accepted(&report, &view).map_err(Outcome::Stopped)
    }
}

/// Counters at the start of a step, and what happened before it was accepted.
#[derive(Clone, Copy)]
pub(super) struct Counters {
    pub(super) evaluations: u64,
    pub(super) skipped: u64,
    /// Failed attempts.
    pub(super) cut_backs: usize,
    /// Increments of creep.
    pub(super) creep: usize,
}

impl Counters {
    pub(super) fn of(statistics: &Statistics) -> Self {
        Self { evaluations: statistics.evaluations, skipped: statistics.skipped, cut_backs: 0, creep: 0 }
    }
}

/// Load factor that a step of `size` aims at. Snaps to the grid of equal steps, so that an undisturbed run meets
/// exactly the same loads whatever rounding does, and ends at 1 without a sliver.
fn next_load(load: f64, size: f64, increments: usize, min: f64) -> f64 {
    let next = load + size;
    if 1.0 - next < 0.5 * min {
        return 1.0;
    }
    let on_grid = (next * increments as f64).round() / increments as f64;
    if (on_grid - next).abs() < 1e-9 { on_grid } else { next }
}

/// Runs `work` and adds its wall time to `total`, ns.
pub(super) fn timed<T>(total: &mut u64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *total += u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    result
}
