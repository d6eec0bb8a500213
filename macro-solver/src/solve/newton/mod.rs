//! One attempt at one load step: predictor, Newton iterations, convergence.
//!
//! Every iterate is evaluated from the committed state.

mod globalisation;
pub(in crate::solve) mod path;
pub(in crate::solve) mod quasi_newton;
pub(in crate::solve) mod tangent_update;

use super::driver::{Session, Solver, timed};
use super::linear_solver::{LinearSolverError, norm};
use crate::model::failure::Failure;
use crate::observer::IterationReport;
use crate::problem::{DisplacementMeasure, ForceMeasure, Measured, Predictor};
use globalisation::Safeguard;
use nalgebra::Matrix3;
use protocol::TangentKind;

/// A correction below this share of the displacements so far is round-off: a step in which nothing moves converges.
const ROUND_OFF: f64 = 1e-12;

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
}

/// Share of the largest reactions or loads of the run below which the out-of-balance force is measured by that share: a body that
/// is unloaded to zero has nothing left to compare with.
const LEAST_FORCES: f64 = 1e-2;

/// What one evaluation of an iterate gives.
pub(super) struct Evaluated {
    /// Points evaluated.
    pub(super) asked: u64,
    /// Norm of the out-of-balance force at free degrees of freedom, N, in the plane per metre.
    pub(super) residual: f64,
    /// Norm of the reactions or of the loads, whichever is larger, and at least [`LEAST_FORCES`] of what they were, N, in the plane per metre.
    pub(super) scale: f64,
    /// Norm of the reactions, at least as much, N, in the plane per metre.
    pub(super) reactions: f64,
}

impl Evaluated {
    /// Out-of-balance over the forces that a measure names.
    pub(super) fn ratio(&self, measure: ForceMeasure) -> f64 {
        let scale = match measure {
            ForceMeasure::Largest => self.scale,
            ForceMeasure::Reactions => self.reactions,
        };
        if self.residual == 0.0 { 0.0 } else { self.residual / scale }
    }
}

