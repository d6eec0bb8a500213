//! The unchanging part of an RVE: radii, stiffnesses, law, options. Shared by all states of one definition.

use crate::cell::Cell;
use crate::definition::{GrainDefinition, NormalStiffness, Rotations, RveOptions};
use crate::pairs::PairKey;
use crate::relaxation::kernel::LinearLaw;
use crate::space::{Components, Space};
use crate::state::{ContactRecord, GrainState};
use protocol::RveError;

/// What a definition means to the solver.
#[derive(Clone, Debug, PartialEq)]
pub struct GrainModel {
    /// Grain radii, m.
    pub radii: Vec<f64>,
    /// Out-of-plane thickness, m.
    pub thickness: f64,
    /// Normal stiffness rule.
    pub normal: NormalStiffness,
    /// Whether grains may rotate.
    pub rotations: Rotations,
    /// Solver options.
    pub options: RveOptions,
    pub(crate) law: LinearLaw,
}

impl GrainModel {
    /// Reads a validated definition.
    ///
    /// # Errors
    /// [`RveError::Definition`] if the contact table is not valid after all.
    pub fn new<S: Space>(definition: &GrainDefinition<S>) -> Result<Self, RveError> {
        let contact = &definition.contact;
        Ok(Self {
            radii: definition.packing.grains.iter().map(S::radius).collect(),
            thickness: definition.packing.thickness,
            normal: contact.normal().map_err(|error| RveError::Definition(error.to_string()))?,
            rotations: contact.rotations,
            options: definition.options.clone(),
            law: LinearLaw {
                stiffness_ratio: contact.tangential_ratio(),
                friction: contact.friction,
                cohesion: contact.cohesion,
            },
        })
    }

    /// The state that the packing describes: nothing has moved, listed contacts carry their tangential force. A listed
    /// force on a pair that does not touch is dropped and one above the Coulomb limit is cut to it at the first
    /// evaluation.
    pub fn initial_state<S: Space>(&self, definition: &GrainDefinition<S>) -> GrainState<S> {
        let packing = &definition.packing;
        let cell = Cell { rows: packing.periodicity };
        let mut contacts: Vec<ContactRecord<S>> = packing
            .contacts
            .iter()
            .map(|listed| {
                let key = PairKey::<S>::canonical(listed.origin, listed.end, listed.shift);
                let PairKey { origin, end, shift } = key;
                let is_swapped = (origin, shift) != (listed.origin, listed.shift);
                let tangential_force = S::seen_from(listed.tangential_force, is_swapped);
                ContactRecord { origin, end, shift, tangential_force }
            })
            .collect();
        contacts.sort_unstable_by_key(ContactRecord::key);
        GrainState {
            cell,
            positions: packing.grains.iter().map(S::centre).collect(),
            rotations: vec![S::Spin::ZERO; packing.grains.len()],
            contacts,
            dissipation: 0.0,
            initial_measure: cell.measure(),
            unbalanced: 0.0,
        }
    }

    /// Largest radius, m.
    pub fn largest_radius(&self) -> f64 {
        self.radii.iter().fold(0.0, |largest: f64, radius| largest.max(*radius))
    }

    /// Mean radius, m.
    pub fn mean_radius(&self) -> f64 {
        self.radii.iter().sum::<f64>() / self.radii.len() as f64
    }
}
