//! One attempt at one load step: predictor, Newton iterations, safeguard.
//!
//! Every iterate is evaluated from the committed state. An iterate is turned down when a point refuses it, an element
//! inverts, or the out-of-balance force grows more than [`LARGEST_GROWTH`]-fold; the next one then lies half way back.
//! Corrections are capped by [`crate::problem::Strategy::capped_change`]. An attempt that no longer gets anywhere is
//! given up before its iterations are used up: a smaller step costs less.

use super::linear_solver::{LinearSolverError, norm};
use super::{Failure, Session, Solver, timed};
use crate::observer::IterationReport;
use crate::problem::Predictor;
use nalgebra::Matrix2;

/// Growth of the out-of-balance force, relative to the last accepted iterate, that turns an iterate down.
const LARGEST_GROWTH: f64 = 3.0;

/// An attempt is given up when the out-of-balance force has not fallen below [`PROGRESS`] times its least value for
/// this many evaluations.
const LONGEST_STAGNATION: usize = 5;

/// See [`LONGEST_STAGNATION`].
const PROGRESS: f64 = 0.9;

/// Consecutive iterates that may be turned down before the attempt fails.
const LARGEST_RETREATS: usize = 3;

/// A converged step, not yet committed.
#[derive(Clone, Debug)]
pub(super) struct Converged {
    /// Change of the displacements, m, by degree of freedom.
    pub(super) increment: Vec<f64>,
    /// Iterations used.
    pub(super) iterations: usize,
    /// Force ratio reached.
    pub(super) force_ratio: f64,
    /// Displacement ratio reached.
    pub(super) displacement_ratio: f64,
}

/// The last iterate that was not turned down.
struct Base {
    increment: Vec<f64>,
    residual: f64,
}

/// What one evaluation of an iterate gives.
pub(super) struct Evaluated {
    /// Points evaluated.
    pub(super) asked: u64,
    /// Norm of the out-of-balance force at free degrees of freedom, N per metre.
    pub(super) residual: f64,
    /// Norm of the forces that it is compared with, N per metre.
    pub(super) scale: f64,
}

impl Evaluated {
    /// Out-of-balance over reactions or loads.
    pub(super) fn ratio(&self) -> f64 {
        if self.residual == 0.0 { 0.0 } else { self.residual / self.scale }
    }
}

