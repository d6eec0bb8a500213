//! One Gauss point: its committed state, its latest evaluation, and its cost.

use super::pore_fluid::Fluid;
use super::secant::{ReferenceModuli, Sample};
use crate::formulation::{AveragedModuli, Formulation, Operator, Response};
use nalgebra::Matrix3;
use protocol::{Cost, TangentKind, TrialResult};
use std::borrow::Cow;

/// One Gauss point.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    /// Committed total deformation gradient.
    pub(crate) deformation: Matrix3<f64>,
    /// Stress of the grains and moduli of the latest evaluation, secant correction included; with averages the moduli are those of a
    /// point that sees its own strain.
    pub(crate) response: Response,
    /// Parts of the moduli with averages, secant correction included; of stages in which points are coupled.
    pub(super) averaged: Option<Box<AveragedModuli>>,
    /// Committed stress, Pa.
    pub(super) committed_stress: Matrix3<f64>,
    /// Total deformation gradient at the latest evaluation.
    pub(super) trial_deformation: Matrix3<f64>,
    /// Latest result of the material.
    pub(crate) answer: Option<TrialResult>,
    /// Evaluations in this step.
    pub(crate) step_evaluations: u64,
    /// Evaluations since the start.
    pub(crate) evaluations: u64,
    /// Cost in this step.
    pub(crate) step_cost: Cost,
    /// Cost since the start.
    pub(crate) cost: Cost,
    pub(super) tangent: Operator,
    pub(super) reference: Option<ReferenceModuli>,
    pub(super) ramp_steps: u32,
    /// Share by which the friction of the coming evaluations is below that of the definition.
    pub(super) friction_reduction: f64,
    /// That of the latest evaluation.
    pub(super) answered_reduction: f64,
    /// That of the committed state.
    pub(super) committed_reduction: f64,
    /// Gradient of the latest evaluation and the tangent that came with it, as long as they are valid.
    pub(super) held: Option<(Matrix3<f64>, TangentKind)>,
    pub(super) last_sample: Option<Sample>,
    /// Carried secant corrections of the moduli.
    pub(super) correction: Option<Box<Operator>>,
    /// Displacement gradient of the last accepted step.
    pub(super) last_step: Matrix3<f64>,
    /// Fluid that cannot drain.
    pub(super) fluid: Option<Fluid>,
}

impl Point {
    /// An undeformed point that has not been evaluated.
    pub(super) fn new() -> Self {
        Self {
            deformation: Matrix3::identity(),
            committed_stress: Matrix3::zeros(),
            response: Response { stress: Matrix3::zeros(), moduli: Operator::zeros() },
            averaged: None,
            trial_deformation: Matrix3::identity(),
            answer: None,
            step_evaluations: 0,
            evaluations: 0,
            step_cost: Cost::default(),
            cost: Cost::default(),
            tangent: Operator::zeros(),
            reference: None,
            ramp_steps: 0,
            friction_reduction: 0.0,
            answered_reduction: 0.0,
            committed_reduction: 0.0,
            held: None,
            last_sample: None,
            correction: None,
            last_step: Matrix3::zeros(),
            fluid: None,
        }
    }

    /// Starts the samples of an attempt: carried corrections use the step as a whole too, but not across a reversal of the load,
    /// where all contacts that slid stick again.
    pub(super) fn start_samples(&mut self, gradient: &Matrix3<f64>) {
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

    /// Parts of the moduli with averages; before the first tangent of the stage those that its last moduli leave.
    pub(crate) fn averaged(&self, formulation: Formulation) -> Cow<'_, AveragedModuli> {
        match &self.averaged {
            Some(averaged) => Cow::Borrowed(averaged),
            None => Cow::Owned(formulation.averaged_moduli_of(&self.response)),
        }
    }

    /// Stress and moduli of grains at the latest evaluation together with the pore fluid, as the element integrals need them.
    pub(super) fn integrand(&self, formulation: Formulation, grains: Response) -> (Matrix3<f64>, Operator) {
        formulation
            .integrand(&self.trial_deformation, &self.with_fluid(formulation, grains))
            .expect("a point that is turned inside out is never evaluated")
    }

    /// Whether nothing happens to the point in a step without a tangent, so that its last result stays valid.
    pub(super) fn rests(&self, gradient: &Matrix3<f64>, strain: Option<Matrix3<f64>>, tangent: TangentKind) -> bool {
        let zero = Matrix3::zeros();
        let is_still = *gradient == zero && strain.is_none_or(|strain| strain == zero);
        // With less friction than that of the definition a state need not be one of rest, and more friction ends sliding.
        tangent == TangentKind::None
            && self.friction_reduction == 0.0
            && self.answered_reduction == 0.0
            && is_still
            && self.answer.is_some()
            && self.trial_deformation == self.deformation
    }

    /// Whether the latest evaluation answers this gradient, with the tangent that is wanted.
    pub(super) fn holds(&self, gradient: &Matrix3<f64>, tangent: TangentKind) -> bool {
        self.held.is_some_and(|(held, came)| held == *gradient && (tangent == TangentKind::None || tangent == came))
    }

    /// Records the result for the step gradient `gradient` and the `tangent` that was asked for with it.
    pub(super) fn hold(
        &mut self,
        formulation: Formulation,
        gradient: &Matrix3<f64>,
        tangent: TangentKind,
        answer: TrialResult,
    ) {
        self.trial_deformation = formulation.deformation(&self.deformation, gradient);
        self.held = Some((*gradient, tangent));
        self.answered_reduction = self.friction_reduction;
        self.answer = Some(answer);
    }
}
