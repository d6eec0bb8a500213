//! Dense contributions to the global matrix.

/// Dense square contribution to the global matrix, row-major.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Degrees of freedom of its rows and columns.
    pub(crate) dofs: Vec<usize>,
    /// Entries, N/m per metre of thickness.
    pub(crate) matrix: Vec<f64>,
}

impl Block {
    /// A zero block.
    pub(crate) fn zero(dofs: Vec<usize>) -> Self {
        let matrix = vec![0.0; dofs.len() * dofs.len()];
        Self { dofs, matrix }
    }
}
