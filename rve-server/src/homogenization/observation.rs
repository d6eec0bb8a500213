//! Observables of a cell next to stress and tangent.

use super::fabric::{LARGE_OVERLAP_RATIO, anisotropy};
use super::stress::first_piola;
use crate::cell::{ContactNetwork, GrainState};
use crate::space::{Space, Tensor};
use protocol::{Observables, Observed, Scalars, Tensor2, TrialFlags};

/// The scalars that every answer carries.
pub(crate) fn scalars<S: Space>(network: &ContactNetwork<S>, state: &GrainState<S>) -> Scalars {
    Scalars {
        void_ratio: network.void_ratio(),
        coordination_number: network.coordination_number(),
        unbalanced_force_ratio: state.unbalanced,
        max_overlap_ratio: network.max_overlap_ratio(),
        volume_ratio: network.measure() / state.initial_measure,
    }
}

/// The optional results that were requested. `elastic_energy` is that stored in all contacts, J, if it was; `f` leads from the committed
/// configuration to the present one.
pub(crate) fn observe<S: Space>(
    elastic_energy: Option<f64>,
    network: &ContactNetwork<S>,
    state: &GrainState<S>,
    stress: &S::Tensor,
    f: &S::Tensor,
    wanted: Observables,
) -> Observed {
    let mut observed = Observed::default();
    if wanted.contains(Observables::FIRST_PIOLA) {
        observed.first_piola = in_space(&first_piola(stress, f));
    }
    if wanted.contains(Observables::COORDINATION_NO_RATTLERS) {
        observed.coordination_number_no_rattlers = network.coordination_number_no_rattlers();
    }
    if wanted.contains(Observables::FABRIC) {
        let fabric = network.fabric();
        observed.fabric = in_space(&fabric);
        observed.fabric_anisotropy = anisotropy(&fabric);
    }
    if wanted.contains(Observables::SLIDING_FRACTION) {
        observed.sliding_fraction = network.sliding_fraction();
    }
    if let Some(elastic_energy) = elastic_energy {
        let volume = network.volume();
        observed.elastic_energy = elastic_energy / volume;
        observed.frictional_dissipation = state.dissipation / volume;
        observed.damping_work = state.damping / volume;
    }
    if wanted.contains(Observables::ROTATION) {
        observed.mean_rotation = S::spin_in_space(state.mean_rotation());
    }
    observed
}

/// Flags that follow from the state alone.
pub(crate) fn note_condition<S: Space>(state: &GrainState<S>, max_overlap_ratio: f64, flags: &mut TrialFlags) {
    if !state.bears_load {
        flags.insert(TrialFlags::NO_LOAD_BEARING_CONTACTS);
    }
    if max_overlap_ratio > LARGE_OVERLAP_RATIO {
        flags.insert(TrialFlags::LARGE_OVERLAP);
    }
}

/// A tensor as messages have it: those of the plane fill the upper left block.
pub(crate) fn in_space<T: Tensor>(tensor: &T) -> Tensor2 {
    let mut full = Tensor2::ZERO;
    for i in 0..T::DIMENSION {
        for j in 0..T::DIMENSION {
            full.0[3 * i + j] = tensor[i][j];
        }
    }
    full
}

/// The tensor of a message; what lies out of a plane is left out.
pub(crate) fn of_space<T: Tensor>(full: &Tensor2) -> T {
    T::from_fn(|i, j| full.get(i, j))
}
