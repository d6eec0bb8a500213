//! A cell in preparation: compressed, sheared, brought to a stress and written as a packing.

mod as_packing;
mod servo_steps;
#[cfg(test)]
mod tests;
mod to_stress;

pub(crate) use servo_steps::StepsWithoutPressure;

use super::first_vectors::FirstVectors;
use super::progress::{PackingProgress, ProgressLog};
use super::servo::{ServoLimits, pressure};
use super::stress_target::{Matrix, StressTarget, symmetric, turned_in, turned_out};
use crate::cell::Cell;
use crate::contact::{ContactTable, Rotations};
use crate::definition::{GrainDefinition, PackingError, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::solver::SolverFor;
use crate::space::{Space, Tensor};
use crate::tangent::Closeness;
use protocol::{Observables, RveError, RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};

/// First isotropic compression per increment; grains move by a hundredth of a radius or so.
const FIRST_COMPRESSION: f64 = 5e-3;

/// No increment is halved below this.
const LEAST_COMPRESSION: f64 = 1e-8;

/// After an increment that was taken the next one is at least this: halving must not bring the compression to a stop.
const LEAST_NEXT_COMPRESSION: f64 = 1e-6;

/// Share of the target pressure at which the compression hands over to the servo.
const HANDOVER: [f64; 2] = [0.02, 0.2];

/// Most times that a cell of spheres that carries load is given more time to come to rest in one increment.
const MOST_SETTLINGS: u32 = 10;

/// Most increments of either stage.
const MOST_INCREMENTS: u32 = 5_000;

/// Largest strain of the servo from the first load on. Packings take some per cent to their stress; grains that cannot carry it flow until
/// a few of them bridge a flat cell.
const MOST_STRAIN_OF_SERVO: f64 = 0.4;

/// Tangential over normal stiffness that the servo assumes of contacts without tangential springs, and of stiffer ones without friction.
const ASSUMED_SPRINGS: f64 = 0.5;

/// Strain whose only purpose is that the grains are brought to rest.
const TOUCH: f64 = 1e-9;

/// How far from the target a compaction may end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerances {
    /// Largest unbalanced force over mean normal contact force.
    pub(crate) force: f64,
    /// Largest deviation of a stress component over the target pressure.
    pub(crate) stress: f64,
}

/// How far from its target stress, and from rest, a packing may end that was brought to another stress or weakened.
pub(crate) const TOLERANCES_OF_CHANGED_PACKINGS: Tolerances = Tolerances { force: 1e-8, stress: 1e-6 };

/// A cell with a target stress.
pub(crate) struct Compaction<'a, S: SolverFor> {
    cell: GrainRve<S>,
    /// The vectors that the packing was given with: its axes are theirs, whatever describes the lattice now.
    first_vectors: FirstVectors,
    /// Whether grains may not turn: nothing balances the moments on them, and only the symmetric part of the stress obeys the strain.
    has_couples: bool,
    /// The vectors of the committed cell as the latest trial has carried them along, m, by rows.
    carried: S::Tensor,
    target: StressTarget,
    tolerances: Tolerances,
    limits: ServoLimits<S>,
    log: &'a ProgressLog<'a>,
}

impl<'a, S: SolverFor> Compaction<'a, S> {
    /// Takes grains over, wherever they are.
    ///
    /// # Errors
    /// [`PackingError::Content`].
    pub(crate) fn new(
        packing: PackingFile<S>,
        contact: &ContactTable,
        target: StressTarget,
        tolerances: Tolerances,
        log: &'a ProgressLog<'a>,
    ) -> Result<Self, PackingError> {
        let mut contact = contact.clone();
        if contact.rotations == Rotations::InnerBlocked {
            // A periodic cell has no boundary: all its grains are inner ones until a frame is cut from it.
            contact.rotations = Rotations::Blocked;
        }
        let has_couples = contact.rotations == Rotations::Blocked;
        let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
        let mut cell = GrainRve::<S>::new(&definition).map_err(packing_error)?;
        let first_vectors = FirstVectors::new::<S>(&definition.packing.periodicity, &cell.committed().cell.rows);
        cell.solve_operators_to(Closeness::RESULT);
        if S::DIMENSION == 2 {
            // The servo of spheres learns from its steps and reaches more targets with what their own operator says.
            cell.assume_springs_in_operators(ASSUMED_SPRINGS);
        }
        let limits =
            ServoLimits::increments_and_strain(MOST_INCREMENTS, cell.committed().cell.rows, MOST_STRAIN_OF_SERVO);
        let carried = cell.committed().cell.rows;
        Ok(Self { cell, first_vectors, has_couples, carried, target, tolerances, limits, log })
    }

    /// Gives the cell another target, for `most_increments` servo steps and `most_strain` from here on: grains that flow at a lower stress than
    /// the target would otherwise be sheared on for as long as there are steps.
    pub(crate) fn aim_at(
        &mut self,
        target: StressTarget,
        tolerances: Tolerances,
        most_increments: u32,
        most_strain: f64,
    ) {
        (self.target, self.tolerances) = (target, tolerances);
        self.limits =
            ServoLimits::increments_and_strain(most_increments, self.cell.committed().cell.rows, most_strain);
    }

