//! One attempt at one load step: predictor, Newton iterations, convergence.
//!
//! Every iterate is evaluated from the committed state. Where that does not contract because cells snap, the attempt ends unfinished,
//! and the step goes on from its last iterate.

mod correction;
mod globalisation;
mod idle;
pub(in crate::solve) mod path;
mod prediction;
pub(in crate::solve) mod quasi_newton;
pub(in crate::solve) mod tangent_update;

use super::accepted::{Attempted, Converged, Unfinished};
use super::driver::{Session, Solver};
use super::procedure::LoadStepMethod;
use super::vectors::largest_component;
use crate::model::failure::Failure;
use crate::observer::{Convergence, IterationReport};
use crate::problem::ConvergenceMeasures;
use globalisation::Globalisation;
use path::PathConstraint;
use thiserror::Error;

/// Out-of-balance force over reactions and loads up to which an iterate is committed.
const LARGEST_IMBALANCE: f64 = 0.1;

/// Share of the force tolerance from which on it is: below that, iterations only move within the rounding of the grains' equilibrium.
const LEAST_IMBALANCE: f64 = 1e-2;

/// Correction over the displacements of a full step up to which it is.
const LARGEST_CORRECTION: f64 = 1.0;

/// Why an iterate is rejected.
#[derive(Clone, Debug, Error, PartialEq)]
enum Rejection {
    /// A point or an element does not go along.
    #[error("{0}")]
    Evaluation(String),
    /// Too far from balance.
    #[error("the out-of-balance force grew to {force_ratio:.2e}")]
    Growth {
        /// Out-of-balance ratio.
        force_ratio: f64,
    },
}

/// Newton's method with predictor, globalisation and the tangent updates of the strategy.
pub(super) struct Newton;

impl LoadStepMethod for Newton {
    fn attempt(
        &self,
        solver: &mut Solver<'_>,
        stage_fraction: f64,
        again: bool,
        session: &mut Session<'_>,
    ) -> Result<Attempted, Failure> {
        solver.attempt_newton(stage_fraction, again, session)
    }

    fn iterations_govern_step_size(&self) -> bool {
        true
    }

    fn can_be_stabilised(&self) -> bool {
        true
    }
}

/// An attempt that is under way.
struct Attempt {
    /// Share of the stage's path that it aims at.
    target: f64,
    /// Of an initial state there is none: it is brought to balance under its own loads.
    path_constraint: Option<PathConstraint>,
    /// First iterate.
    first: Vec<f64>,
    /// Change of the displacements, m, by degree of freedom.
    iterate: Vec<f64>,
    /// Load factor of the iterate.
    load: f64,
    globalisation: Globalisation,
    /// Iterates evaluated, rejected ones too.
    iterations: usize,
    /// The iterate, joined with its load factor, that came nearest to convergence of those that a stagnated step may end at, and
    /// its distance.
    nearest: Option<(f64, Vec<f64>)>,
}

impl Attempt {
    /// Whether the attempt may end at an evaluated iterate if it stagnates, by its measures over the weaker tolerances; remembers the
    /// nearest of them. One that is twice as far from convergence as the nearest is not the place to end.
    fn may_end_at(&mut self, joined: &[f64], excess: [f64; 2], stagnated: [f64; 2]) -> bool {
        let distance = excess[0].max(excess[1]);
        if !stagnated.iter().all(|excess| *excess <= 1.0) {
            return false;
        }
        let nearest = self.nearest.as_ref().map_or(f64::INFINITY, |(nearest, _)| *nearest);
        if distance < nearest {
            self.nearest = Some((distance, joined.to_vec()));
        }
        distance <= 2.0 * nearest
    }

    /// The step at the evaluated iterate, whose next correction is `correction`.
    fn converged(&self, measures: &ConvergenceMeasures, correction: Vec<f64>, convergence: Convergence) -> Converged {
        Converged {
            increment: self.iterate.clone(),
            load: self.load,
            iterations: self.iterations,
            force_ratio: measures.force,
            displacement_ratio: measures.displacement,
            correction: Some(correction),
            convergence,
        }
    }
}

