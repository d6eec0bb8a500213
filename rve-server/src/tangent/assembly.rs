//! The linear system of a frozen network and the stress rate that follows from its solution.
//!
//! Unknowns are periodic fluctuations `w` of the grain centres round the mean field and grain spins, each spin times the
//! grain's radius so that all unknowns are lengths. A contact sees `db = dF b + w_E - w_O`. The equations say that the
//! forces and moments on every grain stay balanced to first order, geometric changes included; this is appendix B of
//! [Argilaga2018] with the mean field moved to the right-hand side.

use super::PlaneOperator;
use super::backbone::Backbone;
use super::block_matrix::{BLOCK, BlockMatrix};
use super::contact_stiffness::{ContactGeometry, ContactStiffness};
use crate::network::{ContactNetwork, NetworkContact};

/// The four unit displacement gradients, pairs ordered 11, 12, 21, 22.
pub(super) const DIRECTIONS: usize = 4;

/// Values of the four directions.
pub(super) type Quadruple = [f64; DIRECTIONS];

/// Change of length, tangential slip and transverse motion of a contact.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    lengthening: f64,
    slip: f64,
    transverse: f64,
}

/// What a motion does to a contact: change of the force on the origin grain along the old normal and tangent, and of the
/// moments on both grains.
#[derive(Clone, Copy, Debug)]
struct Response {
    along_normal: f64,
    along_tangent: f64,
    moments: [f64; 2],
}

/// One contact of the backbone with all that its linearisation needs.
struct Linearisation<'a> {
    contact: &'a NetworkContact,
    stiffness: ContactStiffness,
    geometry: ContactGeometry,
    /// Arm of each grain over its radius.
    scaled_arms: [f64; 2],
    radii: [f64; 2],
}

impl<'a> Linearisation<'a> {
    fn all(
        network: &'a ContactNetwork,
        backbone: &'a Backbone,
        stiffness: &'a [ContactStiffness],
    ) -> impl Iterator<Item = (Self, usize, usize)> {
        backbone.contacts.iter().map(move |place| {
            let contact = &network.contacts[place.index];
            let geometry = ContactGeometry::of(network, contact);
            let radii = [backbone.radii[place.origin], backbone.radii[place.end]];
            let scaled_arms = [geometry.arms[0] / radii[0], geometry.arms[1] / radii[1]];
            let linearisation = Self { contact, stiffness: stiffness[place.index], geometry, scaled_arms, radii };
            (linearisation, place.origin, place.end)
        })
    }

    /// `df = (D (dn, ds) + geometric terms)`: [Argilaga2018] eq. B.3 in the frame of the contact. The moment on a grain
    /// is arm x f_t, and half of any lengthening goes to each arm.
    fn respond(&self, motion: Motion) -> Response {
        let (normal_force, tangential_force) = (self.contact.normal_force, self.contact.tangential_force);
        let turn = motion.transverse / self.geometry.length;
        let elastic_shear = self.stiffness.tangential * motion.slip + self.stiffness.coupling * motion.lengthening;
        let from_arm = 0.5 * tangential_force * motion.lengthening;
        Response {
            along_normal: self.stiffness.normal * motion.lengthening - tangential_force * turn,
            along_tangent: elastic_shear + normal_force * turn,
            moments: self.geometry.arms.map(|arm| arm * elastic_shear + from_arm),
        }
    }

    /// The motion of a unit value of the six unknowns (origin, then end).
    fn unit_motions(&self) -> [Motion; 2 * BLOCK] {
        let (e, t) = (self.geometry.normal, self.geometry.tangent);
        let mut motions = [Motion::default(); 2 * BLOCK];
        for axis in 0..2 {
            let end = Motion { lengthening: e[axis], slip: t[axis], transverse: t[axis] };
            motions[BLOCK + axis] = end;
            motions[axis] = Motion { lengthening: -end.lengthening, slip: -end.slip, transverse: -end.transverse };
        }
        motions[2].slip = -self.scaled_arms[0];
        motions[5].slip = -self.scaled_arms[1];
        motions
    }

    /// The motion under the unit displacement gradient `dF_kl`, `direction = 2 k + l`.
    fn mean_motion(&self, direction: usize) -> Motion {
        let (k, l) = (direction / 2, direction % 2);
        let reach = self.geometry.branch[l];
        let transverse = self.geometry.tangent[k] * reach;
        Motion { lengthening: self.geometry.normal[k] * reach, slip: transverse, transverse }
    }

    /// The terms of the six balance equations (origin, then end), moments over radius.
    fn balance_terms(&self, response: &Response) -> [f64; 2 * BLOCK] {
        let force = self.force(response);
        [
            -force[0],
            -force[1],
            -response.moments[0] / self.radii[0],
            force[0],
            force[1],
            -response.moments[1] / self.radii[1],
        ]
    }

