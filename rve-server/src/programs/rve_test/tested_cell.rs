//! What an element test strains: a periodic cell, or a frame of boundary grains.

use super::stress_relaxation::MOST_RELAXED;
use crate::cell::{ContactNetwork, GrainState};
use crate::engine::{GrainRve, ListedForces};
use crate::homogenization::picture::CellPicture;
use crate::programs::frame::FrameRve;
use crate::solver::{PathEnergies, SolverFor};
use crate::space::Discs;
use crate::tangent::{self, FrozenMethod, OperatorEvaluation, TangentOutcome};
use protocol::{Observables, RveError, RveSolver, TangentKind, Tensor2, Tensor4, TrialOptions, TrialResult};

/// Grains that are strained as a whole, with a committed and at most one trial state.
pub(super) trait TestedCell: RveSolver {
    /// Kind of the grains.
    type Grains: SolverFor;

    /// Committed states of one increment that have not come to rest, with which it is given up: nothing holds the grains.
    const MOST_RESTLESS: u32;

    /// Whether the energy that numerical damping takes is summed up.
    const COUNTS_DAMPING: bool;

    /// Everything about the committed state, without moving a grain.
    fn observed(&mut self) -> Result<TrialResult, RveError>;

    /// The committed grains.
    fn grains(&self) -> &GrainState<Self::Grains>;

    /// Network of the committed state; no contact is marked as having slid.
    fn network_at_rest(&mut self) -> Result<ContactNetwork<Self::Grains>, RveError>;

    /// Network of the present trial.
    fn trial_network(&self) -> Option<&ContactNetwork<Self::Grains>>;

    /// Grains and contacts of the committed state, whose network is given.
    fn picture_of(&self, network: &ContactNetwork<Self::Grains>) -> CellPicture;

    /// An operator `d sigma / dF` of a network, Pa; none where the contacts do not tell it, since grains of a boundary are held otherwise.
    fn operator_of(network: &ContactNetwork<Self::Grains>, method: FrozenMethod) -> Option<Tensor4>;

    /// Work and numerical damping of the present trial where they are counted step by step.
    fn energies_of_trial(&self) -> Option<PathEnergies> {
        None
    }

    /// Whether the packing as given, whose answer this is, is to be brought to rest before it is strained.
    fn begins_far_from_rest(&self, as_given: &TrialResult) -> bool;

    /// Lets the grains come to rest where they are, and makes that the trial state.
    fn come_to_rest(&mut self) -> Result<TrialResult, RveError> {
        let options = TrialOptions { observables: Observables::ALL, ..TrialOptions::default() };
        self.trial(&Tensor2::ZERO, &options)
    }

    /// The operator requested, of the present trial; [`TangentKind::None`] alone where there are no operators.
    fn requested_operator(&mut self, _kind: TangentKind) -> Option<OperatorEvaluation> {
        None
    }

    /// The operator requested, of the packing as given.
    fn operator_as_given(&mut self, _kind: TangentKind) -> Option<TangentOutcome> {
        None
    }

    /// Tangential forces of the packing that were not taken over.
    fn forces_not_taken_over(&self) -> ListedForces {
        ListedForces::default()
    }
}

impl<S: SolverFor> TestedCell for GrainRve<S> {
    type Grains = S;

    /// Their relaxations end by the number of steps alone.
    const MOST_RESTLESS: u32 = MOST_RELAXED + 1;

    const COUNTS_DAMPING: bool = true;

    fn observed(&mut self) -> Result<TrialResult, RveError> {
        self.observe(Observables::ALL)
    }

    fn grains(&self) -> &GrainState<S> {
        self.committed()
    }

    fn network_at_rest(&mut self) -> Result<ContactNetwork<S>, RveError> {
        self.committed_network()
    }

    fn trial_network(&self) -> Option<&ContactNetwork<S>> {
        self.network()
    }

    fn picture_of(&self, network: &ContactNetwork<S>) -> CellPicture {
        CellPicture::new(network, self.committed())
    }

    fn operator_of(network: &ContactNetwork<S>, method: FrozenMethod) -> Option<Tensor4> {
        Some(tangent::evaluate(network, method).operator)
    }

    fn energies_of_trial(&self) -> Option<PathEnergies> {
        self.trial_energies()
    }

    fn begins_far_from_rest(&self, as_given: &TrialResult) -> bool {
        self.is_far_from_rest(as_given)
    }

    fn come_to_rest(&mut self) -> Result<TrialResult, RveError> {
        self.settle(&TrialOptions { observables: Observables::ALL, ..TrialOptions::default() })
    }

    fn requested_operator(&mut self, kind: TangentKind) -> Option<OperatorEvaluation> {
        self.operator(kind)
    }

    fn operator_as_given(&mut self, kind: TangentKind) -> Option<TangentOutcome> {
        // Nothing moves in a zero increment; it is dropped, so that the first step starts as without an operator.
        self.stay(&TrialOptions::default()).expect("a packing as given has finite forces");
        let evaluation = self.operator(kind);
        self.rollback();
        evaluation.map(|evaluation| evaluation.outcome)
    }

    fn forces_not_taken_over(&self) -> ListedForces {
        self.listed_forces()
    }
}

impl TestedCell for FrameRve {
    type Grains = Discs;

    const MOST_RESTLESS: u32 = 30;

    const COUNTS_DAMPING: bool = false;

    fn begins_far_from_rest(&self, as_given: &TrialResult) -> bool {
        self.is_far_from_rest(as_given)
    }

    fn observed(&mut self) -> Result<TrialResult, RveError> {
        Ok(self.observe(Observables::ALL))
    }

    fn grains(&self) -> &GrainState<Discs> {
        self.committed()
    }

    fn network_at_rest(&mut self) -> Result<ContactNetwork<Discs>, RveError> {
        Ok(self.committed_network())
    }

    fn trial_network(&self) -> Option<&ContactNetwork<Discs>> {
        self.network()
    }

    fn picture_of(&self, network: &ContactNetwork<Discs>) -> CellPicture {
        self.picture(network)
    }

    fn operator_of(network: &ContactNetwork<Discs>, method: FrozenMethod) -> Option<Tensor4> {
        // Only grains that all follow the mean strain do not need to know how the boundary is held.
        (method == FrozenMethod::KRUYT).then(|| tangent::evaluate(network, method).operator)
    }
}
