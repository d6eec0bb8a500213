//! Geometry and incremental law of one frozen contact.

use crate::network::{ContactNetwork, NetworkContact};

/// Incremental law `(df_n, df_t) = D (dn, ds)` of one contact, N/m. `dn` is the change of length of the branch vector,
/// `ds` the relative tangential displacement of the two grains at the contact point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ContactStiffness {
    /// `d f_n / dn`.
    pub normal: f64,
    /// `d f_t / ds`.
    pub tangential: f64,
    /// `d f_t / dn`: not zero when the contact slips, because the cone narrows as it unloads.
    pub coupling: f64,
}

impl ContactStiffness {
    /// Both springs act.
    pub(super) fn sticking(contact: &NetworkContact) -> Self {
        Self { normal: contact.normal_stiffness, tangential: contact.tangential_stiffness, coupling: 0.0 }
    }

    /// The tangential force follows the Coulomb cone `|f_t| = friction (c - f_n)` with constant cohesion force c, and
    /// slip changes no normal distance (non-associated).
    pub(super) fn slipping(contact: &NetworkContact, friction: f64) -> Self {
        let direction = if contact.tangential_force < 0.0 { -1.0 } else { 1.0 };
        Self {
            normal: contact.normal_stiffness,
            tangential: 0.0,
            coupling: -direction * friction * contact.normal_stiffness,
        }
    }
}

/// Geometry of one contact in the current state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ContactGeometry {
    /// Part of the branch vector that comes from the cell shifts, m.
    pub shift: [f64; 2],
    /// Branch vector from origin to end grain, m.
    pub branch: [f64; 2],
    /// Its length, m.
    pub length: f64,
    /// Unit normal.
    pub normal: [f64; 2],
    /// Unit tangent, the normal rotated by +90 degrees.
    pub tangent: [f64; 2],
    /// Distances of the contact point from the origin and the end centre, m; they add up to `length`.
    pub arms: [f64; 2],
}

impl ContactGeometry {
    /// The contact point halves the overlap: [Argilaga2018] app. A with alpha = 1/2.
    pub(super) fn of(network: &ContactNetwork, contact: &NetworkContact) -> Self {
        let (origin, end) = (contact.origin as usize, contact.end as usize);
        let mut shift = [0.0; 2];
        let mut branch = [0.0; 2];
        for axis in 0..2 {
            shift[axis] = f64::from(contact.shift[0]) * network.cell[0][axis]
                + f64::from(contact.shift[1]) * network.cell[1][axis];
            branch[axis] = network.positions[end][axis] + shift[axis] - network.positions[origin][axis];
        }
        let length = branch[0].hypot(branch[1]);
        let normal = [branch[0] / length, branch[1] / length];
        let half_difference = 0.5 * (network.radii[origin] - network.radii[end]);
        Self {
            shift,
            branch,
            length,
            normal,
            tangent: [-normal[1], normal[0]],
            arms: [0.5 * length + half_difference, 0.5 * length - half_difference],
        }
    }
}
