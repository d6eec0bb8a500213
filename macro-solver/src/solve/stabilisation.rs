//! Through a snap: where no balanced state lies next to the committed one, the body creeps to one further on.
//!
//! When grains rearrange at once, the stress of a point jumps, and the body has no balance that Newton's method could
//! find from where it stands. An experiment goes on by itself there until it finds a new one. So does the body here, in
//! a viscous drag: it obeys `C du/dt = -R(u)`, where `C` is its first stiffness, taken as isotropic. Supports and loads go
//! to the end of the step as fast as no point is strained by more than the cap in one increment, and wait there; they also
//! wait while the body has more to catch up with than half the cap. Increments are linearly implicit (`(K + drag C) du = -R`),
//! each evaluated once and **committed** though it is not in balance, because grains remember the way: from the old
//! state a snap would be met again and again. The drag falls with the out-of-balance force and rises when that turns
//! around, so that the last increments are Newton's. The state that is accepted in the end fulfils the criteria of every
//! other step, without the drag.

use super::driver::{Counters, Session, Solver};
use super::linear_solver::{LinearSolverError, norm};
use super::newton::{Converged, largest_component};
use crate::element::integrals::add_stiffness;
use crate::formulation::{Configuration, Formulation};
use crate::material::elastic::isotropic_moduli;
use crate::model::assembly::block::Block;
use crate::model::body::{Body, degrees_of_freedom};
use crate::model::failure::{Failure, failure};
use crate::observer::{Outcome, Stabilised};
use crate::problem::{Procedure, Stabilisation};
use nalgebra::Matrix3;

/// Drag after an increment that went too far is at least this share of the first.
const LEAST_DRAG: f64 = 0.1;

/// Share of the out-of-balance force that an increment may leave without the next being stretched.
const SLOW: f64 = 0.5;

/// Largest factor on an increment.
const LARGEST_STRETCH: f64 = 32.0;

/// Growth of the out-of-balance force at which an increment is taken back and made smaller.
const LARGEST_GROWTH: f64 = 2.0;

/// Times that an increment is taken back: a jump of the material does not get smaller with the increment.
const MOST_RETREATS: usize = 3;

/// Factor on the drag for each.
const RETREAT: f64 = 4.0;

/// Share of the cap that the body may have to catch up with while supports and loads go on.
const CATCHING_UP: f64 = 0.5;

/// Excess over the cap that is rounding.
const ROUNDING: f64 = 1e-9;

/// Times that a motion of supports and loads is halved because it strains the body by more than it should.
const MOST_HALVINGS: usize = 20;

/// An increment in which supports and loads cover less than this share of the step counts as one in which they stand.
const LEAST_ADVANCE: f64 = 1e-3;

/// The body under way.
struct Way {
    /// Drag of the first increment.
    first_drag: f64,
    drag: f64,
    /// Factor on increments.
    stretch: f64,
    drag_blocks: Vec<Block>,
    /// Increments taken back in a row.
    retreats: usize,
    /// Share of the stage's path at which supports and loads stand.
    reached: f64,
    /// Change of the displacements so far, m, by degree of freedom.
    increment: Vec<f64>,
    /// Displacement gradients of the points over the way so far.
    gradients: Vec<Matrix3<f64>>,
    /// What is told of the way.
    event: Stabilised,
}

/// An increment to be tried.
struct Move {
    increment: Vec<f64>,
    /// Share of the stage's path at which supports and loads stand after it.
    to: f64,
    /// Out-of-balance force along the unknowns before it, with what the motion of supports and loads adds.
    pull: Vec<f64>,
}

