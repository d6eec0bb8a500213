//! Tangent operators that need the grain solver itself: CTO and DEMQO by perturbations, AEO and the calibrated
//! uniform-strain operators from the CTOs of the first steps.
//!
//! Perturbations run on working memory only: the committed and the trial state keep their bits, except that a state stores
//! averages and calibrations of these operators ([`OperatorMemory`](crate::cell::OperatorMemory)). An operator is therefore a
//! pure function of committed state, target and options, in any worker. Every contact-force evaluation is counted.

mod differences;

#[cfg(test)]
mod tests;

use crate::cell::{ContactNetwork, GrainState};
use crate::contact::ContactTable;
use crate::definition::{Criterion, GrainModel, RveOptions};
use crate::solver::{GrainSolver, SolveJob, SolverFor};
use crate::space::{Space, Tensor, add_scaled, product, rotated};
use crate::tangent::calibration::stiffness_factors;
use crate::tangent::evaluate::{calibrated, calibration, evaluate};
use crate::tangent::method::{Difference, Factors, Form, FrozenMethod, Perturbation};
use crate::tangent::outcome::{OperatorEvaluation, TangentOutcome};
use differences::differentiate;
use protocol::Tensor4;

/// Friction that no contact reaches.
const STICKING_FRICTION: f64 = 1e9;

/// The trial whose operator is wanted.
pub(crate) struct Trial<'a, S: Space> {
    pub(crate) model: &'a GrainModel,
    pub(crate) contact: &'a ContactTable,
    /// State that the trial started from.
    pub(crate) start: &'a GrainState<S>,
    /// Its target.
    pub(crate) h: &'a S::Tensor,
    /// Its ramp.
    pub(crate) ramp_steps: u32,
    /// Its end.
    pub(crate) network: &'a ContactNetwork<S>,
    /// Its stress, Pa.
    pub(crate) stress: &'a S::Tensor,
}

impl<S: SolverFor> Trial<'_, S> {
    /// The operator; what it learns goes into `end`, the trial's end state. A perturbation that fails or does not come to
    /// rest leaves the truss-like operator in its place, marked.
    pub(crate) fn operator(
        &self,
        kind: Perturbation,
        solver: &mut dyn GrainSolver<S>,
        end: &mut GrainState<S>,
    ) -> OperatorEvaluation {
        let mut force_evaluations = 0;
        let found = match kind {
            Perturbation::QuasiStatic => self.quasi_static(end, &mut force_evaluations),
            Perturbation::Consistent(difference) => self.consistent(difference, solver, &mut force_evaluations),
            Perturbation::ElasticAverage => self.elastic_average(solver, end, &mut force_evaluations),
            Perturbation::Calibrated(factors, form) => {
                self.calibrated(factors, form, solver, end, &mut force_evaluations)
            }
        };
        let outcome = match found {
            Some(operator) => TangentOutcome::exact(operator),
            None => TangentOutcome { fallback: true, ..evaluate(self.network, FrozenMethod::TRUSS_LIKE) },
        };
        OperatorEvaluation { outcome, force_evaluations }
    }

    /// CTO: the whole step once more for each perturbation, [Argilaga2018] eq. 6. Erratum: the perturbation of eq. 5 has its one
    /// at (m, n), not at (n, m) as in eq. 6.
    fn consistent(
        &self,
        difference: Difference,
        solver: &mut dyn GrainSolver<S>,
        spent: &mut u64,
    ) -> Option<Tensor4> {
        let size = self.model.options.operator.perturbation();
        let mut evaluate = |gradient: &S::Tensor| {
            // H of (I + gradient) F.
            let f = add_scaled(&S::Tensor::IDENTITY, 1.0, self.h);
            let h = add_scaled(self.h, 1.0, &product(gradient, &f));
            stress_after(solver, self.model, self.start, &h, self.ramp_steps, spent)
        };
        // A zero increment is answered without solving; its perturbations must be compared with a cell that was solved.
        let base = if *self.h == S::Tensor::ZERO && difference == Difference::Forward {
            evaluate(&S::Tensor::ZERO)?
        } else {
            *self.stress
        };
        differentiate::<S>(size, difference, &base, &mut evaluate)
    }

    /// DEMQO: small perturbations of the end state with contacts that cannot slide and a tolerance of their own,
    /// [Argilaga2018] eq. 20. What the trial left unbalanced relaxes further in every perturbation; one of size zero takes it
    /// out of the differences.
    fn quasi_static(&self, end: &GrainState<S>, spent: &mut u64) -> Option<Tensor4> {
        let sticking = ContactTable { friction: STICKING_FRICTION, ..self.contact.clone() };
        let mut solver = S::solver(self.model.options.solver, &sticking).ok()?;
        let operator = &self.model.options.operator;
        let mut model = self.model.clone();
        model.friction = STICKING_FRICTION;
        model.options = RveOptions {
            criterion: Criterion::MaxForce,
            tolerance: Some(operator.quasi_static_tolerance()),
            ..self.model.options.clone()
        };
        let mut evaluate = |gradient: &S::Tensor| stress_after(&mut *solver, &model, end, gradient, 1, spent);
        let base = evaluate(&S::Tensor::ZERO)?;
        differentiate::<S>(operator.quasi_static_perturbation(), Difference::Forward, &base, &mut evaluate)
    }

    /// AEO: the mean of the CTOs of the first committed steps, this one included, and then that mean for good.
    fn elastic_average(
        &self,
        solver: &mut dyn GrainSolver<S>,
        end: &mut GrainState<S>,
        spent: &mut u64,
    ) -> Option<Tensor4> {
        if end.operators.samples() < self.model.options.operator.average_steps() {
            let sample = self.consistent(Difference::Forward, solver, spent)?;
            end.operators.add(&sample);
        }
        end.operators.mean()
    }

    /// UCKO and UCKO-2DOF: the first trial calibrates by its CTO; once it is committed the factors stay.
    fn calibrated(
        &self,
        factors: Factors,
        form: Form,
        solver: &mut dyn GrainSolver<S>,
        end: &mut GrainState<S>,
        spent: &mut u64,
    ) -> Option<Tensor4> {
        if end.operators.calibration().is_none_or(|known| stiffness_factors(known, factors).is_none()) {
            let consistent = self.consistent(Difference::Forward, solver, spent)?;
            end.operators.calibrate(calibration(self.network, &consistent)?);
        }
        let factors = stiffness_factors(end.operators.calibration()?, factors)?;
        Some(calibrated(self.network, form, factors))
    }
}

/// Stress at the end of a solve, Pa; `None` if the solve fails or does not come to rest.
fn stress_after<S: Space>(
    solver: &mut dyn GrainSolver<S>,
    model: &GrainModel,
    start: &GrainState<S>,
    h: &S::Tensor,
    ramp_steps: u32,
    spent: &mut u64,
) -> Option<S::Tensor> {
    let polar = S::polar(h);
    let end = match solver
        .solve_one(model, SolveJob { state: start, strain: polar.strain, ramp_steps, counts_work: false })
    {
        Ok(end) => end,
        Err(error) => {
            *spent += error.force_evaluations();
            return None;
        }
    };
    *spent += end.solved.force_evaluations;
    let stress = solver.network(model, &end).stress();
    end.solved.equilibrated.then(|| rotated(&stress, &S::rotation_matrix(polar.turn)))
}
