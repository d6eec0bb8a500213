//! Targets of exactly zero: the committed state is the answer. Packings that are not at rest under their law can be brought to rest.

use super::{GrainRve, Trial, View};
use crate::solver::{PathEnergies, SolverFor, holds_together_far_from_rest};
use crate::space::Tensor;
use protocol::{Cost, RveError, TrialFlags, TrialOptions, TrialResult, nanoseconds_since};
use std::time::Instant;

impl<S: SolverFor> GrainRve<S> {
    /// Whether the state that an answer with all observables describes holds together and is far from equilibrium: the packing of another law. States that a
    /// trial has left are far below the bound.
    pub fn is_far_from_rest(&self, answer: &TrialResult) -> bool {
        holds_together_far_from_rest(answer, self.model.options.tolerance())
    }

    /// Whether the committed state is the answer to this target. With less friction than that of the definition it need not be at rest: it
    /// may have been reached with more.
    pub(super) fn stays(&self, gradient: &S::Tensor, options: &TrialOptions) -> bool {
        *gradient == S::Tensor::ZERO && !self.model.options.relax_zero_increments && options.friction_reduction == 0.0
    }

    /// Lets the grains come to rest where the cell is, and makes that the trial state.
    ///
    /// # Errors
    /// As those of a trial.
    pub(crate) fn settle(&mut self, options: &TrialOptions) -> Result<TrialResult, RveError> {
        self.trial = None;
        self.solve(&S::Tensor::ZERO, &TrialOptions { ramp_steps: 1, ..*options })
    }

    /// The committed state as the trial state: nothing moves.
    ///
    /// # Errors
    /// [`RveError::NotFinite`] for a state from elsewhere whose forces are not finite.
    pub(crate) fn stay(&mut self, options: &TrialOptions) -> Result<TrialResult, RveError> {
        let started = Instant::now();
        let end = self.solver.evaluate_state(&self.model, &self.committed)?;
        let elastic_energy = self.elastic_energy(&end.state, options.observables);
        let view = View::still(self.solver.network(&self.model, &end), self.committed.clone());
        let flags = TrialFlags::SKIPPED_NULL_TARGET;
        let cost = Cost { force_evaluations: 1, solve_nanoseconds: nanoseconds_since(started), ..Cost::default() };
        let mut answer = self.answer(&view, elastic_energy, options.observables, cost, flags);
        let View { network, state, stress, .. } = view;
        let ramp_steps = options.ramp_steps.max(1);
        let energies = self.counts_energies.then(PathEnergies::default);
        self.trial = Some(Trial { state, network, gradient: S::Tensor::ZERO, ramp_steps, stress, energies });
        self.add_tangent(&mut answer, options.tangent);
        Ok(answer)
    }
}
