//! A cell as people look at it: grains and contacts with their forces, in coordinates of space whatever the dimension.

use crate::cell::{ContactNetwork, GrainState};
use crate::space::{Components, Space};

/// Grains and contacts of one state of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct CellPicture {
    /// 2 for discs, 3 for spheres.
    pub dimension: usize,
    /// Periodicity vectors, m; as many as dimensions. Of a frame of boundary grains the mean deformation of those of all its copies; empty
    /// for specimens.
    pub cell: Vec<[f64; 3]>,
    /// Corners of a body that is no periodic cell, in order, m: the centres of the boundary grains of a frame, or the box around the grains of
    /// a specimen. Empty for a periodic cell.
    pub outline: Vec<[f64; 3]>,
    /// Centres of the grains, m; not wrapped into the cell.
    pub centres: Vec<[f64; 3]>,
    /// Radii, m.
    pub radii: Vec<f64>,
    /// Spin of each grain added up since the start, rad; of discs in the third component, counter-clockwise.
    pub rotations: Vec<[f64; 3]>,
    /// Whether each grain is a rattler; empty where that is not known, as in specimens.
    pub rattlers: Vec<bool>,
    /// Contacts in sorted pair order.
    pub contacts: Vec<ContactLine>,
}

/// A contact as a line from centre to centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLine {
    /// The two grains.
    pub grains: [u32; 2],
    /// Centre of the first one, m.
    pub from: [f64; 3],
    /// Centre of the second one, m: that of the image which touches.
    pub to: [f64; 3],
    /// Normal force, N; tension positive, so negative where grains press on each other.
    pub normal_force: f64,
    /// Size of the tangential force, N.
    pub tangential_force: f64,
    /// Force on the first grain, normal and tangential, N; on the second one it is the opposite.
    pub force: [f64; 3],
    /// Overlap of the grains, m; negative across the gap of a contact that adheres.
    pub overlap: f64,
    /// Whether the contact is at the Coulomb limit.
    pub is_sliding: bool,
}

impl CellPicture {
    /// The picture of a network and the state that it was made from.
    pub fn new<S: Space>(network: &ContactNetwork<S>, state: &GrainState<S>) -> Self {
        Self {
            dimension: S::DIMENSION,
            cell: (0..S::DIMENSION).map(|row| in_space::<S>(network.cell[row])).collect(),
            outline: Vec::new(),
            centres: network.positions.iter().map(|position| in_space::<S>(*position)).collect(),
            radii: network.radii.clone(),
            rotations: state.rotations.iter().map(|rotation| S::spin_in_space(*rotation)).collect(),
            rattlers: network.rattlers(),
            contacts: network.contact_lines(),
        }
    }
}

impl<S: Space> ContactNetwork<S> {
    /// The contacts as lines.
    pub fn contact_lines(&self) -> Vec<ContactLine> {
        let line = |contact: &crate::cell::NetworkContact<S>| {
            let (origin, end) = (contact.origin as usize, contact.end as usize);
            let (from, branch) = (self.positions[origin], self.branch(contact));
            ContactLine {
                grains: [contact.origin, contact.end],
                from: in_space::<S>(from),
                to: in_space::<S>(from.plus(branch)),
                normal_force: contact.normal_force,
                tangential_force: contact.tangential_force.norm(),
                force: in_space::<S>(self.force(contact)),
                overlap: self.radii[origin] + self.radii[end] - branch.norm(),
                is_sliding: contact.at_limit,
            }
        };
        self.contacts.iter().map(line).collect()
    }
}

/// A vector with zeros for the axes that the space does not have.
fn in_space<S: Space>(vector: S::Vector) -> [f64; 3] {
    std::array::from_fn(|axis| if axis < S::DIMENSION { vector[axis] } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::NetworkContact;
    use crate::space::Discs;

    /// Two discs that touch across the right border of the cell.
    #[test]
    fn a_contact_runs_to_the_image_that_touches() {
        let contact = NetworkContact {
            origin: 0,
            end: 1,
            shift: [1, 0],
            normal_stiffness: 1.0,
            tangential_stiffness: 0.5,
            rolling_stiffness: 0.0,
            normal_force: -3.0,
            tangential_force: -0.5,
            slid: false,
            at_limit: true,
        };
        let network = ContactNetwork::<Discs> {
            cell: [[4.0, 0.0], [0.0, 2.0]],
            thickness: 1.0,
            positions: vec![[3.5, 1.0], [0.4, 1.0]],
            radii: vec![0.5, 0.5],
            rotations_free: true,
            friction: 0.5,
            contacts: vec![contact],
        };
        let [line] = network.contact_lines()[..] else { panic!("one contact") };
        assert_eq!((line.grains, line.from, line.is_sliding), ([0, 1], [3.5, 1.0, 0.0], true));
        assert!((line.to[0] - 4.4).abs() < 1e-15 && (line.overlap - 0.1).abs() < 1e-15);
        assert_eq!((line.normal_force, line.tangential_force), (-3.0, 0.5));
        // Along the normal turned by +90 degrees, f_t is -0.5.
        assert_eq!(line.force, [-3.0, -0.5, 0.0]);
    }
}
