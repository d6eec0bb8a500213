//! The unchanging part of an RVE: radii, stiffnesses, law, options. Shared by all states of one definition.

use super::GrainDefinition;
use super::options::RveOptions;
use crate::cell::{Cell, ContactRecord, GrainState, OperatorMemory};
use crate::contact::Rotations;
use crate::space::{Components, Space};
use protocol::RveError;

/// A definition as the solver uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct GrainModel {
    /// Grain radii, m.
    pub radii: Vec<f64>,
    /// Out-of-plane thickness, m.
    pub thickness: f64,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Whether k_n is proportional to the size of the grains.
    pub stiffness_grows_with_size: bool,
    /// Whether contacts have viscosity.
    pub is_viscous: bool,
    /// Whether grains may rotate.
    pub rotations: Rotations,
    /// Whether contacts have tangential springs.
    pub has_tangential_springs: bool,
    /// Solver options.
    pub options: RveOptions,
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
            friction: contact.friction,
            stiffness_grows_with_size: contact.law.is_linear() && contact.modulus.is_some(),
            is_viscous: contact.damping > 0.0,
            rotations: contact.rotations,
            has_tangential_springs: contact.has_tangential_springs(),
            options: definition.options.clone(),
        })
    }

    /// The state that the packing describes: nothing has moved, listed contacts carry their tangential force and
    /// rolling moment; a law without rolling resistance drops the moments. A listed force on a pair that does not touch is
    /// dropped and one above the Coulomb limit is cut to it at the first evaluation. Contacts without tangential springs carry no
    /// tangential force and no rolling moment, whose spring is a share of theirs: nothing could ever change it, and a force that follows
    /// its grains without a spring drives them round for ever.
    pub fn initial_state<S: Space>(&self, definition: &GrainDefinition<S>) -> GrainState<S> {
        let packing = &definition.packing;
        let cell = Cell { rows: packing.periodicity };
        let mut contacts: Vec<(ContactRecord<S>, Option<S::Spin>)> = packing.histories().collect();
        contacts.sort_unstable_by_key(|(contact, _)| contact.key());
        let mut rolling_moments: Vec<S::Spin> = contacts.iter().filter_map(|(_, moment)| *moment).collect();
        let mut contacts: Vec<ContactRecord<S>> = contacts.into_iter().map(|(contact, _)| contact).collect();
        if !self.has_tangential_springs {
            contacts.iter_mut().for_each(|contact| contact.tangential_force = S::Tangential::ZERO);
            rolling_moments.fill(S::Spin::ZERO);
        }
        GrainState {
            cell,
            positions: packing.grains.iter().map(S::centre).collect(),
            rotations: vec![S::Spin::ZERO; packing.grains.len()],
            contacts,
            rolling_moments,
            operators: OperatorMemory::default(),
            dissipation: 0.0,
            damping: 0.0,
            initial_measure: cell.measure(),
            unbalanced: 0.0,
            largest_load: 0.0,
            bears_load: true,
            events: None,
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