impl Solver<'_> {
    /// Tries the step from the committed state to the share `target` of the stage's path; `again` after a failed attempt at
    /// this step.
    fn attempt_newton(&mut self, target: f64, again: bool, session: &mut Session<'_>) -> Result<Attempted, Failure> {
        if let Some(converged) = self.remain(target, session)? {
            return Ok(Attempted::Converged(converged));
        }
        let mut attempt = self.begin_attempt(target, again)?;
        let full_step = self.full_step(target);
        match self.iterate(&mut attempt, full_step, session) {
            Err(Failure::Attempt(reason)) => match attempt.nearest.take() {
                Some((_, nearest)) => self.settle_for(attempt, nearest, full_step, session).map(Attempted::Converged),
                None => Err(Failure::Attempt(reason)),
            },
            ended => ended,
        }
    }

    /// Iterates until the step has converged, until it stagnates close enough to convergence, or until an iterate is better committed.
    fn iterate(
        &mut self,
        attempt: &mut Attempt,
        full_step: f64,
        session: &mut Session<'_>,
    ) -> Result<Attempted, Failure> {
        let mut last = String::new();
        let max_iterations = self.stage().control.max_iterations;
        for iteration in 1..=max_iterations {
            let mut report = self.next_report(attempt);
            // The load factor is a part of the iterate: backtracking takes it back as well.
            let joined: Vec<f64> = attempt.iterate.iter().copied().chain([attempt.load]).collect();
            if let Err(rejection) = self.try_iterate(attempt, &joined, &mut report, session)? {
                self.reject(report, session);
                self.tangents.rejected();
                // Past an iterate that the step may end at, corrections that lead away are not worth searching along.
                let next = attempt.globalisation.backtrack(&joined).filter(|_| attempt.nearest.is_none());
                attempt.iterate = next.ok_or_else(|| Failure::Attempt(rejection.to_string()))?;
                attempt.load = attempt.iterate.pop().expect("the load factor was joined");
                continue;
            }
            let (correction, load_change) = self.correction_of(attempt)?;
            let measures = self.convergence_measures(report.force_ratio, &attempt.iterate, &correction, full_step);
            report.displacement_ratio = Some(measures.displacement);
            session.observer.iterated(&report);
            let tolerances = &self.stage().tolerances;
            let excess = tolerances.excess(&measures);
            let is_converged = excess.iter().all(|excess| *excess <= 1.0);
            let crawls = attempt.globalisation.crawls(excess);
            let forces_crawl = attempt.globalisation.forces_crawl(measures.force);
            let may_end_here = attempt.may_end_at(&joined, excess, tolerances.stagnated().excess(&measures));
            if is_converged || (may_end_here && crawls) {
                let convergence = if is_converged { Convergence::Full } else { Convergence::Stagnated };
                return Ok(Attempted::Converged(attempt.converged(&measures, correction, convergence)));
            }
            if self.is_better_committed(attempt, &measures, forces_crawl) {
                return Ok(Attempted::Unfinished(Unfinished {
                    increment: attempt.iterate.clone(),
                    iterations: attempt.iterations,
                    force_ratio: measures.force,
                }));
            }
            last = format!("out-of-balance {:.2e}, correction {:.2e}", measures.force, measures.displacement);
            if tolerances.criteria.energy {
                last = format!("{last}, energy {:.2e}", measures.energy);
            }
            if attempt.globalisation.stagnates(excess) || (crawls && attempt.nearest.is_some()) {
                return Err(Failure::Attempt(format!("no progress after {iteration} iterations: {last}")));
            }
            let share = attempt.globalisation.share(largest_component(&self.body.gradients(&correction)));
            for (value, change) in attempt.iterate.iter_mut().zip(&correction) {
                *value += share * change;
            }
            attempt.load += share * load_change;
        }
        Err(Failure::Attempt(format!("not converged after {max_iterations} iterations: {last}")))
    }

    /// Whether the step goes on from the evaluated iterate in place of the committed state: after enough iterations the out-of-balance force
    /// hardly falls any more, and the iterate is not far from balance. The size of the corrections does not tell: it grows where a
    /// quasi-Newton update finds the body softer than its tangents, while the iterations converge.
    fn is_better_committed(&self, attempt: &Attempt, measures: &ConvergenceMeasures, forces_crawl: bool) -> bool {
        let Some(after) = self.stage().control.stabilisation.and_then(|settings| settings.commit_iterates_after)
        else {
            return false;
        };
        after > 0
            && attempt.iterations >= after
            && forces_crawl
            && attempt.path_constraint.is_none()
            && attempt.target > self.stage_fraction
            && measures.force <= LARGEST_IMBALANCE
            && measures.force >= LEAST_IMBALANCE * self.stage().tolerances.force
            && measures.displacement <= LARGEST_CORRECTION
    }

    /// Counts the iterate that is evaluated next; its report, of which nothing is known yet.
    fn next_report(&mut self, attempt: &mut Attempt) -> IterationReport {
        self.statistics.iterations += 1;
        attempt.iterations += 1;
        self.blank_report(attempt.load, attempt.iterations)
    }

    /// Ends a step at an iterate that was evaluated before and is the nearest to convergence.
    fn settle_for(
        &mut self,
        mut attempt: Attempt,
        mut nearest: Vec<f64>,
        full_step: f64,
        session: &mut Session<'_>,
    ) -> Result<Converged, Failure> {
        attempt.load = nearest.pop().expect("the load factor was joined");
        attempt.iterate = nearest;
        let mut report = self.next_report(&mut attempt);
        let norms = self.evaluate(&attempt.iterate, attempt.load, session)?;
        report.evaluations = norms.evaluations;
        report.force_ratio = norms.force_ratio(&self.stage().tolerances);
        let (correction, _) = self.correction_of(&attempt)?;
        let measures = self.convergence_measures(report.force_ratio, &attempt.iterate, &correction, full_step);
        report.displacement_ratio = Some(measures.displacement);
        session.observer.iterated(&report);
        Ok(attempt.converged(&measures, correction, Convergence::Stagnated))
    }

    /// First iterate of an attempt, and the points prepared for it.
    fn begin_attempt(&mut self, target: f64, again: bool) -> Result<Attempt, Failure> {
        self.tangents.begin_attempt(again);
        if let Some(memory) = &mut self.memory {
            memory.begin_attempt(again);
        }
        let path_constraint = self.path_constraint.clone().filter(|_| target > self.stage_fraction);
        let (iterate, load) = match &path_constraint {
            None => (self.predict(target)?, target),
            Some(path_constraint) => self.predict_path(path_constraint, target - self.stage_fraction)?,
        };
        let gradients = self.body.gradients(&iterate);
        self.points.begin_attempt(&gradients);
        let capped_change = self.stage().strategy.capped_change;
        let globalisation = Globalisation::new(largest_component(&gradients).max(capped_change), capped_change);
        Ok(Attempt {
            target,
            path_constraint,
            first: iterate.clone(),
            iterate,
            load,
            globalisation,
            iterations: 0,
            nearest: None,
        })
    }

    /// Correction of the evaluated iterate and of its load factor.
    fn correction_of(&mut self, attempt: &Attempt) -> Result<(Vec<f64>, f64), Failure> {
        let Attempt { target, path_constraint, first, iterate, load, .. } = attempt;
        match path_constraint {
            None => Ok((self.correction(iterate).map_err(|error| Failure::Attempt(error.to_string()))?, 0.0)),
            Some(path_constraint) => {
                self.correction_on_path(path_constraint, iterate, first, *load, target - self.stage_fraction)
            }
        }
    }

    /// The report of an iterate of which nothing is known yet.
    pub(super) fn blank_report(&self, load: f64, iteration: usize) -> IterationReport {
        IterationReport {
            step: self.step,
            load,
            iteration,
            evaluations: 0,
            force_ratio: f64::INFINITY,
            displacement_ratio: None,
            rejected: false,
        }
    }

    /// Counts a rejected iterate and reports it.
    pub(super) fn reject(&mut self, report: IterationReport, session: &mut Session<'_>) {
        self.statistics.rejected += 1;
        self.statistics.rejected_evaluations += report.evaluations;
        session.observer.iterated(&IterationReport { rejected: true, ..report });
    }

    /// Evaluates the iterate, which the globalisation knows together with its load factor (`joined`), and fills its report; the
    /// inner result says why the iterate is rejected.
    fn try_iterate(
        &mut self,
        attempt: &mut Attempt,
        joined: &[f64],
        report: &mut IterationReport,
        session: &mut Session<'_>,
    ) -> Result<Result<(), Rejection>, Failure> {
        let norms = match self.evaluate(&attempt.iterate, report.load, session) {
            Ok(norms) => norms,
            Err(Failure::Attempt(reason)) => return Ok(Err(Rejection::Evaluation(reason))),
            Err(ended) => return Err(ended),
        };
        report.evaluations = norms.evaluations;
        let tolerances = &self.stage().tolerances;
        report.force_ratio = norms.force_ratio(tolerances);
        let settled = tolerances.force * norms.scale;
        if attempt.globalisation.accepts(joined, norms.residual, settled) {
            self.tangents.judge(norms.residual, report.force_ratio);
            return Ok(Ok(()));
        }
        Ok(Err(Rejection::Growth { force_ratio: report.force_ratio }))
    }
}
