//! Evaluation of the Gauss points: targets are sent to the material, its results become stresses and moduli.

use super::Points;
use super::secant::{ReferenceModuli, Sample, corrected, floored};
use crate::formulation::Operator;
use crate::formulation::tensor::{matrix, operator, tensor};
use crate::material::{MaterialError, PointMaterial, PointTrial};
use crate::model::failure::{Failure, failure};
use crate::observer::Statistics;
use nalgebra::Matrix3;
use protocol::{Cost, TangentKind, TrialFlags, TrialOptions, TrialResult};

/// Motion of a point that a trial was made of.
struct TrialMotion {
    /// Displacement gradient of the step at the point itself.
    gradient: Matrix3<f64>,
    /// Average of the strain increments that the material was given in place of its own.
    average: Option<Matrix3<f64>>,
}

/// One evaluation of all points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EvaluationCounts {
    /// Points evaluated.
    pub(crate) evaluated: u64,
    /// Points whose last result stayed valid: their target had not changed, or they stand still.
    pub(crate) skipped: u64,
}

impl Points {
    /// Evaluates every point whose target has changed.
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

    /// As [`Points::evaluate`], for steps that cannot be made smaller: a point that refuses its trial takes it in parts, see
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
        answers: impl FnOnce(&mut Self, &mut [PointTrial], &mut Statistics) -> Result<Vec<TrialResult>, MaterialError>,
    ) -> Result<EvaluationCounts, Failure> {
        let mut trials = Vec::with_capacity(gradients.len());
        let mut still = 0;
        let seen = self.average_strains(gradients)?;
        for (number, (point, gradient)) in self.points.iter_mut().zip(gradients).enumerate() {
            let strain = seen.as_ref().map(|seen| seen[number]);
            if self.keep_still && point.rests(gradient, strain, tangent) {
                still += 1;
                continue;
            }
            if self.keep_unchanged && seen.is_none() && point.holds(gradient, tangent) {
                let kept = point.answer.as_ref().map_or(0, |answer| answer.cost.force_evaluations);
                statistics.skipped_force_evaluations += kept;
                continue;
            }
            let target = match strain {
                None => self.formulation.target(&point.deformation, gradient),
                Some(strain) => self.formulation.target_of_strain(&point.deformation, gradient, &strain),
            };
            let target = target.ok_or_else(|| inside_out(number))?;
            // Until its result has come, the material's latest trial of this point is unknown.
            point.held = None;
            let options = TrialOptions {
                tangent,
                ramp_steps: point.ramp_steps,
                observables: self.observables,
                friction_reduction: point.friction_reduction,
            };
            trials.push(PointTrial { point: number, target: tensor(&target), options });
        }
        let counts =
            EvaluationCounts { evaluated: trials.len() as u64, skipped: (gradients.len() - trials.len()) as u64 };
        statistics.skipped += counts.skipped - still;
        statistics.still_points += still;
        if trials.is_empty() {
            return Ok(counts);
        }
        let answers = answers(self, &mut trials, statistics).map_err(|error| {
            count_refused(&error, statistics);
            failure(error)
        })?;
        assert_eq!(answers.len(), trials.len(), "a material answers every trial");
        for (trial, answer) in trials.iter().zip(answers) {
            self.count(trial.point, &answer, statistics);
            let motion = TrialMotion {
                gradient: gradients[trial.point],
                average: seen.as_ref().map(|seen| seen[trial.point]),
            };
            self.take(trial, &motion, answer, statistics)?;
        }
        Ok(counts)
    }

    /// Strain increments of the elements as averaged over the neighbourhood of each point; `None` without neighbours.
    pub(super) fn average_strains(
        &mut self,
        gradients: &[Matrix3<f64>],
    ) -> Result<Option<Vec<Matrix3<f64>>>, Failure> {
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

    /// Counts a result and its cost.
    pub(super) fn count(&mut self, number: usize, answer: &TrialResult, statistics: &mut Statistics) {
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
        if answer.flags.contains(TrialFlags::ELASTIC_INCREMENT) || answer.flags.contains(TrialFlags::EVENT_INCREMENT)
        {
            statistics.event_driven_force_evaluations += answer.cost.force_evaluations;
        }
        statistics.tangents += u64::from(answer.tangent.is_some());
    }

    /// Turns the result of a trial into stress and moduli of its point.
    fn take(
        &mut self,
        trial: &PointTrial,
        TrialMotion { gradient, average }: &TrialMotion,
        answer: TrialResult,
        statistics: &mut Statistics,
    ) -> Result<(), Failure> {
        let finite = answer.stress.is_finite() && answer.tangent.as_ref().is_none_or(|tangent| tangent.is_finite());
        if !finite {
            let reason = format!("Gauss point {} answered with a number that is not finite", trial.point);
            return Err(Failure::Attempt(reason));
        }
        let formulation = self.formulation;
        let point = &mut self.points[trial.point];
        // What is left of the forces of grains that no longer bear anything is in balance with nothing.
        let bears = !answer.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS);
        let least = point.reference.as_ref().map_or(0.0, |reference| NEGLIGIBLE_STRAIN * reference.norm);
        let asymmetric = bears && self.symmetric_stresses && is_asymmetric(&matrix(&answer.stress), least);
        statistics.asymmetric_stresses += u64::from(asymmetric);
        // Secants correct the moduli by stresses alone, whether a tangent came with them or not.
        if trial.options.tangent == TangentKind::None && self.secant.is_none() {
            let stress = formulation.cauchy(&point.deformation, gradient, &matrix(&answer.stress));
            point.response.stress = stress.ok_or_else(|| inside_out(trial.point))?;
        } else {
            if let Some(tangent) = &answer.tangent {
                point.tangent = operator(tangent);
            }
            let reference =
                *point.reference.get_or_insert_with(|| ReferenceModuli::of(self.dimension, &point.tangent));
            let mut response = formulation
                .response(&point.deformation, gradient, &matrix(&answer.stress), &point.tangent)
                .ok_or_else(|| inside_out(trial.point))?;
            if let (Some(_), Some(average)) = (&self.coupling, average) {
                let stress = matrix(&answer.stress);
                let mut averaged = formulation
                    .averaged_moduli(&point.deformation, gradient, average, &stress, &point.tangent)
                    .ok_or_else(|| inside_out(trial.point))?;
                // Floor and secants are about the strain that the material has seen.
                let sample = Sample::of_strain(average, &response.stress);
                averaged.seen = self.improved(trial.point, &reference, averaged.seen, Some(sample), statistics);
                self.points[trial.point].averaged = Some(Box::new(averaged));
            } else {
                let sample = Sample::new(formulation, gradient, &response.stress);
                response.moduli = self.improved(trial.point, &reference, response.moduli, sample, statistics);
            }
            self.points[trial.point].response = response;
        }
        self.points[trial.point].hold(formulation, gradient, trial.options.tangent, answer);
        Ok(())
    }

    /// Moduli with the tangent floor and the secant corrections of the strategy; `sample` is the evaluation that they come from.
    fn improved(
        &mut self,
        number: usize,
        reference: &ReferenceModuli,
        mut moduli: Operator,
        sample: Option<Sample>,
        statistics: &mut Statistics,
    ) -> Operator {
        let dimension = self.dimension;
        let point = &mut self.points[number];
        if let Some(stiffened) = self.tangent_floor.and_then(|floor| floored(dimension, &moduli, reference, floor)) {
            moduli = stiffened;
            statistics.floored_tangents += 1;
        }
        let Some(secant) = self.secant else { return moduli };
        if secant.carried && !self.secants_hold {
            (point.correction, point.last_sample) = (None, sample);
            return moduli;
        }
        let plain = moduli;
        if let Some(correction) = &point.correction {
            moduli += correction.as_ref();
        }
        if let (Some(last), Some(sample)) = (&point.last_sample, &sample) {
            match corrected(dimension, &moduli, last, sample, reference, &secant) {
                Some(better) => {
                    moduli = better;
                    statistics.secant_corrections += 1;
                }
                None => statistics.secant_refusals += 1,
            }
        }
        if secant.carried {
            point.correction = Some(Box::new(moduli - plain));
        }
        point.last_sample = sample;
        moduli
    }
}

