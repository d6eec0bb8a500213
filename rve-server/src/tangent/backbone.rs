//! Which grains carry load, and which of their displacements must be held for a unique answer.
//!
//! A grain with fewer than two contacts is a rattler; removing it may make another, so pruning repeats until nothing
//! changes. The remaining grains fall into clusters linked by contacts. The periodic fluctuation of each cluster is free
//! up to a translation, which is pinned at its first grain. A cluster that meets none of its own images can also turn
//! as a whole; then the spin of that grain is pinned too. All three pins choose one of many equal answers and change no
//! contact force.

use super::contact_stiffness::ContactStiffness;
use crate::network::ContactNetwork;

/// The load-carrying part of a network, its grains numbered anew.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Backbone {
    /// Contacts kept: index in the network, new numbers of origin and end grain.
    pub contacts: Vec<BackboneContact>,
    /// Radius of each kept grain, m: the length that turns its spin into a displacement.
    pub radii: Vec<f64>,
    /// Whether displacement 1, displacement 2 and spin of each kept grain are held at zero.
    pub pinned: Vec<[bool; 3]>,
    /// Whether a spin is held although forces act on it: all contacts of the grain slide.
    pub spin_held_against_load: bool,
}

/// One contact of the backbone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BackboneContact {
    /// Position in [`ContactNetwork::contacts`].
    pub index: usize,
    /// New number of the origin grain.
    pub origin: usize,
    /// New number of the end grain.
    pub end: usize,
}

impl Backbone {
    /// Prunes `network` and finds the pins; `stiffness` belongs to the network's contacts.
    pub(super) fn of(network: &ContactNetwork, stiffness: &[ContactStiffness]) -> Self {
        let kept = contacts_without_rattlers(network);
        let mut number = vec![usize::MAX; network.positions.len()];
        for &index in &kept {
            number[network.contacts[index].origin as usize] = 0;
            number[network.contacts[index].end as usize] = 0;
        }
        let mut radii = Vec::new();
        for (grain, place) in number.iter_mut().enumerate() {
            if *place == 0 {
                *place = radii.len();
                radii.push(network.radii[grain]);
            }
        }
        let contacts: Vec<BackboneContact> = kept
            .iter()
            .map(|&index| {
                let contact = &network.contacts[index];
                BackboneContact { index, origin: number[contact.origin as usize], end: number[contact.end as usize] }
            })
            .collect();
        let mut backbone =
            Self { pinned: vec![[false; 3]; radii.len()], contacts, radii, spin_held_against_load: false };
        backbone.pin_clusters(network);
        backbone.pin_spins(network, stiffness);
        backbone
    }

    fn pin_clusters(&mut self, network: &ContactNetwork) {
        let mut neighbours: Vec<Vec<(usize, [i32; 2])>> = vec![Vec::new(); self.radii.len()];
        for contact in &self.contacts {
            let shift = network.contacts[contact.index].shift;
            neighbours[contact.origin].push((contact.end, shift));
            neighbours[contact.end].push((contact.origin, [-shift[0], -shift[1]]));
        }
        // The image of each grain in which it was reached first; reaching another image closes a loop round the cell.
        let mut image: Vec<Option<[i32; 2]>> = vec![None; self.radii.len()];
        for first in 0..self.radii.len() {
            if image[first].is_some() {
                continue;
            }
            image[first] = Some([0, 0]);
            let mut meets_itself = false;
            let mut pending = vec![(first, [0, 0])];
            while let Some((grain, here)) = pending.pop() {
                for &(neighbour, shift) in &neighbours[grain] {
                    let there = [here[0] + shift[0], here[1] + shift[1]];
                    match image[neighbour] {
                        None => {
                            image[neighbour] = Some(there);
                            pending.push((neighbour, there));
                        }
                        Some(known) => meets_itself |= known != there,
                    }
                }
            }
            self.pinned[first] = [true, true, !meets_itself];
        }
    }

    fn pin_spins(&mut self, network: &ContactNetwork, stiffness: &[ContactStiffness]) {
        let mut is_resisted = vec![false; self.radii.len()];
        let mut is_loaded = vec![false; self.radii.len()];
        for contact in &self.contacts {
            for grain in [contact.origin, contact.end] {
                is_resisted[grain] |= stiffness[contact.index].tangential > 0.0;
                is_loaded[grain] |= stiffness[contact.index].coupling != 0.0
                    || network.contacts[contact.index].tangential_force != 0.0;
            }
        }
        for grain in 0..self.radii.len() {
            if !network.rotations_free {
                self.pinned[grain][2] = true;
            } else if !is_resisted[grain] {
                self.pinned[grain][2] = true;
                self.spin_held_against_load |= is_loaded[grain];
            }
        }
    }
}

fn contacts_without_rattlers(network: &ContactNetwork) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..network.contacts.len()).collect();
    loop {
        let mut count = vec![0_u32; network.positions.len()];
        for &index in &kept {
            count[network.contacts[index].origin as usize] += 1;
            count[network.contacts[index].end as usize] += 1;
        }
        let before = kept.len();
        kept.retain(|&index| {
            let contact = &network.contacts[index];
            count[contact.origin as usize] >= 2 && count[contact.end as usize] >= 2
        });
        if kept.len() == before {
            return kept;
        }
    }
}
