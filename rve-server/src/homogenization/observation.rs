//! What an answer reports beside stress and tangent.

use crate::homogenization::fabric::anisotropy;
use crate::homogenization::stress::first_piola;
use crate::network::ContactNetwork;
use crate::plane::Plane;
use crate::space::{Discs, Space};
use crate::state::GrainState;
use protocol::{Observables, Observed, Scalars, Tensor2, TrialFlags};

/// Overlap over diameter from which an answer is flagged: units or stiffness are probably wrong.
const LARGE_OVERLAP: f64 = 0.1;

/// The scalars that every answer carries.
pub(crate) fn scalars(network: &ContactNetwork, state: &GrainState) -> Scalars {
    Scalars {
        void_ratio: network.void_ratio(),
        coordination_number: network.coordination_number(),
        unbalanced_force_ratio: state.unbalanced,
        max_overlap_ratio: network.max_overlap_ratio(),
        volume_ratio: network.measure() / state.initial_measure,
    }
}

/// The optional results that were asked for. `f` leads from the committed configuration to the present one.
pub(crate) fn observe(
    cohesion: f64,
    network: &ContactNetwork,
    state: &GrainState,
    stress: &Plane,
    f: &Plane,
    wanted: Observables,
) -> Observed {
    let mut observed = Observed::default();
    if wanted.contains(Observables::FIRST_PIOLA) {
        observed.first_piola = Tensor2::from_plane(first_piola(stress, f));
    }
    if wanted.contains(Observables::COORDINATION_NO_RATTLERS) {
        observed.coordination_number_no_rattlers = network.coordination_number_no_rattlers();
    }
    if wanted.contains(Observables::FABRIC) {
        let fabric = network.fabric();
        observed.fabric = Tensor2::from_plane(fabric);
        observed.fabric_anisotropy = anisotropy(&fabric);
    }
    if wanted.contains(Observables::SLIDING_FRACTION) {
        observed.sliding_fraction = network.sliding_fraction(cohesion);
    }
    if wanted.contains(Observables::ENERGY) {
        let volume = network.volume();
        observed.elastic_energy = network.elastic_energy(cohesion) / volume;
        observed.frictional_dissipation = state.dissipation / volume;
    }
    if wanted.contains(Observables::ROTATION) {
        observed.mean_rotation = Discs::spin_in_space(state.mean_rotation());
    }
    observed
}

/// Flags that follow from the state alone.
pub(crate) fn note_condition(network: &ContactNetwork, flags: &mut TrialFlags) {
    if network.contacts.is_empty() {
        flags.insert(TrialFlags::FLUID);
    }
    if network.max_overlap_ratio() > LARGE_OVERLAP {
        flags.insert(TrialFlags::LARGE_OVERLAP);
    }
}
