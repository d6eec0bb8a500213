//! The servo: Newton steps on all stress components until the cell carries its target.

use super::servo_steps::{ServoStep, StepRules, StepsWithoutPressure};
use super::{Compaction, TOUCH, rows};
use crate::definition::{PackingError, RveOptions};
use crate::preparation::servo::{LARGEST_STRAIN, Response, aim};
use crate::preparation::stress_target::{Matrix, turned_out};
use crate::solver::SolverFor;
use crate::space::largest_component;
use protocol::{RveSolver, TangentKind, Tensor2, TrialResult};

/// Stress error over pressure below which strains are taken in finer steps and to the tolerance of the packing.
const REFINED: f64 = 1e-2;

/// Share of the distance to its target stress that a careful step may leave; a step that leaves more is taken back and shortened.
const WORTHWHILE: f64 = 0.95;

/// Most times that a careful step is halved; what is left then is taken as it is, so that a cell that snaps can go on.
const MOST_HALVINGS: u32 = 8;

impl<S: SolverFor> Compaction<'_, S> {
    /// Steps on all stress components with the network's own tangent, or with what the steps have taught.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the target is not reached.
    pub(crate) fn servo(&mut self, without_pressure: StepsWithoutPressure) -> Result<(), PackingError> {
        self.cell.set_options(RveOptions {
            strain_per_step: Some(2e-6),
            tolerance: Some(1e-4),
            max_steps: Some(20_000),
            ..RveOptions::default()
        });
        let mut response = Response::isotropic(100.0 * self.target.pressure, self.target.dimension);
        let mut answer = self.trial(&self.isotropic(-TOUCH), TangentKind::TrussLike)?;
        let mut refined = false;
        let mut rules = StepRules::new(S::DIMENSION == 3, without_pressure, self.tolerances.stress);
        for increment in 0..self.limits.increments {
            self.commit()?;
            self.report("servo", increment, &answer);
            if self.limits.are_passed_by(&self.cell.committed().cell.rows) {
                return Err(self.flows());
            }
            let error = self.stress_error(&answer.stress);
            let is_at_target = error <= self.tolerances.stress;
            if refined && is_at_target && answer.scalars.unbalanced_force_ratio <= self.tolerances.force {
                return Ok(());
            }
            if error < REFINED && !refined {
                refined = true;
                self.refine(1e-6);
            }
            if let Some(operator) = &answer.tangent {
                response.adopt(operator);
            }
            answer = match rules.next(error, self.pressure_share(&answer)) {
                ServoStep::Compress(strain) => self.trial(&self.isotropic(-strain), TangentKind::TrussLike)?,
                ServoStep::Careful => self.careful_step(&mut response, &answer)?,
                ServoStep::Plain { most, asks_operator } => {
                    let strain =
                        limited(&response.strain(&self.aim(&answer.stress), &answer.stress, LARGEST_STRAIN), most);
                    let kind = if asks_operator { TangentKind::TrussLike } else { TangentKind::None };
                    let next = self.trial(&strain, kind)?;
                    if next.tangent.is_none() {
                        response.learn(&strain, &difference(&next.stress, &answer.stress));
                    }
                    next
                }
            };
        }
        let (steps, error) = (self.limits.increments, self.stress_error(&answer.stress));
        Err(PackingError::Content(format!(
            "the stress did not reach the target in {steps} servo steps: it is off by {error:.1e} of the pressure, and unbalanced forces are \
             {:.1e} of the mean contact force",
            answer.scalars.unbalanced_force_ratio
        )))
    }

    fn flows(&self) -> PackingError {
        let [smallest, largest] = self.target.principal_pressures();
        PackingError::Content(format!(
            "the grains flow without reaching a stress whose smallest principal value is {:.2} of the largest, on the way to the stress that \
             is asked for: the friction between them does not bear it; ask for principal stresses that differ less, or raise that friction",
            smallest / largest
        ))
    }

    /// The stress that a step from `stress` aims at, Pa.
    fn aim(&self, stress: &Tensor2) -> Matrix {
        aim(&self.target, &turned_out(&self.target.deviator, &self.axes()), stress)
    }

    /// A step that is taken back and shortened until it brings the stress nearer to the target. Every miss teaches the
    /// response what lies between the two states that a plain servo jumps to and fro.
    fn careful_step(&mut self, response: &mut Response, before: &TrialResult) -> Result<TrialResult, PackingError> {
        let aimed = self.aim(&before.stress);
        let missing = |stress: &Tensor2| {
            let stress = rows(stress);
            largest_component::<Matrix>(&std::array::from_fn(|i| std::array::from_fn(|j| stress[i][j] - aimed[i][j])))
        };
        let mut most = LARGEST_STRAIN;
        for _ in 0..MOST_HALVINGS {
            let strain = response.strain(&aimed, &before.stress, most);
            let answer = self.trial(&strain, TangentKind::TrussLike)?;
            if missing(&answer.stress) < WORTHWHILE * missing(&before.stress) {
                return Ok(answer);
            }
            self.cell.rollback();
            response.learn(&strain, &difference(&answer.stress, &before.stress));
            most = 0.5 * largest_component(&strain);
        }
        let strain = response.strain(&aimed, &before.stress, most);
        self.trial(&strain, TangentKind::TrussLike)
    }
}

/// A strain cut to a largest component.
fn limited(strain: &Matrix, most: f64) -> Matrix {
    let largest = largest_component(strain);
    let share = if largest > most { most / largest } else { 1.0 };
    strain.map(|row| row.map(|value| share * value))
}

fn difference(after: &Tensor2, before: &Tensor2) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| after.get(i, j) - before.get(i, j)))
}