/// Counts a refused trial and its cost; what other trials of its message have taken is not known.
pub(super) fn count_refused(error: &MaterialError, statistics: &mut Statistics) {
    statistics.unfinished_trials += u64::from(error.is_unfinished_trial());
    statistics.cost.force_evaluations += error.force_evaluations();
}

fn inside_out(number: usize) -> Failure {
    Failure::Attempt(format!("Gauss point {number} is turned inside out"))
}

/// Share of the largest component by which a Cauchy stress of grains in balance may lack symmetry.
const LARGEST_ASYMMETRY: f64 = 1e-2;

/// Strain whose elastic stress is nothing: grains that hardly touch any more.
const NEGLIGIBLE_STRAIN: f64 = 1e-9;

/// Whether a Cauchy stress is not symmetric, beyond what grains that are nearly at rest leave: couples that nothing carries. Components below
/// `least` (Pa) do not count.
fn is_asymmetric(stress: &Matrix3<f64>, least: f64) -> bool {
    (stress - stress.transpose()).amax() > LARGEST_ASYMMETRY * stress.amax().max(least)
}

fn add_cost(total: &mut Cost, cost: &Cost) {
    total.force_evaluations += cost.force_evaluations;
    total.ramp_steps += cost.ramp_steps;
    total.solve_nanoseconds += cost.solve_nanoseconds;
    total.tangent_nanoseconds += cost.tangent_nanoseconds;
}