impl Solver<'_> {
    /// Whether a step that has failed `failed` times, last with the size `from`, is to be stabilised now.
    pub(super) fn stabilises(&self, failed: usize, from: f64) -> Option<Stabilisation> {
        let control = &self.stage().control;
        let is_smallest = from * control.cut < control.min;
        control
            .stabilisation
            .filter(|settings| is_smallest || settings.after.is_some_and(|after| failed >= after))
            .filter(|_| self.constraint.is_none() && matches!(self.stage().procedure, Procedure::Implicit))
    }

    /// Takes a step to the share `passed` of the path by creep, after attempts of which the last failed for `reason`; `before` are
    /// the counters of the step with these attempts.
    pub(super) fn stabilise(
        &mut self,
        settings: Stabilisation,
        passed: f64,
        reason: String,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<(), Outcome> {
        self.statistics.cut_backs += 1;
        let mut way = self.way(settings.drag, passed, reason);
        // Forces of the drag would teach it wrong pairs.
        let mut memory = self.memory.take();
        let crept = self.creep(&mut way, settings, passed, session);
        if let Some(memory) = &mut memory {
            memory.begin_attempt(true);
        }
        self.memory = memory;
        let converged = crept.map_err(|failure| match failure {
            Failure::Run(outcome) => outcome,
            Failure::Attempt(lost) => {
                let first = self.explained(passed, &way.event.reason);
                Outcome::DidNotConverge { reason: format!("{first}; stabilised: {lost}") }
            }
        })?;
        self.statistics.stabilised_steps += 1;
        session.observer.stabilised(&way.event);
        let before = Counters { creep: way.event.increments, ..*before };
        self.accept(&converged, passed, &way.gradients, &before, session)
    }

    /// A way that begins at the committed state.
    fn way(&self, first_drag: f64, passed: f64, reason: String) -> Way {
        Way {
            first_drag,
            drag: first_drag,
            stretch: 1.0,
            drag_blocks: self.body.first_stiffness(|point| self.points.all()[point].first_moduli()),
            retreats: 0,
            reached: self.passed,
            increment: self.body.zero(),
            gradients: vec![Matrix3::zeros(); self.points.all().len()],
            event: Stabilised {
                step: self.step,
                load: passed,
                increments: 0,
                evaluations: 0,
                largest_imbalance: 0.0,
                work: 0.0,
                reason,
            },
        }
    }

    /// Lets the body creep to a balanced state at the share `passed` of the stage's path, which is settled then. The way is
    /// committed and counted as it goes, also where it leads nowhere.
    fn creep(
        &mut self,
        way: &mut Way,
        settings: Stabilisation,
        passed: f64,
        session: &mut Session<'_>,
    ) -> Result<Converged, Failure> {
        let mut last = String::new();
        // Increments on the way to the end of the step are as many as the cap makes them.
        let (mut waiting, least_advance) = (0, LEAST_ADVANCE * (passed - self.passed));
        for iteration in 1.. {
            if waiting == settings.most_increments {
                break;
            }
            self.statistics.iterations += 1;
            let from = way.reached;
            let force_ratio = self.creep_on(way, passed, iteration, session)?;
            waiting += usize::from(way.reached >= passed || way.reached - from < least_advance);
            last = format!("out-of-balance {force_ratio:.2e}");
            if way.reached < passed {
                continue;
            }
            let tolerances = &self.stage().tolerances;
            if way.retreats > 0 || (force_ratio > tolerances.force && tolerances.criteria.force.is_some()) {
                continue;
            }
            // Without the drag: what would Newton's method still correct?
            let correction = match self.undragged_correction() {
                Ok(correction) => correction,
                Err(error) => {
                    last = error.to_string();
                    continue;
                }
            };
            let measured = self.measured(force_ratio, &way.increment, &correction, self.full_step(passed));
            if self.stage().tolerances.excess(&measured).iter().all(|excess| *excess <= 1.0) {
                return Ok(Converged {
                    increment: std::mem::take(&mut way.increment),
                    load: passed,
                    iterations: iteration,
                    force_ratio: measured.force,
                    displacement_ratio: measured.displacement,
                });
            }
            last = format!("{last}, correction {:.2e}", measured.displacement);
            way.drag = 0.0;
        }
        Err(Failure::Attempt(format!("no balance after {} increments of creep: {last}", settings.most_increments)))
    }

    /// One increment; the out-of-balance ratio that it leaves. It has not been committed if there are retreats.
    fn creep_on(
        &mut self,
        way: &mut Way,
        passed: f64,
        iteration: usize,
        session: &mut Session<'_>,
    ) -> Result<f64, Failure> {
        let Move { increment, to, pull: before } = self.dragged_increment(way, passed).map_err(failed)?;
        self.renewer.begin_attempt(true);
        let predicted = self.body.gradients(&increment);
        self.points.begin_attempt(&predicted);
        let mut report = self.blank_report(passed, iteration);
        let evaluated = match self.evaluate(&increment, to, session) {
            Err(Failure::Attempt(reason)) => {
                self.turn_down(report, session);
                if way.retreats >= MOST_RETREATS {
                    return Err(Failure::Attempt(reason));
                }
                self.take_back(way, session);
                return Ok(f64::INFINITY);
            }
            other => other?,
        };
        self.statistics.creep_evaluations += evaluated.asked;
        way.event.evaluations += evaluated.asked;
        let after = self.constraints.restrict(&self.balance.residual());
        let (tolerances, worse) = (&self.stage().tolerances, norm(&after) / norm(&before));
        let force_ratio = evaluated.ratio(tolerances.criteria.force.unwrap_or_default());
        (report.evaluations, report.force_ratio) = (evaluated.asked, force_ratio);
        if worse > LARGEST_GROWTH && force_ratio > tolerances.force && way.retreats < MOST_RETREATS {
            self.turn_down(report, session);
            self.take_back(way, session);
            return Ok(force_ratio);
        }
        session.observer.iterated(&report);
        session.material.commit().map_err(failure)?;
        let along = self.constraints.select(&increment);
        // What supports and loads add does not belong to the drag.
        let at_its_begin = dot(&self.constraints.restrict(&self.committed_balance.residual()), &along);
        let work = -0.5 * (at_its_begin + dot(&after, &along));
        let gradients = self.settle(&increment);
        let moved = to > way.reached;
        way.reached = to;
        way.retreats = 0;
        way.adapt(worse, dot(&before, &after) < 0.0, moved);
        way.follow(&increment, &gradients, self.body.formulation());
        way.event.work += work;
        self.statistics.creep_work += work;
        way.event.largest_imbalance = way.event.largest_imbalance.max(force_ratio);
        way.event.increments += 1;
        self.statistics.creep_increments += 1;
        Ok(force_ratio)
    }

    /// Forgets an increment that went too far, and makes the next one smaller.
    fn take_back(&mut self, way: &mut Way, session: &mut Session<'_>) {
        session.material.rollback();
        self.points.forget_trials();
        self.points.forget_corrections();
        way.retreats += 1;
        way.drag = (RETREAT * way.drag).max(way.first_drag);
        way.stretch = 1.0;
    }

    /// The next increment on the way to the share `passed` of the path. No component of a displacement gradient is
    /// larger than `capped_change` in it, wherever that is: next to a support as anywhere else.
    fn dragged_increment(&mut self, way: &Way, passed: f64) -> Result<Move, LinearSolverError> {
        self.balance = self.committed_balance.clone();
        // Blocks of elements come first.
        for (block, drag) in self.balance.blocks.iter_mut().zip(&way.drag_blocks) {
            for (entry, drag) in block.matrix.iter_mut().zip(&drag.matrix) {
                *entry += way.drag * drag;
            }
        }
        self.factorize()?;
        let cap = self.stage().strategy.capped_change;
        let at_rest = self.answer(way.reached)?;
        let behind = self.largest_change(&at_rest);
        if way.reached < passed {
            // A motion that went too far is made smaller too.
            let pace = cap / RETREAT.powi(i32::try_from(way.retreats).unwrap_or(i32::MAX));
            if let Some(onwards) = self.onwards(way.reached, passed, &at_rest, behind, pace)? {
                return Ok(onwards);
            }
        }
        let Move { mut increment, to, pull } = at_rest;
        let share = (cap / behind).min(way.stretch);
        for &dof in self.constraints.free() {
            increment[dof] *= share;
        }
        let moment = self.moment(to);
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        Ok(Move { increment, to, pull })
    }

    /// An increment in which supports and loads go on from the share `reached` of the path as far towards `passed` as no
    /// point is strained by more than `pace`; `None` while the body has to catch up first. `at_rest` is the increment in
    /// which they stand, and `behind` how much it strains the body.
    fn onwards(
        &mut self,
        reached: f64,
        passed: f64,
        at_rest: &Move,
        behind: f64,
        pace: f64,
    ) -> Result<Option<Move>, LinearSolverError> {
        let whole = self.answer(passed)?;
        if self.largest_change(&whole) <= pace {
            return Ok(Some(whole));
        }
        if behind > CATCHING_UP * pace {
            return Ok(None);
        }
        let by_motion: Vec<f64> =
            whole.increment.iter().zip(&at_rest.increment).map(|(whole, rest)| whole - rest).collect();
        let mut share = (pace - behind) / largest_component(&self.body.gradients(&by_motion));
        for _ in 0..MOST_HALVINGS {
            let part = self.answer(reached + share * (passed - reached))?;
            if self.largest_change(&part) <= pace * (1.0 + ROUNDING) {
                return Ok(Some(part));
            }
            // Histories need not be straight.
            share *= 0.5;
        }
        Ok(None)
    }

    /// The linear answer of the body to supports and loads at the share `to` of the path, from the committed state and with
    /// the factors in place. Prescribed components are exact.
    fn answer(&mut self, to: f64) -> Result<Move, LinearSolverError> {
        let moment = self.moment(to);
        let mut increment = self.given(moment);
        self.balance.external = self.loads.force(&self.body.positions(&self.body.zero()), moment);
        let mut pulled = self.balance.residual();
        for (force, of_supports) in pulled.iter_mut().zip(self.balance.stiffness_times(&increment)) {
            *force += of_supports;
        }
        let pull = self.constraints.restrict(&pulled);
        let free = self.solve_linear(&pull.iter().map(|force| -force).collect::<Vec<f64>>())?;
        for &dof in self.constraints.free() {
            increment[dof] = free[dof];
        }
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        Ok(Move { increment, to, pull })
    }

    fn largest_change(&self, of: &Move) -> f64 {
        largest_component(&self.body.gradients(&of.increment))
    }

    /// Newton's correction of the committed state.
    fn undragged_correction(&mut self) -> Result<Vec<f64>, LinearSolverError> {
        self.factorize()?;
        let residual = self.constraints.restrict(&self.balance.residual());
        self.solve_linear(&residual.iter().map(|value| -value).collect::<Vec<f64>>())
    }
}