impl Solver<'_> {
    /// Tries the step from the committed state to the share `passed` of the stage's path; `again` after a failed attempt at
    /// this step.
    pub(super) fn attempt(
        &mut self,
        passed: f64,
        again: bool,
        session: &mut Session<'_>,
    ) -> Result<Converged, Failure> {
        self.renewer.begin_attempt(again);
        if let Some(memory) = &mut self.memory {
            memory.begin_attempt(again);
        }
        // An initial state is brought to balance under its own loads.
        let constraint = self.constraint.clone().filter(|_| passed > self.passed);
        let (mut iterate, mut load) = match &constraint {
            None => (self.predict(passed)?, passed),
            Some(constraint) => self.predict_path(constraint, passed - self.passed)?,
        };
        let first = iterate.clone();
        let gradients = self.body.gradients(&iterate);
        self.points.begin_attempt(&gradients);
        let capped_change = self.stage().strategy.capped_change;
        let mut safeguard = Safeguard::new(largest_component(&gradients).max(capped_change), capped_change);
        let tolerances = &self.stage().tolerances;
        let full_step = self.full_step(passed);
        let mut last = String::new();
        for iteration in 1..=self.stage().control.max_iterations {
            self.statistics.iterations += 1;
            let mut report = self.blank_report(load, iteration);
            // The load factor is a part of the iterate: a retreat takes it back as well.
            let joined: Vec<f64> = iterate.iter().copied().chain([load]).collect();
            if let Err(reason) = self.try_iterate(&iterate, &joined, &mut safeguard, &mut report, session)? {
                self.turn_down(report, session);
                iterate = safeguard.retreat(&joined).ok_or(Failure::Attempt(reason))?;
                load = iterate.pop().expect("the load factor was joined");
                continue;
            }
            let (correction, load_change) = match &constraint {
                None => (self.correction(&iterate).map_err(|error| Failure::Attempt(error.to_string()))?, 0.0),
                Some(constraint) => {
                    self.correction_on_path(constraint, &iterate, &first, load, passed - self.passed)?
                }
            };
            let measured = self.measured(report.force_ratio, &iterate, &correction, full_step);
            report.displacement_ratio = Some(measured.displacement);
            session.observer.iterated(&report);
            let excess = tolerances.excess(&measured);
            if excess.iter().all(|excess| *excess <= 1.0) {
                return Ok(Converged {
                    increment: iterate,
                    load,
                    iterations: iteration,
                    force_ratio: measured.force,
                    displacement_ratio: measured.displacement,
                });
            }
            last = format!("out-of-balance {:.2e}, correction {:.2e}", measured.force, measured.displacement);
            if tolerances.criteria.energy {
                last = format!("{last}, energy {:.2e}", measured.energy);
            }
            if safeguard.stagnates(excess) {
                return Err(Failure::Attempt(format!("no progress after {iteration} iterations: {last}")));
            }
            let share = safeguard.share(largest_component(&self.body.gradients(&correction)));
            for (value, change) in iterate.iter_mut().zip(&correction) {
                *value += share * change;
            }
            load += share * load_change;
        }
        let iterations = self.stage().control.max_iterations;
        Err(Failure::Attempt(format!("not converged after {iterations} iterations: {last}")))
    }

    /// The measures of an iterate that would still get `correction`.
    pub(super) fn measured(&self, force: f64, iterate: &[f64], correction: &[f64], full_step: f64) -> Measured {
        let size = match self.stage().tolerances.criteria.displacement {
            Some(DisplacementMeasure::Step) => norm(iterate),
            Some(DisplacementMeasure::FullStep) | None => full_step * norm(iterate),
        };
        let round_off = ROUND_OFF * norm(&self.body.displacements);
        let work = |forces: &[f64], along: &[f64]| {
            forces.iter().zip(along).map(|(force, along)| force * along).sum::<f64>().abs()
        };
        let given_up = work(&self.balance.residual(), correction);
        Measured {
            force,
            displacement: ratio(norm(correction), size, round_off),
            energy: if given_up == 0.0 { 0.0 } else { given_up / work(&self.balance.internal, iterate) },
        }
    }

    /// Displacement gradients of an increment as points are asked for them.
    pub(super) fn gradients(&self, increment: &[f64]) -> Vec<Matrix3<f64>> {
        self.points.rounded(self.body.gradients(increment))
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
            turned_down: false,
        }
    }

    /// Counts an iterate that is turned down, and tells the observer.
    pub(super) fn turn_down(&mut self, report: IterationReport, session: &mut Session<'_>) {
        self.statistics.turned_down += 1;
        self.statistics.turned_down_evaluations += report.evaluations;
        session.observer.iterated(&IterationReport { turned_down: true, ..report });
    }

    /// Evaluates an iterate, known to the safeguard together with its load factor, and fills its report; the inner result says why the iterate is turned down.
    fn try_iterate(
        &mut self,
        iterate: &[f64],
        joined: &[f64],
        safeguard: &mut Safeguard,
        report: &mut IterationReport,
        session: &mut Session<'_>,
    ) -> Result<Result<(), String>, Failure> {
        let evaluated = match self.evaluate(iterate, report.load, session) {
            Ok(evaluated) => evaluated,
            Err(Failure::Attempt(reason)) => return Ok(Err(reason)),
            Err(ended) => return Err(ended),
        };
        report.evaluations = evaluated.asked;
        let tolerances = &self.stage().tolerances;
        report.force_ratio = evaluated.ratio(tolerances.criteria.force.unwrap_or_default());
        let settled = tolerances.force * evaluated.scale;
        if safeguard.accepts(joined, evaluated.residual, settled) {
            self.renewer.judge(evaluated.residual);
            return Ok(Ok(()));
        }
        Ok(Err(format!("the out-of-balance force grew to {:.2e}", report.force_ratio)))
    }

    /// Evaluates all points at an iterate and assembles forces and stiffness.
    pub(super) fn evaluate(
        &mut self,
        increment: &[f64],
        load: f64,
        session: &mut Session<'_>,
    ) -> Result<Evaluated, Failure> {
        let kind = self.renewer.kind(self.tangent_asked);
        let asked = self.ask(increment, kind, session)?;
        self.renewer.evaluated();
        let moment = self.moment(load);
        self.balance = timed(&mut self.statistics.assembly_nanoseconds, || {
            self.body.balance(increment, self.points.all(), &self.loads, moment)
        });
        Ok(self.evaluated(asked))
    }

    /// Asks all points for their answers to an iterate.
    pub(super) fn ask(
        &mut self,
        increment: &[f64],
        tangent: TangentKind,
        session: &mut Session<'_>,
    ) -> Result<u64, Failure> {
        let gradients = self.gradients(increment);
        if let Some(point) = self.body.inverted_point(&gradients, &self.body.geometry(increment)) {
            let element = self.body.element_of(point);
            return Err(Failure::Attempt(format!("element {element} is turned inside out at Gauss point {point}")));
        }
        let mut waiting = 0;
        let asked =
            timed(&mut waiting, || self.points.evaluate(&gradients, tangent, session.material, &mut self.statistics));
        self.statistics.material_nanoseconds += waiting;
        Ok(asked?.asked)
    }

    /// How far the assembled balance is from zero.
    pub(super) fn evaluated(&self, asked: u64) -> Evaluated {
        let residual = self.balance.residual();
        let reactions = self.reactions(&residual);
        let least = LEAST_FORCES * self.statistics.largest_forces;
        Evaluated {
            asked,
            residual: norm(&self.constraints.restrict(&residual)),
            scale: reactions.max(norm(&self.balance.external)).max(least),
            reactions: reactions.max(least),
        }
    }

    /// Norm of the reactions. Where they vanish, the force of a relative displacement of 1e-9 keeps round-off from
    /// looking like imbalance.
    fn reactions(&self, residual: &[f64]) -> f64 {
        let reactions: Vec<f64> = (0..residual.len())
            .filter(|&dof| self.constraints.unknown(dof).is_none())
            .map(|dof| residual[dof])
            .collect();
        norm(&reactions).max(1e-9 * self.balance.largest_diagonal() * self.body.extent())
    }

    /// The correction of the evaluated iterate, zero at prescribed degrees of freedom: Newton's, with tangents as fresh as
    /// the strategy wants them, and what quasi-Newton pairs make of it.
    fn correction(&mut self, iterate: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let residual = self.constraints.restrict(&self.balance.residual());
        let right: Vec<f64> = residual.iter().map(|value| -value).collect();
        if let Some(memory) = &mut self.memory {
            let change = |step: &[f64]| largest_component(&self.body.gradients(&self.constraints.expand(step)));
            memory.learn(&self.constraints.select(iterate), &residual, change);
        }
        if self.renewer.factorizes() {
            self.factorize()?;
        }
        self.solve_linear(&right)
    }

    /// Factorizes the stiffness of the latest balance.
    pub(super) fn factorize(&mut self) -> Result<(), LinearSolverError> {
        let blocks = self.constraints.condense(&self.balance.blocks);
        timed(&mut self.statistics.linear_solver_nanoseconds, || self.linear.factorize(&blocks))?;
        self.renewer.factorized();
        Ok(())
    }

    /// Solves with the factors in place and returns displacements that are zero where prescribed.
    pub(super) fn solve_linear(&mut self, right: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let (linear, memory) = (&mut self.linear, &self.memory);
        let solution = timed(&mut self.statistics.linear_solver_nanoseconds, || match memory {
            Some(memory) => memory.apply(right, |right| linear.solve(right)),
            None => linear.solve(right),
        });
        self.statistics.symbolic_factorizations = self.linear.symbolic_count();
        self.statistics.numeric_factorizations = self.linear.numeric_count();
        self.statistics.linear_iterations = self.linear.iteration_count();
        self.statistics.direct_fallbacks = self.linear.fallback_count();
        Ok(self.constraints.expand(&solution?))
    }

    /// First iterate of a step: prescribed components are exact, free ones extrapolated or from the tangent of the
    /// committed state.
    fn predict(&mut self, load: f64) -> Result<Vec<f64>, Failure> {
        let moment = self.moment(load);
        let mut increment = self.given(moment);
        let linear = self.stage().strategy.predictor == Predictor::Linear;
        match self.last_increment.as_ref().filter(|_| linear) {
            Some((last, size)) => {
                for &dof in self.constraints.free() {
                    increment[dof] = last[dof] * ((load - self.load) / size);
                }
            }
            None => {
                self.balance.clone_from(&self.committed_balance);
                self.balance.external = self.loads.force(&self.body.positions(&self.body.zero()), moment);
                let mut right = self.balance.residual();
                for (value, pulled) in right.iter_mut().zip(self.balance.stiffness_times(&increment)) {
                    *value = -(*value + pulled);
                }
                if self.renewer.factorizes() {
                    self.factorize().map_err(|error| Failure::Attempt(error.to_string()))?;
                }
                let free = self.solve_linear(&self.constraints.restrict(&right));
                let free = free.map_err(|error| Failure::Attempt(error.to_string()))?;
                for &dof in self.constraints.free() {
                    increment[dof] = free[dof];
                }
            }
        }
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        Ok(increment)
    }

    /// Size of a full step over that of the step to `passed`; 1 for the initial equilibrium, which has no size.
    pub(super) fn full_step(&self, passed: f64) -> f64 {
        let size = passed - self.passed;
        if size > 0.0 { 1.0 / (self.stage().control.increments as f64 * size) } else { 1.0 }
    }
}

/// Largest component of any of the displacement gradients.
pub(super) fn largest_component(gradients: &[Matrix3<f64>]) -> f64 {
    gradients.iter().map(Matrix3::amax).fold(0.0, f64::max)
}

/// A ratio that is 0 when nothing is left to correct.
fn ratio(correction: f64, step: f64, round_off: f64) -> f64 {
    if correction <= round_off { 0.0 } else { correction / step }
}
