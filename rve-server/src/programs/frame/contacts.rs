//! The contacts of a frame: those that the packing lists, and those of a state.

use super::geometry::FrameGeometry;
use super::relaxation::FrameRelaxation;
use crate::cell::{ContactNetwork, ContactRecord, GrainState, NetworkContact, PairKey};
use crate::contact::{AT_LIMIT, PlainLinear, Rotations};
use crate::definition::PackingFile;
use crate::space::Discs;
use crate::space::plane::Plane;

impl FrameRelaxation<'_, PlainLinear> {
    /// The present state; `start` is the one it came from.
    pub(super) fn end_state(&self, start: &GrainState<Discs>, unbalanced: f64) -> GrainState<Discs> {
        let contacts = self.body.touching().map(|index| {
            let PairKey { origin, end, shift } = *self.body.key(index);
            ContactRecord { origin, end, shift, tangential_force: self.body.slots[index].tangential_force[0] }
        });
        GrainState {
            positions: self.body.grains.iter().map(|grain| grain.position).collect(),
            rotations: self.rotations.clone(),
            contacts: contacts.collect(),
            unbalanced,
            largest_load: start.largest_load.max(self.load_at_rest()),
            ..start.clone()
        }
    }

    /// The present contacts, each with its share.
    pub(super) fn network(&self, state: &GrainState<Discs>, thickness: f64, friction: f64) -> ContactNetwork<Discs> {
        let contacts = self.body.touching().map(|index| {
            let (key, slot) = (self.body.key(index), &self.body.slots[index]);
            let [normal_stiffness, tangential_stiffness, _] =
                slot.stiffness(self.body.law()).map(|stiffness| slot.weight * stiffness);
            let normal_force = slot.weight * slot.normal_force;
            let tangential_force = slot.weight * slot.tangential_force[0];
            let (origin, end, shift) = (key.origin, key.end, key.shift);
            let limit = slot.weight * slot.friction_limit(self.body.law());
            NetworkContact {
                origin,
                end,
                shift,
                normal_stiffness,
                tangential_stiffness,
                rolling_stiffness: 0.0,
                normal_force,
                tangential_force,
                slid: false,
                at_limit: tangential_force.abs() >= AT_LIMIT * limit,
            }
        });
        ContactNetwork {
            cell: state.cell.rows,
            thickness,
            positions: state.positions.clone(),
            radii: self.geometry.radii.clone(),
            rotations_free: self.turning == Rotations::Free,
            friction,
            contacts: contacts.collect(),
        }
    }

    /// `(1/V) sum a_q x X_q` over the boundary grains, [Liu2018] eq. 14: first Piola stress relative to the frame as cut,
    /// Pa. The boundary forces balance the contact forces.
    pub(super) fn boundary_first_piola(&mut self, thickness: f64) -> Plane {
        let mut sum = [[0.0; 2]; 2];
        let scale = -1.0 / (self.geometry.area * thickness);
        for (load, place) in self.body.loads.iter().zip(&self.geometry.positions).take(self.geometry.boundary) {
            for (row, force) in sum.iter_mut().zip(load.force) {
                for (value, x) in row.iter_mut().zip(place) {
                    *value += scale * force * x;
                }
            }
        }
        sum
    }
}

/// Listed contacts of the packing on every pair of frame grains that shows the same contact.
pub(super) fn listed_contacts(packing: &PackingFile<Discs>, geometry: &FrameGeometry) -> Vec<ContactRecord<Discs>> {
    let mut contacts = Vec::new();
    for listed in &packing.contacts {
        let of = |grain: u32| geometry.places.iter().enumerate().filter(move |(_, place)| place.0 == grain);
        for (first, from) in of(listed.origin) {
            let wanted = [from.1[0] + listed.shift[0], from.1[1] + listed.shift[1]];
            for (second, _) in of(listed.end).filter(|(_, to)| to.1 == wanted) {
                let key = PairKey::<Discs>::canonical(first as u32, second as u32, [0, 0]);
                let PairKey { origin, end, shift } = key;
                contacts.push(ContactRecord { origin, end, shift, tangential_force: listed.tangential_force });
            }
        }
    }
    contacts.sort_unstable_by_key(ContactRecord::key);
    contacts
}
