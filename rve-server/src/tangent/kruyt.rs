//! The uniform-strain operator (UKO, [Argilaga2018] eq. 13) in its objective form.

use super::PlaneOperator;
use super::contact_stiffness::ContactGeometry;
use crate::network::ContactNetwork;

/// The stiffness of a network whose grains all follow the mean strain and spin with the mean rotation, Pa.
///
/// Erratum: the printed operator lets the whole displacement gradient shear the contacts, so that a rigid rotation
/// changes the stress and `d sigma` is not symmetric. Here strain alone acts, which symmetrises the tangential part in
/// both index pairs; that is also the true upper bound of the network operators at vanishing prestress. Prestress terms
/// are left out. All contacts stick.
pub fn operator(network: &ContactNetwork) -> PlaneOperator {
    let mut sum = [[0.0; 4]; 4];
    for contact in &network.contacts {
        let geometry = ContactGeometry::of(network, contact);
        let (e, t) = (geometry.normal, geometry.tangent);
        let normal = [e[0] * e[0], e[0] * e[1], e[1] * e[0], e[1] * e[1]];
        let shear = 0.5 * (t[0] * e[1] + e[0] * t[1]);
        let tangential = [t[0] * e[0], shear, shear, t[1] * e[1]];
        let square = geometry.length * geometry.length;
        for (row, sum_row) in sum.iter_mut().enumerate() {
            for (column, value) in sum_row.iter_mut().enumerate() {
                *value += square
                    * (contact.normal_stiffness * normal[row] * normal[column]
                        + contact.tangential_stiffness * tangential[row] * tangential[column]);
            }
        }
    }
    let volume = super::volume(network);
    sum.map(|row| row.map(|value| value / volume))
}
