//! The Gauss points of the body: their states, their evaluation by the material, and its cost.
//!
//! Every trial starts from the committed state. Within a step the number of ramp increments of a point is fixed, so
//! that its stress is one function of its target.

mod coupling;
mod evaluation;
mod parts;
mod point;
mod pore_fluid;
mod record;
mod secant;

pub(crate) use coupling::Coupling;
pub use coupling::CouplingSize;
pub(crate) use point::Point;
pub(crate) use record::{PointRecord, copy};

use crate::formulation::corotation::Polar;
use crate::formulation::{Formulation, Operator};
use crate::mesh::Dimension;
use crate::nonlocal::NonlocalLayer;
use crate::observer::FlagCounts;
use crate::problem::{Problem, Procedure, SecantSettings, Stage};
use nalgebra::Matrix3;
use protocol::{Cost, Observables};
use std::sync::Arc;

/// All Gauss points and the settings of their evaluation.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    points: Vec<Point>,
    dimension: Dimension,
    formulation: Formulation,
    observables: Observables,
    symmetric_stresses: bool,
    strain_per_step: f64,
    tangent_floor: Option<f64>,
    secant: Option<SecantSettings>,
    /// Whether carried secant corrections are in use: not while iterations do not contract.
    secants_hold: bool,
    keep_unchanged: bool,
    keep_still: bool,
    neighbours: Option<NonlocalLayer>,
    /// Of stages whose stiffness is needed.
    coupling: Option<Arc<Coupling>>,
    /// Strain increments of the latest evaluation before they were averaged; empty without neighbours.
    strains: Vec<Matrix3<f64>>,
    target_grid: Option<f64>,
    /// Size that targets are rounded to in this attempt; 0: not at all.
    grid: f64,
}

/// Secant corrections of a stage: none where no matrix is made of the moduli.
fn secant_of(stage: &Stage) -> Option<SecantSettings> {
    stage.strategy.secant.filter(|_| stage.procedure == Procedure::Implicit)
}

impl Points {
    /// Undeformed points.
    pub(crate) fn new(problem: &Problem) -> Self {
        let strategy = &problem.stages[0].strategy;
        let mut points = Self {
            points: vec![Point::new(); problem.point_count()],
            dimension: problem.mesh.dimension,
            formulation: problem.formulation,
            observables: problem.observables,
            symmetric_stresses: problem.symmetric_stresses,
            strain_per_step: problem.strain_per_step,
            tangent_floor: strategy.tangent_floor,
            secant: secant_of(&problem.stages[0]),
            secants_hold: true,
            keep_unchanged: strategy.keep_unchanged,
            keep_still: problem.keeps_still_points,
            neighbours: None,
            coupling: None,
            strains: Vec::new(),
            target_grid: strategy.target_grid,
            grid: 0.0,
        };
        points.choose_neighbours(problem, 0);
        points.close_pores(problem, 0);
        points
    }

    /// Closes the pores if their fluid cannot drain in a stage, the number `number` from 0.
    fn close_pores(&mut self, problem: &Problem, number: usize) {
        let Some(fluid) = problem.pore_fluid.filter(|fluid| fluid.from_stage <= number) else { return };
        self.points.iter_mut().for_each(|point| point.close_pores(problem.formulation, fluid.bulk_modulus));
    }

    /// Takes the neighbourhoods of a stage, the number `number` from 0. Increments of the step before are those of the elements,
    /// whatever they have been averaged over.
    fn choose_neighbours(&mut self, problem: &Problem, number: usize) {
        let stage = &problem.stages[number];
        let before = self.neighbours.take().map(|neighbours| neighbours.previous().to_vec());
        self.neighbours = coupling::neighbours(problem, stage).map(|mut neighbours| {
            before.into_iter().for_each(|strains| neighbours.commit(strains));
            neighbours
        });
        self.strains = Vec::new();
        let is_implicit = stage.procedure == Procedure::Implicit;
        let coupled = self.neighbours.as_ref().filter(|_| is_implicit);
        self.coupling = coupled.map(|neighbours| Arc::new(Coupling::new(&problem.mesh, neighbours)));
        if self.coupling.is_none() {
            self.points.iter_mut().for_each(|point| point.averaged = None);
        }
    }

    /// Prepares for the stage behind the present one. Corrections go on only where both carry them: others are those of tangents long past.
    pub(crate) fn leave_stage(&mut self, next: &Stage) {
        let carries = |secant: Option<SecantSettings>| secant.is_some_and(|secant| secant.carried);
        if !(carries(self.secant) && carries(secant_of(next))) {
            self.forget_corrections();
        }
    }

    /// Takes the settings of a stage of the problem, the number `number` from 0.
    pub(crate) fn choose(&mut self, problem: &Problem, number: usize) {
        let stage = &problem.stages[number];
        let strategy = &stage.strategy;
        self.close_pores(problem, number);
        self.choose_neighbours(problem, number);
        self.tangent_floor = strategy.tangent_floor;
        self.secant = secant_of(stage);
        self.keep_unchanged = strategy.keep_unchanged;
        self.target_grid = strategy.target_grid;
        self.grid = 0.0;
    }

