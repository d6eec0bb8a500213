//! Plane tensors between the wire and the elements, and the moduli that make the tangent consistent.
//!
//! A plane fourth-order tensor is a 4x4 matrix over the pairs 11, 12, 21, 22.

use nalgebra::{Matrix2, Matrix4};
use protocol::{Tensor2, Tensor4};

/// The plane part of a tensor.
pub(super) fn plane(tensor: &Tensor2) -> Matrix2<f64> {
    let plane = tensor.plane();
    Matrix2::from_fn(|i, j| plane[i][j])
}

/// Embeds a plane tensor; out-of-plane components are zero.
pub(super) fn full(plane: &Matrix2<f64>) -> Tensor2 {
    Tensor2::from_plane([[plane[(0, 0)], plane[(0, 1)]], [plane[(1, 0)], plane[(1, 1)]]])
}

/// Embeds a plane deformation gradient; out of plane nothing stretches.
pub(super) fn full_deformation(plane: &Matrix2<f64>) -> Tensor2 {
    let mut tensor = full(plane);
    tensor.0[8] = 1.0;
    tensor
}

/// The plane part of an operator.
pub(super) fn plane_operator(operator: &Tensor4) -> Matrix4<f64> {
    let plane = operator.plane();
    Matrix4::from_fn(|row, column| plane[row][column])
}

/// `A_ijkl = C_ijkl + sigma_ij delta_kl - sigma_il delta_jk`: change of the nominal stress on the current
/// configuration with the displacement gradient on it, from `C = d sigma / d F` relative to the current state.
///
/// The first added term is the change of volume, the second the change of the area that carries the traction.
pub(super) fn spatial_moduli(tangent: &Matrix4<f64>, stress: &Matrix2<f64>) -> Matrix4<f64> {
    Matrix4::from_fn(|row, column| {
        let (i, j, k, l) = (row / 2, row % 2, column / 2, column % 2);
        let volume = if k == l { stress[(i, j)] } else { 0.0 };
        let area = if j == k { stress[(i, l)] } else { 0.0 };
        tangent[(row, column)] + volume - area
    })
}

/// A plane tensor as a column over the pairs 11, 12, 21, 22.
pub(super) fn column(tensor: &Matrix2<f64>) -> nalgebra::Vector4<f64> {
    nalgebra::Vector4::new(tensor[(0, 0)], tensor[(0, 1)], tensor[(1, 0)], tensor[(1, 1)])
}
