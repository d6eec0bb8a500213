//! The Gauss points as the solver sees them: what was asked of each, what it answered, and what it has cost.
//!
//! Every trial starts from the committed state. Within a step the number of ramp increments of a point is fixed, so
//! that its stress is one function of its target.

mod parts;
mod record;
mod secant;

pub(crate) use record::{PointRecord, copy};

use crate::formulation::tensor::{matrix, operator, tensor};
use crate::formulation::{Formulation, Operator, Response};
use crate::material::{MaterialError, PointMaterial, PointTrial};
use crate::mesh::Dimension;
use crate::mesh::point_places;
use crate::model::failure::{Failure, failure};
use crate::nonlocal::NonlocalLayer;
use crate::observer::{FlagCounts, Statistics};
use crate::problem::{Problem, SecantGates, Stage};
use nalgebra::Matrix3;
use protocol::{Ask, Cost, Observables, TangentKind, TrialAnswer};
use secant::{ReferenceModuli, Sample, corrected, floored};

/// One Gauss point.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    /// Committed total deformation gradient.
    pub(crate) deformation: Matrix3<f64>,
    /// Stress and moduli of the latest evaluation, secant correction included.
    pub(crate) response: Response,
    /// Committed stress, Pa.
    committed_stress: Matrix3<f64>,
    /// Total deformation gradient at the latest evaluation.
    trial_deformation: Matrix3<f64>,
    /// Latest answer.
    pub(crate) answer: Option<TrialAnswer>,
    /// Evaluations in this step.
    pub(crate) step_evaluations: u64,
    /// Evaluations since the start.
    pub(crate) evaluations: u64,
    /// Cost in this step.
    pub(crate) step_cost: Cost,
    /// Cost since the start.
    pub(crate) cost: Cost,
    tangent: Operator,
    reference: Option<ReferenceModuli>,
    ramp_steps: u32,
    /// Gradient whose answer stands.
    held: Option<Matrix3<f64>>,
    last_sample: Option<Sample>,
    /// Carried secant corrections of the moduli.
    correction: Option<Box<Operator>>,
    /// Displacement gradient of the last accepted step.
    last_step: Matrix3<f64>,
}

impl Point {
    fn new() -> Self {
        Self {
            deformation: Matrix3::identity(),
            committed_stress: Matrix3::zeros(),
            response: Response { stress: Matrix3::zeros(), moduli: Operator::zeros() },
            trial_deformation: Matrix3::identity(),
            answer: None,
            step_evaluations: 0,
            evaluations: 0,
            step_cost: Cost::default(),
            cost: Cost::default(),
            tangent: Operator::zeros(),
            reference: None,
            ramp_steps: 0,
            held: None,
            last_sample: None,
            correction: None,
            last_step: Matrix3::zeros(),
        }
    }

    /// Starts the pairs of an attempt: carried corrections learn from the step as a whole too, but not across a turning
    /// point of the load, where all contacts that slid stick again.
    fn start_samples(&mut self, gradient: &Matrix3<f64>) {
        if self.last_step.dot(gradient) < 0.0 {
            self.correction = None;
        }
        self.last_sample = Some(Sample::committed(&self.committed_stress));
    }

    /// Lamé modulus and shear modulus of an isotropic solid as stiff as the first tangent, Pa; 0 before it.
    pub(crate) fn first_moduli(&self) -> [f64; 2] {
        // Grains under a high stress ratio may be stiffer in shear than isotropic solids are.
        self.reference.map_or([0.0; 2], |reference| {
            let shear = reference.shear.min(0.5 * reference.vertical);
            [reference.vertical - 2.0 * shear, shear]
        })
    }

    /// Mean shear modulus of the first tangent, Pa; 0 before it.
    pub(crate) fn first_shear_modulus(&self) -> f64 {
        self.reference.map_or(0.0, |reference| reference.shear)
    }

    /// A Cauchy stress of the point at its latest evaluation as the element integrals need it.
    pub(crate) fn nominal(&self, formulation: Formulation, stress: &Matrix3<f64>) -> Matrix3<f64> {
        formulation
            .nominal_stress(&self.trial_deformation, stress)
            .expect("a point that is turned inside out is never evaluated")
    }

    /// Stress and moduli of the latest evaluation as the element integrals need them.
    pub(crate) fn integrand(&self, formulation: Formulation) -> (Matrix3<f64>, Operator) {
        formulation
            .integrand(&self.trial_deformation, &self.response)
            .expect("a point that is turned inside out is never evaluated")
    }
}

