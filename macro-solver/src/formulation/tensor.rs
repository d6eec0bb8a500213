//! Tensors of the wire as matrices.
//!
//! A fourth-order tensor is a 9x9 matrix over the pairs `3 i + j`, the layout of the wire. Plane problems use the
//! pairs without z.

use nalgebra::{Matrix3, SMatrix, SVector};
use protocol::{Tensor2, Tensor4};

/// A fourth-order tensor over the pairs `3 i + j`.
pub type Operator = SMatrix<f64, 9, 9>;

/// A second-order tensor as a column over the pairs `3 i + j`.
pub type Column = SVector<f64, 9>;

/// A wire tensor as a matrix.
pub fn matrix(tensor: &Tensor2) -> Matrix3<f64> {
    Matrix3::from_row_slice(&tensor.0)
}

/// A matrix as a wire tensor.
pub fn tensor(matrix: &Matrix3<f64>) -> Tensor2 {
    Tensor2(std::array::from_fn(|pair| matrix[(pair / 3, pair % 3)]))
}

/// A wire operator as a matrix.
pub fn operator(tensor: &Tensor4) -> Operator {
    Operator::from_row_slice(&tensor.0)
}

/// A matrix as a wire operator.
pub fn wire_operator(operator: &Operator) -> Tensor4 {
    Tensor4(std::array::from_fn(|entry| operator[(entry / 9, entry % 9)]))
}

/// A tensor as a column.
pub fn column(matrix: &Matrix3<f64>) -> Column {
    Column::from_fn(|pair, _| matrix[(pair / 3, pair % 3)])
}

/// A column as a tensor.
pub fn from_column(column: &Column) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| column[3 * i + j])
}

/// The unit tensor `e_k e_l` of a pair `3 k + l`.
pub fn unit(pair: usize) -> Matrix3<f64> {
    let mut unit = Matrix3::zeros();
    unit[(pair / 3, pair % 3)] = 1.0;
    unit
}

/// `lambda delta_ij delta_kl + G (delta_ik delta_jl + delta_il delta_jk)`, Pa.
pub(crate) fn isotropic_moduli(lambda: f64, shear: f64) -> Operator {
    Operator::from_fn(|row, column| {
        let (i, j, k, l) = (row / 3, row % 3, column / 3, column % 3);
        let delta = |a: usize, b: usize| f64::from(u8::from(a == b));
        lambda * delta(i, j) * delta(k, l) + shear * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k))
    })
}
