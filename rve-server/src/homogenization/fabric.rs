//! What the contact network looks like: coordination, fabric, sliding, overlap.

use crate::network::ContactNetwork;
use crate::plane::Plane;
use crate::relaxation::kernel::AT_LIMIT;

/// Contacts without those of rattlers, and the grains that carry them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backbone {
    /// Grains with at least two contacts after all others have been removed.
    pub grains: usize,
    /// Contacts between them.
    pub contacts: usize,
}

impl ContactNetwork {
    /// Void area over grain area. Overlaps count twice as grain area, as is usual.
    pub fn void_ratio(&self) -> f64 {
        let solid: f64 = self.radii.iter().map(|radius| std::f64::consts::PI * radius * radius).sum();
        (self.area() - solid) / solid
    }

    /// 2 x contacts over grains.
    pub fn coordination_number(&self) -> f64 {
        2.0 * self.contacts.len() as f64 / self.positions.len() as f64
    }

    /// Removes grains with fewer than two contacts until none is left that has.
    pub fn backbone(&self) -> Backbone {
        let (degree, alive) = self.pruned();
        Backbone {
            grains: degree.iter().filter(|degree| **degree >= 2).count(),
            contacts: alive.iter().filter(|alive| **alive).count(),
        }
    }

    /// Whether each grain is a rattler: removed with its contacts on the way to the backbone.
    pub fn rattlers(&self) -> Vec<bool> {
        self.pruned().0.into_iter().map(|degree| degree < 2).collect()
    }

    /// Contacts left of each grain, and whether each contact is left, after pruning.
    fn pruned(&self) -> (Vec<u32>, Vec<bool>) {
        let mut degree = vec![0u32; self.positions.len()];
        for contact in &self.contacts {
            degree[contact.origin as usize] += 1;
            degree[contact.end as usize] += 1;
        }
        let mut alive: Vec<bool> = vec![true; self.contacts.len()];
        loop {
            let mut changed = false;
            for (contact, alive) in self.contacts.iter().zip(&mut alive) {
                let (o, e) = (contact.origin as usize, contact.end as usize);
                if *alive && (degree[o] < 2 || degree[e] < 2) {
                    *alive = false;
                    degree[o] -= 1;
                    degree[e] -= 1;
                    changed = true;
                }
            }
            if !changed {
                return (degree, alive);
            }
        }
    }

    /// 2 x contacts over non-rattlers, contacts of rattlers left out; 0 if all are rattlers.
    pub fn coordination_number_no_rattlers(&self) -> f64 {
        let backbone = self.backbone();
        if backbone.grains == 0 { 0.0 } else { 2.0 * backbone.contacts as f64 / backbone.grains as f64 }
    }

    /// Contact fabric `1/C sum n x n`; zero without contacts.
    pub fn fabric(&self) -> Plane {
        let mut sum = [[0.0; 2]; 2];
        for contact in &self.contacts {
            let branch = self.branch(contact);
            let square = branch[0] * branch[0] + branch[1] * branch[1];
            for (row, first) in sum.iter_mut().zip(branch) {
                for (value, second) in row.iter_mut().zip(branch) {
                    *value += first * second / square;
                }
            }
        }
        let scale = 1.0 / (self.contacts.len().max(1)) as f64;
        sum.map(|row| row.map(|value| value * scale))
    }

    /// Share of contacts at the Coulomb limit `mu (k_n C - f_n)` for the cohesive force `k_n C` of each contact.
    pub fn sliding_fraction(&self, cohesion: f64) -> f64 {
        let sliding = self
            .contacts
            .iter()
            .filter(|contact| {
                let limit = self.friction * (contact.normal_stiffness * cohesion - contact.normal_force);
                contact.tangential_force.abs() >= AT_LIMIT * limit
            })
            .count();
        sliding as f64 / self.contacts.len().max(1) as f64
    }

    /// Largest overlap over the smaller grain diameter of its contact; 0 without contacts.
    pub fn max_overlap_ratio(&self) -> f64 {
        self.contacts.iter().fold(0.0, |largest: f64, contact| {
            let branch = self.branch(contact);
            let (o, e) = (self.radii[contact.origin as usize], self.radii[contact.end as usize]);
            largest.max((o + e - (branch[0] * branch[0] + branch[1] * branch[1]).sqrt()) / (2.0 * o.min(e)))
        })
    }

    /// Stored contact energy, J: `(f_n^2 - (k_n C)^2) / 2 k_n + f_t^2 / 2 k_t`, zero where a contact opens.
    pub fn elastic_energy(&self, cohesion: f64) -> f64 {
        self.contacts
            .iter()
            .map(|contact| {
                let adhesion = contact.normal_stiffness * cohesion;
                let square = contact.normal_force * contact.normal_force - adhesion * adhesion;
                let stored = 0.5 * square / contact.normal_stiffness;
                if contact.tangential_force == 0.0 {
                    return stored;
                }
                stored + 0.5 * contact.tangential_force * contact.tangential_force / contact.tangential_stiffness
            })
            .sum()
    }
}

/// Anisotropy of a fabric tensor: major over minor principal value, minus 1; 0 for a zero tensor.
pub fn anisotropy(fabric: &Plane) -> f64 {
    let mean = 0.5 * (fabric[0][0] + fabric[1][1]);
    let shear = 0.5 * (fabric[0][1] + fabric[1][0]);
    let radius = (0.5 * (fabric[0][0] - fabric[1][1])).hypot(shear);
    // All contacts in one direction leave no minor value; the number must stay finite on the wire.
    if mean <= radius { 0.0 } else { (mean + radius) / (mean - radius) - 1.0 }
}
