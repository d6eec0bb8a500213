//! Numbers as bytes in native order.

use protocol::{Tensor2, Tensor4};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

/// The numbers of an array of `float64`.
pub(crate) fn floats(bytes: &[u8]) -> impl Iterator<Item = f64> {
    bytes.as_chunks().0.iter().map(|chunk| f64::from_ne_bytes(*chunk))
}

/// The numbers of an array of `int64`, none negative.
pub(crate) fn indices(bytes: &[u8]) -> PyResult<Vec<usize>> {
    let number = |chunk: &[u8; 8]| usize::try_from(i64::from_ne_bytes(*chunk));
    let read: Result<_, _> = bytes.as_chunks().0.iter().map(number).collect();
    read.map_err(|_| PyValueError::new_err("numbers of states are not negative"))
}

/// Tensors of an array `(n, dimension, dimension)`.
pub(crate) fn tensors(bytes: &[u8], dimension: usize) -> Vec<Tensor2> {
    let numbers: Vec<f64> = floats(bytes).collect();
    let tensor = |block: &[f64]| {
        let mut full = Tensor2::ZERO;
        for (row, values) in block.chunks_exact(dimension).enumerate() {
            full.0[3 * row..3 * row + dimension].copy_from_slice(values);
        }
        full
    };
    numbers.chunks_exact(dimension * dimension).map(tensor).collect()
}

/// Components of a tensor that a cell of this dimension has.
pub(crate) fn components(tensor: &Tensor2, dimension: usize) -> impl Iterator<Item = f64> {
    (0..dimension).flat_map(move |i| (0..dimension).map(move |j| tensor.get(i, j)))
}

/// Components `ijkl` of an operator that a cell of this dimension has.
pub(crate) fn operator(tensor: &Tensor4, dimension: usize) -> impl Iterator<Item = f64> {
    let pairs = move || (0..dimension).flat_map(move |i| (0..dimension).map(move |j| (i, j)));
    pairs().flat_map(move |(i, j)| pairs().map(move |(k, l)| tensor.get(i, j, k, l)))
}

/// A byte array of numbers, which Python may write to.
pub(crate) fn bytes<'py, const N: usize>(
    py: Python<'py>,
    numbers: impl Iterator<Item = [u8; N]>,
) -> Bound<'py, PyByteArray> {
    let flat: Vec<u8> = numbers.flatten().collect();
    PyByteArray::new(py, &flat)
}