impl Point {
    /// Whether nothing happens to the point in a step without a tangent: its last answer stays true.
    fn rests(&self, gradient: &Matrix3<f64>, strain: Option<Matrix3<f64>>, tangent: TangentKind) -> bool {
        let zero = Matrix3::zeros();
        let is_still = *gradient == zero && strain.is_none_or(|strain| strain == zero);
        tangent == TangentKind::None
            && is_still
            && self.answer.is_some()
            && self.trial_deformation == self.deformation
    }

    /// Takes up an answer to the step gradient `gradient`.
    fn hold(&mut self, formulation: Formulation, gradient: &Matrix3<f64>, answer: TrialAnswer) {
        self.trial_deformation = formulation.deformation(&self.deformation, gradient);
        self.held = Some(*gradient);
        self.answer = Some(answer);
    }
}

fn inside_out(number: usize) -> Failure {
    Failure::Attempt(format!("Gauss point {number} is turned inside out"))
}

/// All Gauss points and the choices that govern their evaluation.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    points: Vec<Point>,
    dimension: Dimension,
    formulation: Formulation,
    observables: Observables,
    strain_per_step: f64,
    tangent_floor: Option<f64>,
    secant: Option<SecantGates>,
    keep_unchanged: bool,
    neighbours: Option<NonlocalLayer>,
    /// Strain increments of the latest evaluation before they were averaged; empty without neighbours.
    strains: Vec<Matrix3<f64>>,
    target_grid: Option<f64>,
    /// Size that targets are rounded to in this attempt; 0: not at all.
    grid: f64,
}

impl Points {
    /// Undeformed points.
    pub(crate) fn new(problem: &Problem) -> Self {
        let strategy = &problem.stages[0].strategy;
        Self {
            points: vec![Point::new(); problem.point_count()],
            dimension: problem.mesh.dimension,
            formulation: problem.formulation,
            observables: problem.observables,
            strain_per_step: problem.strain_per_step,
            tangent_floor: strategy.tangent_floor,
            secant: strategy.secant,
            keep_unchanged: strategy.keep_unchanged,
            neighbours: problem.nonlocal.as_ref().map(|settings| {
                let periods = problem.periods(&problem.stages[0]).expect("checked before the run");
                NonlocalLayer::new(&point_places(&problem.mesh), &periods, settings).expect("checked before the run")
            }),
            strains: Vec::new(),
            target_grid: strategy.target_grid,
            grid: 0.0,
        }
    }

    /// Takes up the choices of a stage.
    pub(crate) fn choose(&mut self, problem: &Problem, stage: &Stage) {
        let strategy = &stage.strategy;
        if let Some(neighbours) = &mut self.neighbours {
            let periods = problem.periods(stage).expect("checked before the run");
            let places = point_places(&problem.mesh);
            *neighbours = neighbours.with_periods(&places, &periods).expect("checked before the run");
        }
        self.tangent_floor = strategy.tangent_floor;
        self.secant = strategy.secant;
        self.keep_unchanged = strategy.keep_unchanged;
        self.target_grid = strategy.target_grid;
        self.grid = 0.0;
    }

    /// The points, by number.
    pub(crate) fn all(&self) -> &[Point] {
        &self.points
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
        if self.secant.is_some_and(|gates| gates.carried) {
            for (point, gradient) in self.points.iter_mut().zip(predicted) {
                point.start_samples(gradient);
            }
        }
    }

