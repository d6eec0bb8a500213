//! The homogenized stress.

use crate::cell::translation;
use crate::cell::{ContactNetwork, NetworkContact};
use crate::space::{Components, Space, Tensor, determinant, inverse, product, scaled, transpose};

impl<S: Space> ContactNetwork<S> {
    /// Area (m2) of a plane cell, volume (m3) of a cell in space.
    pub fn measure(&self) -> f64 {
        self.cell.determinant()
    }

    /// Volume of the cell, m3.
    pub fn volume(&self) -> f64 {
        self.measure() * self.thickness
    }

    /// Periodic image translation of a contact's end grain, m.
    pub fn translation(&self, contact: &NetworkContact<S>) -> S::Vector {
        translation::<S>(&self.cell, contact.shift)
    }

    /// Branch vector from origin to end, m.
    #[inline]
    pub fn branch(&self, contact: &NetworkContact<S>) -> S::Vector {
        let (o, e) = (self.positions[contact.origin as usize], self.positions[contact.end as usize]);
        e.minus(o).plus(self.translation(contact))
    }

    /// Force on the origin grain, N.
    pub fn force(&self, contact: &NetworkContact<S>) -> S::Vector {
        Self::force_along(contact, self.branch(contact))
    }

    /// Force on the origin grain of a contact with this branch vector, N.
    #[inline]
    fn force_along(contact: &NetworkContact<S>, branch: S::Vector) -> S::Vector {
        let length = branch.norm();
        let direction = S::Vector::from_fn(|axis| branch[axis] / length);
        S::contact_force(direction, contact.normal_force, contact.tangential_force)
    }

    /// Cauchy stress `1/V sum f x b` (Love-Weber; [Argilaga2018] eq. 8), Pa, tension positive. The branch vectors carry
    /// their image shift. Symmetric up to the unbalanced moments; nothing is symmetrised here.
    pub fn stress(&self) -> S::Tensor {
        let mut sum = S::Tensor::ZERO;
        for contact in &self.contacts {
            let branch = self.branch(contact);
            let force = Self::force_along(contact, branch);
            for i in 0..S::DIMENSION {
                for j in 0..S::DIMENSION {
                    sum[i][j] += force[i] * branch[j];
                }
            }
        }
        let scale = 1.0 / self.volume();
        S::Tensor::from_fn(|i, j| sum[i][j] * scale)
    }
}

/// First Piola stress `P = J sigma F^-T` for `F` relative to the configuration that `P` refers to, Pa.
pub fn first_piola<T: Tensor>(cauchy: &T, f: &T) -> T {
    let turned = product(cauchy, &transpose(&inverse(f)));
    scaled(&turned, determinant(f))
}
