//! Dense contributions to the global matrix.

/// Degrees of freedom of the rows and columns of a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct BlockDofs {
    /// Those of the rows.
    pub(crate) rows: Vec<usize>,
    /// Those of the columns; `None`: those of the rows.
    other_columns: Option<Vec<usize>>,
}

impl BlockDofs {
    /// Of a block whose rows and columns belong to the same degrees of freedom.
    pub(crate) fn square(dofs: Vec<usize>) -> Self {
        Self { rows: dofs, other_columns: None }
    }

    /// Of a block whose forces depend on more displacements than those that they act on.
    pub(crate) fn wide(rows: Vec<usize>, columns: Vec<usize>) -> Self {
        Self { rows, other_columns: Some(columns) }
    }

    /// Degrees of freedom of the columns.
    pub(crate) fn columns(&self) -> &[usize] {
        self.other_columns.as_deref().unwrap_or(&self.rows)
    }

    /// The same with other numbers; `change` is given all rows, or all columns.
    pub(crate) fn map(&self, change: impl Fn(&[usize]) -> Vec<usize>) -> Self {
        Self { rows: change(&self.rows), other_columns: self.other_columns.as_deref().map(change) }
    }
}

/// Dense contribution to the global matrix, row-major.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Degrees of freedom of its rows and columns.
    pub(crate) dofs: BlockDofs,
    /// Entries, N/m per metre of thickness.
    pub(crate) matrix: Vec<f64>,
}

impl Block {
    /// A zero block.
    pub(crate) fn zero(dofs: BlockDofs) -> Self {
        let matrix = vec![0.0; dofs.rows.len() * dofs.columns().len()];
        Self { dofs, matrix }
    }

    /// Largest entry whose row and column are the same degree of freedom, by its size, N/m per metre of thickness.
    pub(crate) fn largest_diagonal(&self) -> f64 {
        let columns = self.dofs.columns();
        let entry = |(row, dof): (usize, &usize)| {
            let column = columns.iter().position(|column| column == dof)?;
            Some(self.matrix[row * columns.len() + column].abs())
        };
        self.dofs.rows.iter().enumerate().filter_map(entry).fold(0.0, f64::max)
    }
}