impl Solver<'_> {
    /// Tries to reach `load` from the committed state.
    pub(super) fn attempt(&mut self, load: f64, session: &mut Session<'_>) -> Result<Converged, Failure> {
        let mut iterate = self.predict(load)?;
        let gradients = self.body.gradients(&iterate);
        self.points.fix_ramps(&gradients);
        let reach = largest_component(&gradients).max(self.problem.strategy.capped_change);
        let full_step = self.full_step(load);
        let mut stagnation = Stagnation { least: f64::INFINITY, evaluations: 0 };
        let mut base: Option<Base> = None;
        let (mut retreats, mut capped) = (0, false);
        let mut last = String::new();
        for iteration in 1..=self.problem.control.max_iterations {
            self.statistics.iterations += 1;
            let mut report = IterationReport {
                step: self.step,
                load,
                iteration,
                evaluations: 0,
                force_ratio: f64::INFINITY,
                displacement_ratio: None,
                turned_down: false,
            };
            let refusal = match self.evaluate(&iterate, load, session) {
                Ok(evaluated) => {
                    report.evaluations = evaluated.asked;
                    report.force_ratio = evaluated.ratio();
                    last = format!("out-of-balance {:.2e}", report.force_ratio);
                    let settled = self.problem.tolerances.force * evaluated.scale;
                    if let Some(base) = &base {
                        capped |= evaluated.residual > base.residual.max(settled);
                    }
                    let grown = base
                        .as_ref()
                        .is_some_and(|base| evaluated.residual > LARGEST_GROWTH * base.residual.max(settled));
                    if grown {
                        Some(format!("the out-of-balance force grew to {:.2e}", report.force_ratio))
                    } else {
                        base = Some(Base { increment: iterate.clone(), residual: evaluated.residual });
                        None
                    }
                }
                Err(Failure::Attempt(reason)) => Some(reason),
                Err(ended) => return Err(ended),
            };
            if let Some(reason) = refusal {
                capped = true;
                retreats += 1;
                report.turned_down = true;
                self.statistics.turned_down += 1;
                session.observer.iterated(&report);
                iterate = retreat(base.as_ref(), &iterate, retreats).ok_or(Failure::Attempt(reason))?;
                continue;
            }
            retreats = 0;
            let correction = self.correction().map_err(|error| Failure::Attempt(error.to_string()))?;
            let displacement_ratio = ratio(norm(&correction), full_step * norm(&iterate));
            report.displacement_ratio = Some(displacement_ratio);
            session.observer.iterated(&report);
            let tolerances = &self.problem.tolerances;
            if report.force_ratio <= tolerances.force && displacement_ratio <= tolerances.displacement {
                let force_ratio = report.force_ratio;
                return Ok(Converged { increment: iterate, iterations: iteration, force_ratio, displacement_ratio });
            }
            last.push_str(&format!(", correction {displacement_ratio:.2e}"));
            if report.force_ratio > tolerances.force && stagnation.reached(report.force_ratio) {
                return Err(Failure::Attempt(format!("no progress after {iteration} iterations: {last}")));
            }
            let cap = if capped { self.problem.strategy.capped_change } else { reach };
            let share = self.capped_share(&correction, cap);
            for (value, change) in iterate.iter_mut().zip(&correction) {
                *value += share * change;
            }
        }
        let iterations = self.problem.control.max_iterations;
        Err(Failure::Attempt(format!("not converged after {iterations} iterations: {last}")))
    }

    /// Evaluates all points at an iterate and assembles forces and stiffness.
    pub(super) fn evaluate(
        &mut self,
        increment: &[f64],
        load: f64,
        session: &mut Session<'_>,
    ) -> Result<Evaluated, Failure> {
        let gradients = self.body.gradients(increment);
        if let Some(point) = self.body.inverted_point(&gradients, &self.body.geometry(increment)) {
            let element = point / crate::mesh::POINTS_PER_ELEMENT;
            return Err(Failure::Attempt(format!("element {element} is turned inside out at Gauss point {point}")));
        }
        let mut waiting = 0;
        let asked = timed(&mut waiting, || {
            self.points.evaluate(&gradients, self.tangent_asked, session.material, &mut self.statistics)
        });
        self.statistics.material_nanoseconds += waiting;
        let asked = asked?.asked;
        self.balance = timed(&mut self.statistics.assembly_nanoseconds, || {
            self.body.balance(increment, self.points.all(), &self.loads, load)
        });
        let residual = self.balance.residual();
        Ok(Evaluated {
            asked,
            residual: norm(&self.constraints.restrict(&residual)),
            scale: self.force_scale(&residual),
        })
    }

    /// Norm of the reactions or of the loads, whichever is larger. Where both vanish, the force of a relative
    /// displacement of 1e-9 keeps round-off from looking like imbalance.
    fn force_scale(&self, residual: &[f64]) -> f64 {
        let reactions: Vec<f64> = (0..residual.len())
            .filter(|&dof| self.constraints.unknown(dof).is_none())
            .map(|dof| residual[dof])
            .collect();
        let round_off = 1e-9 * self.balance.largest_diagonal() * self.body.extent();
        norm(&reactions).max(norm(&self.balance.external)).max(round_off)
    }

    /// Newton's correction at the evaluated iterate, zero at prescribed degrees of freedom.
    fn correction(&mut self) -> Result<Vec<f64>, LinearSolverError> {
        let right: Vec<f64> =
            self.constraints.restrict(&self.balance.residual()).iter().map(|value| -value).collect();
        self.solve_linear(&right)
    }

    fn solve_linear(&mut self, right: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let solution = timed(&mut self.statistics.linear_solver_nanoseconds, || {
            self.linear.factorize(&self.balance.blocks)?;
            self.linear.solve(right)
        });
        self.statistics.symbolic_factorizations = self.linear.symbolic_count();
        self.statistics.numeric_factorizations = self.linear.numeric_count();
        Ok(self.constraints.expand(&solution?))
    }

    /// First iterate of a step: prescribed components are exact, free ones extrapolated or from the tangent of the
    /// committed state.
    fn predict(&mut self, load: f64) -> Result<Vec<f64>, Failure> {
        let mut increment = self.body.zero();
        for (dof, value) in increment.iter_mut().enumerate() {
            if let Some(prescribed) = self.constraints.prescribed(dof, load) {
                *value = prescribed - self.body.displacements[dof];
            }
        }
        let linear = self.problem.strategy.predictor == Predictor::Linear;
        match self.last_increment.as_ref().filter(|_| linear) {
            Some((last, size)) => {
                for &dof in self.constraints.free() {
                    increment[dof] = last[dof] * ((load - self.load) / size);
                }
            }
            None => {
                self.balance.clone_from(&self.committed_balance);
                self.balance.external = self.loads.force(&self.body.positions(&self.body.zero()), load);
                let mut right = self.balance.residual();
                for (value, pulled) in right.iter_mut().zip(self.balance.stiffness_times(&increment)) {
                    *value = -(*value + pulled);
                }
                let free = self.solve_linear(&self.constraints.restrict(&right));
                let free = free.map_err(|error| Failure::Attempt(error.to_string()))?;
                for &dof in self.constraints.free() {
                    increment[dof] = free[dof];
                }
            }
        }
        Ok(increment)
    }

    /// Share of a correction that keeps every component of every point's `H` within the cap.
    fn capped_share(&self, correction: &[f64], cap: f64) -> f64 {
        (cap / largest_component(&self.body.gradients(correction))).min(1.0)
    }

    /// Size of a full step over that of the step to `load`; 1 for the initial equilibrium, which has no size.
    fn full_step(&self, load: f64) -> f64 {
        let size = load - self.load;
        if size > 0.0 { 1.0 / (self.problem.control.increments as f64 * size) } else { 1.0 }
    }
}

/// Watches for residuals that have stopped falling.
struct Stagnation {
    least: f64,
    evaluations: usize,
}

impl Stagnation {
    /// Takes the next residual; true once it has not fallen for too long.
    fn reached(&mut self, residual: f64) -> bool {
        if residual < PROGRESS * self.least {
            self.least = residual;
            self.evaluations = 0;
        } else {
            self.evaluations += 1;
        }
        self.evaluations >= LONGEST_STAGNATION
    }
}

/// Largest component of any of the displacement gradients.
fn largest_component(gradients: &[Matrix2<f64>]) -> f64 {
    gradients.iter().map(Matrix2::amax).fold(0.0, f64::max)
}

/// Half way from `iterate` to the last good one; `None` when there is none or too many retreats in a row.
fn retreat(base: Option<&Base>, iterate: &[f64], retreats: usize) -> Option<Vec<f64>> {
    let base = base.filter(|_| retreats <= LARGEST_RETREATS)?;
    Some(base.increment.iter().zip(iterate).map(|(from, to)| from + 0.5 * (to - from)).collect())
}

/// A ratio that is 0 when nothing is left to correct.
fn ratio(correction: f64, step: f64) -> f64 {
    if correction == 0.0 { 0.0 } else { correction / step }
}
