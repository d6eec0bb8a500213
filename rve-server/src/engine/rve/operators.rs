//! Tangent operators of the present trial.

use super::GrainRve;
use crate::solver::SolverFor;
use crate::tangent::{
    self, Closeness, FrozenMethod, Method, OperatorEvaluation, Perturbation, TangentOutcome, perturbation,
};
use protocol::{TangentKind, Tensor4, TrialFlags, TrialResult, nanoseconds_since};
use std::time::Instant;

impl<S: SolverFor> GrainRve<S> {
    /// Operators of networks assume tangential springs of this share of the normal ones, for a law that has none or stiffer ones that
    /// bear nothing without friction: a frictionless network near isostaticity is all but a mechanism, and its own operator says little
    /// about a step of any size. For those who only steer by it.
    pub(crate) fn assume_springs_in_operators(&mut self, share: f64) {
        let idle =
            self.model.friction == 0.0 && self.contact.law.is_linear() && self.contact.tangential_ratio() > share;
        if idle || !self.model.has_tangential_springs {
            self.springs_of_operators = share;
        }
    }

    /// Has operators solved for this closely from now on; without it, as closely as iterations need.
    pub(crate) fn solve_operators_to(&mut self, closeness: Closeness) {
        self.closeness = closeness;
    }

    /// Adds the tangent requested, its cost and the shortcuts it took.
    pub(super) fn add_tangent(&mut self, answer: &mut TrialResult, kind: TangentKind) {
        if kind == TangentKind::None {
            return;
        }
        let started = Instant::now();
        let OperatorEvaluation { outcome, force_evaluations } =
            self.operator(kind).expect("the trial has just been made");
        answer.cost.force_evaluations += force_evaluations;
        if outcome.fallback {
            answer.flags.insert(TrialFlags::TANGENT_FALLBACK);
        }
        if outcome.regularised {
            answer.flags.insert(TrialFlags::TANGENT_REGULARISED);
        }
        answer.cost.tangent_nanoseconds = nanoseconds_since(started);
        answer.tangent = Some(Box::new(outcome.operator));
    }

    /// An operator of the present trial, Pa, as the trial itself would have returned it; `None` without a trial and for
    /// [`TangentKind::None`]. What the operator learns goes into the trial state.
    pub fn operator(&mut self, kind: TangentKind) -> Option<OperatorEvaluation> {
        let trial = self.trial.as_ref()?;
        let method = Method::of(kind);
        if method != Method::None && !trial.state.bears_load {
            let outcome = TangentOutcome::exact(Tensor4::ZERO);
            return Some(OperatorEvaluation::without_evaluations(outcome));
        }
        match method {
            Method::None => None,
            Method::Frozen(frozen) => self.frozen_operator(frozen),
            Method::Perturbation(perturbation) => self.perturbed_operator(perturbation),
        }
    }

    fn frozen_operator(&mut self, method: FrozenMethod) -> Option<OperatorEvaluation> {
        let trial = self.trial.as_ref()?;
        let assumed = (self.springs_of_operators > 0.0).then(|| {
            let mut network = trial.network.clone();
            for contact in &mut network.contacts {
                contact.tangential_stiffness = self.springs_of_operators * contact.normal_stiffness;
            }
            network
        });
        let network = assumed.as_ref().unwrap_or(&trial.network);
        let outcome = tangent::evaluate_with(&mut self.orderings, network, method, self.closeness);
        Some(OperatorEvaluation::without_evaluations(outcome))
    }

    fn perturbed_operator(&mut self, perturbation: Perturbation) -> Option<OperatorEvaluation> {
        let trial = self.trial.as_mut()?;
        let perturbed = perturbation::Trial {
            model: &self.model,
            contact: &self.contact,
            start: &self.committed,
            h: &trial.gradient,
            ramp_steps: trial.ramp_steps,
            network: &trial.network,
            stress: &trial.stress,
        };
        Some(perturbed.operator(perturbation, &mut *self.solver, &mut trial.state))
    }
}
