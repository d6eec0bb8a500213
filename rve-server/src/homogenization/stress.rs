//! The homogenized stress, in three forms that agree at equilibrium.

use crate::network::{ContactNetwork, NetworkContact};
use crate::plane::{self, Plane};

impl ContactNetwork {
    /// Area of the cell, m2.
    pub fn area(&self) -> f64 {
        plane::determinant(&self.cell)
    }

    /// Periodic image translation of a contact's end grain, m.
    pub fn translation(&self, contact: &NetworkContact) -> [f64; 2] {
        let [first, second] = contact.shift.map(f64::from);
        [first * self.cell[0][0] + second * self.cell[1][0], first * self.cell[0][1] + second * self.cell[1][1]]
    }

    /// Branch vector from origin to end, m.
    pub fn branch(&self, contact: &NetworkContact) -> [f64; 2] {
        let (o, e) = (self.positions[contact.origin as usize], self.positions[contact.end as usize]);
        let image = self.translation(contact);
        [(e[0] - o[0]) + image[0], (e[1] - o[1]) + image[1]]
    }

    /// Force on the origin grain, N.
    pub fn force(&self, contact: &NetworkContact) -> [f64; 2] {
        let branch = self.branch(contact);
        let length = (branch[0] * branch[0] + branch[1] * branch[1]).sqrt();
        let [x, y] = [branch[0] / length, branch[1] / length];
        [
            contact.normal_force * x - contact.tangential_force * y,
            contact.normal_force * y + contact.tangential_force * x,
        ]
    }

    fn stress_with(&self, arm: impl Fn(&NetworkContact) -> [f64; 2]) -> Plane {
        let mut sum = [[0.0; 2]; 2];
        for contact in &self.contacts {
            let (force, arm) = (self.force(contact), arm(contact));
            for (row, component) in sum.iter_mut().zip(force) {
                for (value, lever) in row.iter_mut().zip(arm) {
                    *value += component * lever;
                }
            }
        }
        let scale = 1.0 / (self.area() * self.thickness);
        sum.map(|row| row.map(|value| value * scale))
    }

    /// Cauchy stress `1/A sum f x b` (Love-Weber; [Argilaga2018] eq. 8), Pa, tension positive. The branch vectors carry
    /// their image shift. Symmetric up to the unbalanced moments; nothing is symmetrised here.
    pub fn stress(&self) -> Plane {
        self.stress_with(|contact| self.branch(contact))
    }

    /// The same stress from the contacts that cross the cell's border alone: `1/A sum f x (shift_1 Y1 + shift_2 Y2)`. It
    /// differs from [`stress`](Self::stress) by the unbalanced forces only, so the difference measures them. Pa.
    pub fn border_stress(&self) -> Plane {
        self.stress_with(|contact| self.translation(contact))
    }
}

/// First Piola stress `P = J sigma F^-T` for `F` relative to the configuration that `P` refers to, Pa.
pub fn first_piola(cauchy: &Plane, f: &Plane) -> Plane {
    let scaled = plane::product(cauchy, &plane::transpose(&plane::inverse(f)));
    plane::add_scaled(&[[0.0; 2]; 2], plane::determinant(f), &scaled)
}