    /// Displacement gradients as points are asked for them.
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
        // What neighbours do reaches a point that does not strain itself. A point that is turned inside out is told of
        // when it is asked.
        let seen = self.average_strains(predicted).ok().flatten();
        for (number, (point, gradient)) in self.points.iter_mut().zip(predicted).enumerate() {
            let averaged = seen
                .as_ref()
                .and_then(|seen| self.formulation.target_of_strain(&point.deformation, gradient, &seen[number]));
            let largest = averaged.map_or(gradient.amax(), |target| target.amax());
            let ramp_steps = (largest / self.strain_per_step).round().clamp(1.0, f64::from(u32::MAX)) as u32;
            if ramp_steps != point.ramp_steps {
                // Another ramp is another function: earlier answers of this step do not belong to it.
                point.ramp_steps = ramp_steps;
                point.held = None;
                point.last_sample = None;
            }
        }
    }

    /// Asks every point whose target has changed.
    ///
    /// # Errors
    /// [`Failure::Attempt`] if a smaller step may help, otherwise the end of the run.
    pub(crate) fn evaluate(
        &mut self,
        gradients: &[Matrix3<f64>],
        tangent: TangentKind,
        material: &mut dyn PointMaterial,
        statistics: &mut Statistics,
    ) -> Result<EvaluationCounts, Failure> {
        self.evaluate_by(gradients, tangent, statistics, |_, trials, _| material.evaluate(trials))
    }

    /// The same where the step cannot be made smaller: a point that refuses its trial goes there in parts, see
    /// [`Points::answers_in_parts`].
    ///
    /// # Errors
    /// [`Failure::Attempt`] if smaller parts do not help, otherwise the end of the run.
    pub(crate) fn evaluate_in_parts(
        &mut self,
        gradients: &[Matrix3<f64>],
        tangent: TangentKind,
        material: &mut dyn PointMaterial,
        statistics: &mut Statistics,
    ) -> Result<EvaluationCounts, Failure> {
        self.evaluate_by(gradients, tangent, statistics, |points, trials, statistics| {
            points.answers_in_parts(trials, material, statistics)
        })
    }

    fn evaluate_by(
        &mut self,
        gradients: &[Matrix3<f64>],
        tangent: TangentKind,
        statistics: &mut Statistics,
        answers: impl FnOnce(&mut Self, &mut [PointTrial], &mut Statistics) -> Result<Vec<TrialAnswer>, MaterialError>,
    ) -> Result<EvaluationCounts, Failure> {
        let mut trials = Vec::with_capacity(gradients.len());
        let seen = self.average_strains(gradients)?;
        for (number, (point, gradient)) in self.points.iter_mut().zip(gradients).enumerate() {
            let is_held = seen.is_none() && point.held.as_ref() == Some(gradient);
            let strain = seen.as_ref().map(|seen| seen[number]);
            if self.keep_unchanged && (is_held || point.rests(gradient, strain, tangent)) {
                continue;
            }
            let target = match strain {
                None => self.formulation.target(&point.deformation, gradient),
                Some(strain) => self.formulation.target_of_strain(&point.deformation, gradient, &strain),
            };
            let target = target.ok_or_else(|| inside_out(number))?;
            // Until its answer is in, the material's latest trial of this point is unknown.
            point.held = None;
            let ask = Ask { tangent, ramp_steps: point.ramp_steps, observables: self.observables };
            trials.push(PointTrial { point: number, target: tensor(&target), ask });
        }
        let counts =
            EvaluationCounts { evaluated: trials.len() as u64, skipped: (gradients.len() - trials.len()) as u64 };
        statistics.skipped += counts.skipped;
        if trials.is_empty() {
            return Ok(counts);
        }
        let answers = answers(self, &mut trials, statistics).map_err(|error| {
            statistics.unfinished_trials += u64::from(error.is_unfinished_trial());
            failure(error)
        })?;
        assert_eq!(answers.len(), trials.len(), "a material answers every trial");
        for (trial, answer) in trials.iter().zip(answers) {
            self.count(trial.point, &answer, statistics);
            self.take(trial, &gradients[trial.point], answer, statistics)?;
        }
        Ok(counts)
    }

    /// What the points see of the strain increments of the elements; `None` without neighbours.
    fn average_strains(&mut self, gradients: &[Matrix3<f64>]) -> Result<Option<Vec<Matrix3<f64>>>, Failure> {
        let Some(neighbours) = &self.neighbours else { return Ok(None) };
        let strain = |(number, gradient): (usize, &Matrix3<f64>)| {
            let strain = self.formulation.strain(&self.points[number].deformation, gradient);
            strain.ok_or_else(|| inside_out(number))
        };
        self.strains = gradients.iter().enumerate().map(strain).collect::<Result<_, _>>()?;
        Ok(Some(neighbours.seen(&self.strains)))
    }

    /// Cauchy stresses that the elements integrate in place of those of their points, for volumes of the points in m3;
    /// `None`: their own.
    pub(crate) fn integrated_stresses(&self, volumes: impl Iterator<Item = f64>) -> Option<Vec<Matrix3<f64>>> {
        let neighbours = self.neighbours.as_ref().filter(|neighbours| neighbours.is_adjoint())?;
        let stresses: Vec<Matrix3<f64>> = self.points.iter().map(|point| point.response.stress).collect();
        Some(neighbours.integrated(&stresses, &volumes.collect::<Vec<f64>>()))
    }

    fn count(&mut self, number: usize, answer: &TrialAnswer, statistics: &mut Statistics) {
        let point = &mut self.points[number];
        point.evaluations += 1;
        point.step_evaluations += 1;
        for total in [&mut point.cost, &mut point.step_cost, &mut statistics.cost] {
            add_cost(total, &answer.cost);
        }
        statistics.evaluations += 1;
        statistics.evaluations_per_point[number] += 1;
        statistics.trial_costs.add(answer.cost.force_evaluations);
        statistics.flags.add(answer.flags);
        statistics.tangents += u64::from(answer.tangent.is_some());
    }

    fn take(
        &mut self,
        trial: &PointTrial,
        gradient: &Matrix3<f64>,
        answer: TrialAnswer,
        statistics: &mut Statistics,
    ) -> Result<(), Failure> {
        let finite = answer.stress.is_finite() && answer.tangent.as_ref().is_none_or(|tangent| tangent.is_finite());
        if !finite {
            return Err(Failure::Attempt(format!(
                "Gauss point {} answered with a number that is not finite",
                trial.point
            )));
        }
        statistics.asymmetric_stresses += u64::from(is_asymmetric(&matrix(&answer.stress)));
        let (dimension, formulation) = (self.dimension, self.formulation);
        let point = &mut self.points[trial.point];
        if trial.ask.tangent == TangentKind::None {
            let stress = formulation.cauchy(&point.deformation, gradient, &matrix(&answer.stress));
            point.response.stress = stress.ok_or_else(|| inside_out(trial.point))?;
            point.hold(formulation, gradient, answer);
            return Ok(());
        }
        if let Some(tangent) = &answer.tangent {
            point.tangent = operator(tangent);
        }
        let reference = *point.reference.get_or_insert_with(|| ReferenceModuli::of(dimension, &point.tangent));
        let mut response = formulation
            .response(&point.deformation, gradient, &matrix(&answer.stress), &point.tangent)
            .ok_or_else(|| inside_out(trial.point))?;
        let floor = self.tangent_floor.and_then(|floor| floored(dimension, &response.moduli, &reference, floor));
        if let Some(moduli) = floor {
            response.moduli = moduli;
            statistics.floored_tangents += 1;
        }
        if let Some(gates) = self.secant {
            let plain = response.moduli;
            if let Some(correction) = &point.correction {
                response.moduli += correction.as_ref();
            }
            let sample = Sample::new(formulation, gradient, &response.stress);
            if let (Some(last), Some(sample)) = (&point.last_sample, &sample) {
                match corrected(dimension, &response.moduli, last, sample, &reference, &gates) {
                    Some(moduli) => {
                        response.moduli = moduli;
                        statistics.secant_corrections += 1;
                    }
                    None => statistics.secant_refusals += 1,
                }
            }
            if gates.carried {
                point.correction = Some(Box::new(response.moduli - plain));
            }
            point.last_sample = sample;
        }
        point.response = response;
        point.hold(formulation, gradient, answer);
        Ok(())
    }

    /// The latest targets have become the committed states.
    pub(crate) fn commit(&mut self, gradients: &[Matrix3<f64>]) {
        for (point, gradient) in self.points.iter_mut().zip(gradients) {
            point.deformation = self.formulation.deformation(&point.deformation, gradient);
            point.trial_deformation = point.deformation;
            point.last_step = *gradient;
            point.committed_stress = point.response.stress;
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
        }
    }

    /// Drops carried corrections: they have led an attempt astray.
    pub(crate) fn forget_corrections(&mut self) {
        for point in &mut self.points {
            point.correction = None;
        }
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

/// One evaluation of all points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EvaluationCounts {
    /// Points evaluated.
    pub(crate) evaluated: u64,
    /// Points that kept their answer.
    pub(crate) skipped: u64,
}

/// Share of the largest component by which a Cauchy stress of grains in balance may lack symmetry.
const LARGEST_ASYMMETRY: f64 = 1e-2;

/// Whether a Cauchy stress is not symmetric, beyond what grains that are nearly at rest leave: couples that nothing carries.
fn is_asymmetric(stress: &Matrix3<f64>) -> bool {
    (stress - stress.transpose()).amax() > LARGEST_ASYMMETRY * stress.amax()
}

fn add_cost(total: &mut Cost, cost: &Cost) {
    total.force_evaluations += cost.force_evaluations;
    total.ramp_steps += cost.ramp_steps;
    total.solve_nanoseconds += cost.solve_nanoseconds;
    total.tangent_nanoseconds += cost.tangent_nanoseconds;
}