    /// Isotropic compression until the grains carry load; increments that overshoot are taken back and halved.
    ///
    /// # Errors
    /// [`PackingError::Content`] if no pressure is reached.
    pub(crate) fn compress(&mut self) -> Result<(), PackingError> {
        self.cell.set_options(RveOptions {
            strain_per_step: Some(2e-4),
            tolerance: Some(1e-2),
            max_steps: Some(2_000),
            ..RveOptions::default()
        });
        let mut compression = FIRST_COMPRESSION;
        for increment in 0..MOST_INCREMENTS {
            let before = (S::DIMENSION == 3).then(|| (self.cell.clone(), self.first_vectors));
            let mut answer = self.trial(&self.isotropic(-compression), TangentKind::None)?;
            if before.is_some() {
                answer = self.settled(answer)?;
            }
            let share = self.pressure_share(&answer);
            // Grains that snap across the window at the smallest increment are taken as they lie.
            if share > HANDOVER[1] && compression > LEAST_COMPRESSION {
                match before {
                    Some(before) => (self.cell, self.first_vectors) = before,
                    None => self.cell.rollback(),
                }
                compression *= 0.5;
                continue;
            }
            self.commit()?;
            self.report("compression", increment, &answer);
            if share > HANDOVER[0] {
                // The strain of the servo counts from here.
                let rows = self.cell.committed().cell.rows;
                self.limits = ServoLimits::increments_and_strain(self.limits.increments, rows, MOST_STRAIN_OF_SERVO);
                return Ok(());
            }
            compression = compression.max(LEAST_NEXT_COMPRESSION);
        }
        Err(PackingError::Content(format!("compression did not reach a pressure in {MOST_INCREMENTS} increments")))
    }

    /// A trial of a cell that carries load, given time to come to rest: near jamming forces die away slowly, and would be
    /// taken for the pressure of a packing.
    fn settled(&mut self, mut answer: TrialResult) -> Result<TrialResult, PackingError> {
        for _ in 0..MOST_SETTLINGS {
            let is_at_rest = !answer.flags.contains(TrialFlags::NOT_EQUILIBRATED);
            if is_at_rest || self.pressure_share(&answer) < HANDOVER[0] {
                break;
            }
            self.commit()?;
            answer = self.trial(&self.isotropic(-TOUCH), TangentKind::None)?;
        }
        Ok(answer)
    }

    fn pressure_share(&self, answer: &TrialResult) -> f64 {
        pressure(&answer.stress, self.target.dimension) / self.target.pressure
    }

    /// Strains the cell by a symmetric tensor given in the cell's own axes.
    ///
    /// # Errors
    /// [`PackingError::Content`].
    pub(crate) fn strain(&mut self, strain: &Matrix) -> Result<(), PackingError> {
        self.refine(2e-6);
        let answer = self.trial(&turned_out(strain, &self.axes()), TangentKind::None)?;
        self.commit()?;
        self.report("shear", 0, &answer);
        Ok(())
    }

    /// Contact fabric minus its mean part, in the cell's own axes.
    ///
    /// # Errors
    /// Contact forces that are not finite.
    pub(crate) fn fabric_deviator(&mut self) -> Result<Matrix, PackingError> {
        let fabric = self.cell.observe(Observables::FABRIC).map_err(packing_error)?.observed.fabric;
        let mut deviator = turned_in(&rows(&fabric), &self.axes());
        let mean = (0..self.target.dimension).map(|i| deviator[i][i]).sum::<f64>() / self.target.dimension as f64;
        for (i, row) in deviator.iter_mut().enumerate().take(self.target.dimension) {
            row[i] -= mean;
        }
        Ok(deviator)
    }

    fn isotropic(&self, strain: f64) -> Matrix {
        let mut matrix = [[0.0; 3]; 3];
        for (i, row) in matrix.iter_mut().enumerate().take(self.target.dimension) {
            row[i] = strain;
        }
        matrix
    }

    fn refine(&mut self, strain_per_step: f64) {
        self.cell.set_options(RveOptions {
            strain_per_step: Some(strain_per_step),
            tolerance: Some(self.tolerances.force),
            max_steps: Some(100_000),
            ..RveOptions::default()
        });
    }

    fn trial(&mut self, strain: &Matrix, tangent: TangentKind) -> Result<TrialResult, PackingError> {
        let target = Tensor2::from_rows(strain);
        let options = TrialOptions { tangent, ..TrialOptions::default() };
        let mut answer = self.cell.trial(&target, &options).map_err(packing_error)?;
        self.log.spend(answer.cost.force_evaluations);
        if self.has_couples {
            answer.stress = Tensor2::from_rows(&symmetric(&rows(&answer.stress)));
        }
        self.carried = carried_along::<S>(&self.cell.committed().cell, strain);
        Ok(answer)
    }

    /// Makes the latest trial the state.
    fn commit(&mut self) -> Result<(), PackingError> {
        self.cell.commit().map_err(packing_error)?;
        self.first_vectors.follow::<S>(&self.carried, &self.cell.committed().cell.rows);
        Ok(())
    }

    fn report(&self, stage: &'static str, increment: u32, answer: &TrialResult) {
        let stress_error = self.stress_error(&answer.stress);
        self.log.report(PackingProgress {
            attempt: 0,
            stage,
            increment,
            solid_fraction: 1.0 / (1.0 + answer.scalars.void_ratio),
            pressure: pressure(&answer.stress, self.target.dimension),
            stress_error,
            unbalanced_force_ratio: answer.scalars.unbalanced_force_ratio,
        });
    }
}

/// Vectors of a cell, m, by rows, after a displacement gradient.
fn carried_along<S: Space>(cell: &Cell<S>, gradient: &Matrix) -> S::Tensor {
    cell.deformed(&S::Tensor::from_fn(|i, j| gradient[i][j] + if i == j { 1.0 } else { 0.0 })).rows
}

/// A tensor by its rows.
pub(crate) fn rows(tensor: &Tensor2) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| tensor.get(i, j)))
}

/// What an engine says of a cell in preparation.
pub(crate) fn packing_error(error: RveError) -> PackingError {
    PackingError::Content(error.to_string())
}
