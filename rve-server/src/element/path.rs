//! Kinematics of one increment: from the strain accumulated in a segment to the target of a trial.

use crate::plane::{self, Plane};
use crate::tangent::PlaneOperator;

/// Deformation gradient at the start of a segment and at the last accepted row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SegmentKinematics {
    /// F0, relative to the packing as given.
    pub at_start: Plane,
    /// F of the committed state, relative to the packing as given.
    pub committed: Plane,
}

impl SegmentKinematics {
    /// `F = (I + G) F0`.
    pub(super) fn deformation(&self, gradient: &Plane) -> Plane {
        plane::product(&plane::add_scaled(&plane::IDENTITY, 1.0, gradient), &self.at_start)
    }

    /// Target `H = F Fc^-1 - I` of a trial from the committed state `Fc = (I + Gc) F0`, formed from the small difference
    /// `(G - Gc) F0 Fc^-1` so that no digits are lost.
    pub(super) fn target(&self, gradient: &Plane, committed_gradient: &Plane) -> Plane {
        let change = plane::add_scaled(gradient, -1.0, committed_gradient);
        plane::product(&plane::product(&change, &self.at_start), &plane::inverse(&self.committed))
    }
}

/// Turns `d sigma / dF` with `F` relative to the present state into `d sigma / dG`:
/// `dF = dG (I + G)^-1`, hence `J_ij,kl = sum_m C_ij,km ((I + G)^-1)_lm`.
pub(super) fn by_gradient(operator: &PlaneOperator, gradient: &Plane) -> PlaneOperator {
    let inverse = plane::inverse(&plane::add_scaled(&plane::IDENTITY, 1.0, gradient));
    operator.map(|row| {
        std::array::from_fn(|column| {
            let (k, l) = (column / 2, column % 2);
            row[2 * k] * inverse[l][0] + row[2 * k + 1] * inverse[l][1]
        })
    })
}

/// The four components in the order 11, 12, 21, 22.
pub(super) fn flat(tensor: &Plane) -> [f64; 4] {
    [tensor[0][0], tensor[0][1], tensor[1][0], tensor[1][1]]
}

/// The tensor of four components in the order 11, 12, 21, 22.
pub(super) fn plane_of(values: &[f64; 4]) -> Plane {
    [[values[0], values[1]], [values[2], values[3]]]
}