    /// Takes up the shares by which friction is reduced at a moment, by point; none: it is that of the definitions.
    pub(crate) fn set_friction(&mut self, reductions: &[f64]) {
        for (number, point) in self.points.iter_mut().enumerate() {
            let reduction = reductions.get(number).copied().unwrap_or(0.0);
            if point.friction_reduction != reduction {
                point.friction_reduction = reduction;
                // The latest result is that of another friction.
                point.held = None;
            }
        }
    }

    /// Strain of one ramp increment.
    pub(crate) fn strain_per_step(&self) -> f64 {
        self.strain_per_step
    }

    /// Changes the strain of one ramp increment, from the next attempt on.
    pub(crate) fn set_strain_per_step(&mut self, strain_per_step: f64) {
        self.strain_per_step = strain_per_step;
    }

    /// The points, by number.
    pub(crate) fn all(&self) -> &[Point] {
        &self.points
    }

    /// Stress and moduli of a point as the element integrals need them, its pore fluid included; `averaged` are the Cauchy stresses
    /// that take the place of those of the points, see [`Points::integrated_stresses`]. What the motion of other points changes is
    /// not in the moduli, see [`Points::coupling`].
    pub(crate) fn integrand(&self, number: usize, averaged: Option<&[Matrix3<f64>]>) -> (Matrix3<f64>, Operator) {
        let (point, formulation) = (&self.points[number], self.formulation);
        let mut response = point.response.clone();
        if let Some(stresses) = averaged {
            response.stress = stresses[number];
        }
        if let Some(coupling) = self.coupling() {
            let geometric = formulation.geometric_moduli(&response.stress);
            response.moduli = if coupling.integrates_averages() {
                geometric - formulation.volumetric_moduli(&response.stress)
            } else {
                geometric + point.averaged(formulation).own
            };
        }
        point.integrand(formulation, response)
    }

    /// Prepares the points for an attempt whose first iterate has these displacement gradients.
    pub(crate) fn begin_attempt(&mut self, predicted: &[Matrix3<f64>]) {
        self.fix_ramps(predicted);
        let largest = predicted.iter().map(Matrix3::amax).fold(0.0, f64::max);
        // A power of two, so that rounding to it is exact.
        self.grid = match self.target_grid {
            Some(share) if largest > 0.0 => (share * largest).log2().floor().exp2(),
            _ => 0.0,
        };
        if self.secant.is_some_and(|secant| secant.carried) {
            for (point, gradient) in self.points.iter_mut().zip(predicted) {
                point.start_samples(gradient);
            }
        }
    }

    /// Displacement gradients as they are sent to the points.
    pub(crate) fn rounded(&self, mut gradients: Vec<Matrix3<f64>>) -> Vec<Matrix3<f64>> {
        if self.grid > 0.0 {
            for gradient in &mut gradients {
                gradient.apply(|component| *component = (*component / self.grid).round() * self.grid);
            }
        }
        gradients
    }

    /// Fixes every point's ramp for the coming attempt from its predicted displacement gradient.
    pub(crate) fn fix_ramps(&mut self, predicted: &[Matrix3<f64>]) {
        if self.strain_per_step == 0.0 {
            return;
        }
        // What the material is asked for counts: no rotation that it does not see, and strains of neighbours reach a point that does not
        // strain itself. A point that is turned inside out is reported by its evaluation.
        let seen = self.average_strains(predicted).ok().flatten();
        for (number, (point, gradient)) in self.points.iter_mut().zip(predicted).enumerate() {
            let target = match &seen {
                Some(seen) => self.formulation.target_of_strain(&point.deformation, gradient, &seen[number]),
                None => self.formulation.target(&point.deformation, gradient),
            };
            let largest = largest_stretch(&target.unwrap_or(*gradient));
            let ramp_steps = (largest / self.strain_per_step).round().clamp(1.0, f64::from(u32::MAX)) as u32;
            if ramp_steps != point.ramp_steps {
                // Another ramp is another function: earlier answers of this step do not belong to it.
                point.ramp_steps = ramp_steps;
                point.held = None;
                point.last_sample = None;
            }
        }
    }

    /// The latest targets have become the committed states.
    pub(crate) fn commit(&mut self, gradients: &[Matrix3<f64>]) {
        for (point, gradient) in self.points.iter_mut().zip(gradients) {
            point.deformation = self.formulation.deformation(&point.deformation, gradient);
            point.trial_deformation = point.deformation;
            point.last_step = *gradient;
            point.committed_stress = point.response.stress;
            point.committed_reduction = point.answered_reduction;
        }
        if let Some(neighbours) = &mut self.neighbours {
            neighbours.commit(std::mem::take(&mut self.strains));
        }
        self.forget_trials();
    }