impl Way {
    /// Chooses drag and stretch after an increment that left the share `left` of the out-of-balance force, or turned it
    /// around; `moved` if supports and loads went on in it.
    ///
    /// Away from a state that is not stable the force grows by itself, and a tangent that is too stiff makes increments too
    /// short: neither wants more drag.
    fn adapt(&mut self, left: f64, turned: bool, moved: bool) {
        if turned {
            self.drag = (2.0 * self.drag).max(LEAST_DRAG * self.first_drag);
        } else if left < 1.0 {
            self.drag *= (0.5 * left).max(0.2);
        }
        let is_slow = !turned && !moved && left > SLOW;
        self.stretch = if is_slow { (2.0 * self.stretch).min(LARGEST_STRETCH) } else { 1.0 };
    }

    /// Adds an increment to the whole.
    fn follow(&mut self, increment: &[f64], gradients: &[Matrix3<f64>], formulation: Formulation) {
        for (value, change) in self.increment.iter_mut().zip(increment) {
            *value += change;
        }
        for (total, gradient) in self.gradients.iter_mut().zip(gradients) {
            // Each refers to the configuration before it, unless all refer to the initial one.
            let carried = match formulation.reference() {
                Configuration::Initial => *gradient,
                _ => gradient + gradient * *total,
            };
            *total += carried;
        }
    }
}

fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

fn failed(error: LinearSolverError) -> Failure {
    Failure::Attempt(error.to_string())
}

impl Body {
    /// Stiffness of every element with the moduli of its points, on the committed geometry.
    fn first_stiffness(&self, moduli: impl Fn(usize) -> [f64; 2]) -> Vec<Block> {
        let (dimension, geometry) = (self.mesh().dimension.count(), self.settled_geometry());
        let of_element = |(element, nodes): (usize, &Vec<usize>)| {
            let mut block = Block::zero(degrees_of_freedom(dimension, nodes));
            for point in self.points_of(element) {
                let [lambda, shear] = moduli(point);
                let moduli = isotropic_moduli(lambda, shear);
                add_stiffness(dimension, &geometry[point], nodes.len(), &moduli, &mut block.matrix);
            }
            block
        };
        self.mesh().elements.iter().enumerate().map(of_element).collect()
    }
}