    fn force(&self, response: &Response) -> [f64; 2] {
        let (e, t) = (self.geometry.normal, self.geometry.tangent);
        [0, 1].map(|axis| response.along_normal * e[axis] + response.along_tangent * t[axis])
    }
}

/// The balance equations of all kept grains, and their right-hand sides for the four unit displacement gradients.
#[expect(clippy::needless_range_loop, reason = "indices of tensors, as in the equations")]
pub(super) fn assemble(
    network: &ContactNetwork,
    backbone: &Backbone,
    stiffness: &[ContactStiffness],
) -> (BlockMatrix, Vec<Quadruple>) {
    let pairs = backbone.contacts.iter().map(|contact| (contact.origin, contact.end));
    let mut matrix = BlockMatrix::with_pattern(backbone.radii.len(), pairs);
    let mut loads = vec![[0.0; DIRECTIONS]; BLOCK * backbone.radii.len()];
    for (linearisation, origin, end) in Linearisation::all(network, backbone, stiffness) {
        let grains = [origin, end];
        let mut local = [[0.0; 2 * BLOCK]; 2 * BLOCK];
        for (column, motion) in linearisation.unit_motions().into_iter().enumerate() {
            let terms = linearisation.balance_terms(&linearisation.respond(motion));
            for (row, term) in terms.into_iter().enumerate() {
                local[row][column] = term;
            }
        }
        for (row_place, &row_grain) in grains.iter().enumerate() {
            for (column_place, &column_grain) in grains.iter().enumerate() {
                let block = matrix.block_mut(row_grain, column_grain);
                for (row, values) in block.iter_mut().enumerate() {
                    for (column, value) in values.iter_mut().enumerate() {
                        *value += local[BLOCK * row_place + row][BLOCK * column_place + column];
                    }
                }
            }
        }
        for direction in 0..DIRECTIONS {
            let terms = linearisation.balance_terms(&linearisation.respond(linearisation.mean_motion(direction)));
            for (row, term) in terms.into_iter().enumerate() {
                loads[BLOCK * grains[row / BLOCK] + row % BLOCK][direction] -= term;
            }
        }
    }
    (matrix, loads)
}

/// `d sigma = 1/V sum_c (s_c (x) df) + sigma dF^T - tr(dF) sigma` with `s_c` the cell shift of contact c: [Argilaga2018]
/// eq. 23 at `F = I`. Only contacts across the cell border contribute to the sum.
#[expect(clippy::needless_range_loop, reason = "indices of tensors, as in the equations")]
pub(super) fn stress_rate(
    network: &ContactNetwork,
    backbone: &Backbone,
    stiffness: &[ContactStiffness],
    solution: &[Quadruple],
) -> PlaneOperator {
    let mut sum = [[0.0; DIRECTIONS]; 4];
    let mut stress_sum = [[0.0; 2]; 2];
    for (linearisation, origin, end) in Linearisation::all(network, backbone, stiffness) {
        let geometry = &linearisation.geometry;
        for i in 0..2 {
            let force = linearisation.contact.normal_force * geometry.normal[i]
                + linearisation.contact.tangential_force * geometry.tangent[i];
            for j in 0..2 {
                stress_sum[i][j] += force * geometry.branch[j];
            }
        }
        if linearisation.contact.shift == [0, 0] {
            continue;
        }
        let unit_motions = linearisation.unit_motions();
        for direction in 0..DIRECTIONS {
            let mut motion = linearisation.mean_motion(direction);
            for (place, unit) in unit_motions.iter().enumerate() {
                let grain = if place < BLOCK { origin } else { end };
                let amount = solution[BLOCK * grain + place % BLOCK][direction];
                motion.lengthening += amount * unit.lengthening;
                motion.slip += amount * unit.slip;
                motion.transverse += amount * unit.transverse;
            }
            let force = linearisation.force(&linearisation.respond(motion));
            for i in 0..2 {
                for j in 0..2 {
                    sum[2 * i + j][direction] += force[i] * geometry.shift[j];
                }
            }
        }
    }
    for (row, values) in sum.iter_mut().enumerate() {
        let (i, j) = (row / 2, row % 2);
        for (direction, value) in values.iter_mut().enumerate() {
            let (k, l) = (direction / 2, direction % 2);
            if j == k {
                *value += stress_sum[i][l];
            }
            if k == l {
                *value -= stress_sum[i][j];
            }
        }
    }
    let volume = super::volume(network);
    sum.map(|row| row.map(|value| value / volume))
}
