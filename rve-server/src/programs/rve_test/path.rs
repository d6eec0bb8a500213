//! Kinematics of one increment: from the strain accumulated in a segment to the target of a trial.
//!
//! Element tests compute with tensors of space throughout; a plane cell keeps `F_33 = 1` and everything else out of its
//! plane at zero.

use crate::space::{Tensor, add_scaled, inverse, product};
use protocol::Tensor4;

/// A tensor of space.
pub(super) type Matrix = [[f64; 3]; 3];

/// An operator as `[ij][kl]`, pairs ordered 11, 12, 13, 21, ...
pub(super) type Operator = [[f64; COMPONENTS]; COMPONENTS];

/// Number of components of a tensor.
pub(super) const COMPONENTS: usize = 9;

/// Deformation gradient at the start of a segment and at the last accepted row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SegmentKinematics {
    /// F0, relative to the packing as given.
    pub at_start: Matrix,
    /// F of the committed state, relative to the packing as given.
    pub committed: Matrix,
}

impl SegmentKinematics {
    /// `F = (I + G) F0`.
    pub(super) fn deformation(&self, gradient: &Matrix) -> Matrix {
        product(&add_scaled(&Matrix::IDENTITY, 1.0, gradient), &self.at_start)
    }

    /// Target `H = F Fc^-1 - I` of a trial from the committed state `Fc = (I + Gc) F0`, formed from the small difference
    /// `(G - Gc) F0 Fc^-1` so that no digits are lost.
    pub(super) fn target(&self, gradient: &Matrix, committed_gradient: &Matrix) -> Matrix {
        let change = add_scaled(gradient, -1.0, committed_gradient);
        product(&product(&change, &self.at_start), &inverse(&self.committed))
    }
}

/// Turns `d sigma / dF` with `F` relative to the present state into `d sigma / dG`:
/// `dF = dG (I + G)^-1`, hence `J_ij,kl = sum_m C_ij,km ((I + G)^-1)_lm`.
pub(super) fn by_gradient(operator: &Tensor4, gradient: &Matrix) -> Operator {
    let inverse = inverse(&add_scaled(&Matrix::IDENTITY, 1.0, gradient));
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let (i, j, k, l) = (row / 3, row % 3, column / 3, column % 3);
            (0..3).map(|m| operator.get(i, j, k, m) * inverse[l][m]).sum()
        })
    })
}

/// The components in the order 11, 12, 13, 21, ...
pub(super) fn flat(tensor: &Matrix) -> [f64; COMPONENTS] {
    std::array::from_fn(|place| tensor[place / 3][place % 3])
}

/// The tensor of components in the order 11, 12, 13, 21, ...
pub(super) fn tensor_of(values: &[f64; COMPONENTS]) -> Matrix {
    Matrix::from_fn(|i, j| values[3 * i + j])
}