    /// The material has dropped its trials.
    pub(crate) fn forget_trials(&mut self) {
        for point in &mut self.points {
            point.held = None;
            point.last_sample = None;
            point.answered_reduction = point.committed_reduction;
        }
    }

    /// Whether carried secant corrections hold for the coming evaluation. Where cells snap they are those of another branch: iterations then
    /// do without, and what has been carried is dropped.
    pub(crate) fn let_secants_hold(&mut self, hold: bool) {
        self.secants_hold = hold;
    }

    /// Drops carried corrections, which have led an attempt astray or are those of another way of solving.
    pub(crate) fn forget_corrections(&mut self) {
        for point in &mut self.points {
            point.correction = None;
        }
    }

    /// Returns to an earlier state, of which `before` is a copy; what evaluations have cost since then stays counted.
    pub(crate) fn return_to(&mut self, before: Self) {
        let later = std::mem::replace(self, before);
        for (point, later) in self.points.iter_mut().zip(later.points) {
            (point.step_evaluations, point.evaluations) = (later.step_evaluations, later.evaluations);
            (point.step_cost, point.cost) = (later.step_cost, later.cost);
        }
        // The material has dropped what it had been asked when the points were kept.
        self.forget_trials();
    }

    /// Starts the counters of a new step.
    pub(crate) fn start_step(&mut self) {
        for point in &mut self.points {
            point.step_evaluations = 0;
            point.step_cost = Cost::default();
        }
    }

    /// Shortcuts in the latest answers.
    pub(crate) fn flags(&self) -> FlagCounts {
        let mut counts = FlagCounts::default();
        self.points.iter().filter_map(|point| point.answer.as_ref()).for_each(|answer| counts.add(answer.flags));
        counts
    }
}

/// Largest component of the stretch of a target less the identity: what a cell is strained by. It is turned along for nothing.
fn largest_stretch(target: &Matrix3<f64>) -> f64 {
    if *target == target.transpose() {
        return target.amax();
    }
    let identity = Matrix3::identity();
    Polar::of(&(identity + target)).map_or(target.amax(), |polar| (polar.stretch - identity).amax())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;
    use crate::problem::relaxation::RelaxationSettings;
    use protocol::{Observed, Scalars, TangentKind, Tensor2, TrialFlags, TrialResult};

    fn stage(secant: Option<SecantSettings>, procedure: Procedure) -> Stage {
        let mut stage = Stage::new("stage", Vec::new());
        (stage.strategy.secant, stage.procedure) = (secant, procedure);
        stage
    }

    /// Corrections that no stage carries were added to the moduli for good.
    #[test]
    fn corrections_go_on_from_one_stage_that_carries_them_to_the_next_alone() {
        let carried = SecantSettings { carried: true, ..SecantSettings::default() };
        let carrying = || stage(Some(carried), Procedure::Implicit);
        let relaxed = || stage(Some(carried), Procedure::Relaxation(RelaxationSettings::default()));
        let fresh = || stage(Some(SecantSettings::default()), Procedure::Implicit);
        let goes_on = |from: Stage, to: Stage| {
            let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh().unwrap();
            let mut problem = Problem::new(mesh, Vec::new());
            problem.stages = vec![from, to];
            let mut points = Points::new(&problem);
            points.points[0].correction = Some(Box::new(Operator::identity()));
            points.leave_stage(&problem.stages[1]);
            points.choose(&problem, 1);
            points.points[0].correction.is_some()
        };
        assert!(goes_on(carrying(), carrying()));
        assert!(!goes_on(carrying(), fresh()));
        assert!(!goes_on(carrying(), relaxed()));
        assert!(!goes_on(relaxed(), carrying()));
    }

    /// An attempt with whole friction that is taken back leaves the state of the friction before: the next one has to ask again.
    #[test]
    fn attempts_that_are_taken_back_leave_the_friction_of_the_committed_state() {
        let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh().unwrap();
        let mut points = Points::new(&Problem::new(mesh, Vec::new()));
        let still = Matrix3::zeros();
        let count = points.points.len();
        let answered = |points: &mut Points, reduction: f64| {
            points.set_friction(&vec![reduction; count]);
            let answer = TrialResult {
                stress: Tensor2([0.0; 9]),
                tangent: None,
                scalars: Scalars::default(),
                observed: Observed::default(),
                cost: Cost::default(),
                flags: TrialFlags::default(),
            };
            points.points[0].hold(Formulation::SmallStrain, &still, TangentKind::None, answer);
        };
        let rests = |points: &Points| points.points[0].rests(&still, None, TangentKind::None);
        answered(&mut points, 0.5);
        points.commit(&vec![still; count]);
        answered(&mut points, 0.0);
        points.forget_trials();
        assert!(!rests(&points));
        answered(&mut points, 0.0);
        points.commit(&vec![still; count]);
        assert!(rests(&points));
    }
}
