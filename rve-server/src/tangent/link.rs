//! A frozen network as the operators see it, in two or three dimensions.
//!
//! `D` is the number of space dimensions and `B` that of the unknowns of a grain: two displacements and one spin, or
//! three and three. `B` is also the number of independent strains.

use crate::cell::ContactNetwork;
use crate::space::{Components, Space};

/// One contact that carries force. Conventions as in [`crate::cell::network`]; the force acts on the origin grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Link<const D: usize> {
    /// Origin grain.
    pub origin: usize,
    /// End grain.
    pub end: usize,
    /// Cell shifts of the end grain.
    pub shift: [i32; D],
    /// Branch vector from origin to end grain, m.
    pub branch: [f64; D],
    /// Its length, m.
    pub length: f64,
    /// Unit normal.
    pub normal: [f64; D],
    /// Distances of the contact point from the origin and the end centre, m; they add up to `length`.
    pub arms: [f64; 2],
    /// `d f_n / d l`, N/m.
    pub normal_stiffness: f64,
    /// `d f_t / d s`, N/m.
    pub tangential_stiffness: f64,
    /// Moment per relative spin, N m.
    pub rolling_stiffness: f64,
    /// Normal force, N; negative in compression.
    pub normal_force: f64,
    /// Tangential force, N; perpendicular to the normal.
    pub tangential_force: [f64; D],
    /// Whether the contact slid during the ramp that led here.
    pub slid: bool,
    /// Whether it is at the Coulomb limit in the relaxed state.
    pub at_limit: bool,
}

impl<const D: usize> Link<D> {
    /// Force on the origin grain, N.
    pub(super) fn force(&self) -> [f64; D] {
        std::array::from_fn(|axis| self.normal_force * self.normal[axis] + self.tangential_force[axis])
    }
}

/// Grains and contacts of a frozen network.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LinkedGrains<const D: usize> {
    /// Volume of the cell, m3.
    pub volume: f64,
    /// Radius of each grain, m.
    pub radii: Vec<f64>,
    /// Whether grains turn against the cell.
    pub rotations_free: bool,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Contacts, in the network's order.
    pub links: Vec<Link<D>>,
}

impl<const D: usize> LinkedGrains<D> {
    /// Reads a network of the same dimension.
    pub(super) fn of<S: Space>(network: &ContactNetwork<S>) -> Self {
        let links = network
            .contacts
            .iter()
            .map(|contact| {
                let (origin, end) = (contact.origin as usize, contact.end as usize);
                let (branch, force) = (network.branch(contact), network.force(contact));
                let length = branch.norm();
                let normal: [f64; D] = std::array::from_fn(|axis| branch[axis] / length);
                let half_difference = 0.5 * (network.radii[origin] - network.radii[end]);
                Link {
                    origin,
                    end,
                    shift: std::array::from_fn(|axis| contact.shift[axis]),
                    branch: std::array::from_fn(|axis| branch[axis]),
                    length,
                    normal,
                    arms: [0.5 * length + half_difference, 0.5 * length - half_difference],
                    normal_stiffness: contact.normal_stiffness,
                    tangential_stiffness: contact.tangential_stiffness,
                    rolling_stiffness: contact.rolling_stiffness,
                    normal_force: contact.normal_force,
                    tangential_force: std::array::from_fn(|axis| force[axis] - contact.normal_force * normal[axis]),
                    slid: contact.slid,
                    at_limit: contact.at_limit,
                }
            })
            .collect();
        Self {
            volume: network.volume().abs(),
            radii: network.radii.clone(),
            rotations_free: network.rotations_free,
            friction: network.friction,
            links,
        }
    }

    /// Love-Weber stress, Pa.
    pub(super) fn stress(&self) -> [[f64; D]; D] {
        let mut sum = [[0.0; D]; D];
        for link in &self.links {
            let force = link.force();
            for (i, row) in sum.iter_mut().enumerate() {
                for (j, value) in row.iter_mut().enumerate() {
                    *value += force[i] * link.branch[j];
                }
            }
        }
        sum.map(|row| row.map(|value| value / self.volume))
    }
}

/// Scalar product.
#[inline(always)]
pub(super) fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for axis in 0..D {
        sum += a[axis] * b[axis];
    }
    sum
}

/// The unit spin about axis `spin` times the vector: the velocity of a point at `vector`. In the plane the only spin is
/// counter-clockwise.
#[inline(always)]
pub(super) fn turned<const D: usize>(spin: usize, vector: &[f64; D]) -> [f64; D] {
    let mut result = [0.0; D];
    let [first, second] = if D == 2 { [0, 1] } else { [(spin + 1) % 3, (spin + 2) % 3] };
    result[first] = -vector[second];
    result[second] = vector[first];
    result
}
