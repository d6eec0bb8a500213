//! Sparse direct solution of the global equations.
//!
//! LU with partial pivoting: the matrix is not symmetric (slip tangents, follower pressure) and past the peak not
//! definite. The pattern and its symbolic factor are computed once per run. One thread and a fixed order of additions
//! make the result reproducible to the bit.

use super::constraints::Constraints;
use faer::prelude::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use thiserror::Error;

/// The equations cannot be solved.
#[derive(Debug, Error, PartialEq)]
pub(super) enum LinearSolverError {
    /// No usable pivot, or a solution that does not satisfy the equations.
    #[error(
        "the global stiffness is singular: some part of the specimen has lost its stiffness or is not held \
         (relative error of a solution {error:.1e})"
    )]
    Singular {
        /// Relative error, infinite when there was no solution at all.
        error: f64,
    },
    /// An entry is NaN or infinite.
    #[error("the global stiffness has entries that are not finite")]
    NotFinite,
    /// The machine ran out of memory, or the matrix is too large for its index type.
    #[error("the global stiffness could not be factorized: {0}")]
    Resources(String),
}

/// Largest accepted `|K x - b| / |b|` after one refinement.
const LARGEST_ERROR: f64 = 1e-6;

/// Largest accepted relative error of a known solution found again: condition numbers beyond about 1e13 are refused.
const LARGEST_PROBE_ERROR: f64 = 1e-3;

/// Dense square contribution to the global matrix, row-major.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Degrees of freedom of its rows and columns.
    pub(super) dofs: Vec<usize>,
    /// Entries, N/m per metre of thickness.
    pub(super) matrix: Vec<f64>,
}

impl Block {
    /// A zero block.
    pub(super) fn zero(dofs: Vec<usize>) -> Self {
        let matrix = vec![0.0; dofs.len() * dofs.len()];
        Self { dofs, matrix }
    }
}

/// The global matrix over the unknowns and its factors.
pub(super) struct LinearSolver {
    pattern: SymbolicSparseColMat<usize>,
    values: Vec<f64>,
    /// For every entry of every block, in order: its place in `values`; `None` in prescribed rows or columns.
    places: Vec<Option<usize>>,
    symbolic: Option<SymbolicLu<usize>>,
    factors: Option<Lu<usize, f64>>,
    symbolic_count: u64,
    numeric_count: u64,
}

impl LinearSolver {
    /// Prepares the pattern for blocks over these degrees of freedom; later blocks must keep this order.
    pub(super) fn new<'a>(blocks: impl Iterator<Item = &'a [usize]> + Clone, constraints: &Constraints) -> Self {
        let size = constraints.free().len();
        let mut columns: Vec<Vec<usize>> = vec![Vec::new(); size];
        for dofs in blocks.clone() {
            for column in dofs.iter().filter_map(|&dof| constraints.unknown(dof)) {
                columns[column].extend(dofs.iter().filter_map(|&dof| constraints.unknown(dof)));
            }
        }
        let mut starts = vec![0];
        let mut rows = Vec::new();
        for column in &mut columns {
            column.sort_unstable();
            column.dedup();
            rows.extend_from_slice(column);
            starts.push(rows.len());
        }
        let mut places = Vec::new();
        for dofs in blocks {
            for &row in dofs {
                for &column in dofs {
                    places.push(constraints.unknown(row).zip(constraints.unknown(column)).map(|(row, column)| {
                        let within =
                            columns[column].binary_search(&row).expect("the pattern holds every block entry");
                        starts[column] + within
                    }));
                }
            }
        }
        let values = vec![0.0; rows.len()];
        let pattern = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        Self { pattern, values, places, symbolic: None, factors: None, symbolic_count: 0, numeric_count: 0 }
    }

    /// Symbolic factorizations so far: 1 once anything was solved.
    pub(super) fn symbolic_count(&self) -> u64 {
        self.symbolic_count
    }

    /// Numeric factorizations so far.
    pub(super) fn numeric_count(&self) -> u64 {
        self.numeric_count
    }

    /// Counts on from an earlier process; the pattern is analysed again, which changes no bit and is not counted.
    pub(super) fn count_from(&mut self, symbolic: u64, numeric: u64) {
        self.symbolic_count = symbolic;
        self.numeric_count = numeric;
    }

    /// Adds up the blocks and factorizes the sum.
    ///
    /// # Errors
    /// See [`LinearSolverError`].
    pub(super) fn factorize(&mut self, blocks: &[Block]) -> Result<(), LinearSolverError> {
        self.values.fill(0.0);
        let entries = blocks.iter().flat_map(|block| &block.matrix);
        for (place, entry) in self.places.iter().zip(entries) {
            if let Some(place) = place {
                self.values[*place] += entry;
            }
        }
        self.factors = None;
        if self.values.is_empty() {
            return Ok(());
        }
        if !self.values.iter().all(|value| value.is_finite()) {
            return Err(LinearSolverError::NotFinite);
        }
        if self.symbolic.is_none() {
            let symbolic = SymbolicLu::try_new(self.pattern.as_ref())
                .map_err(|error| LinearSolverError::Resources(format!("{error:?}")))?;
            self.symbolic = Some(symbolic);
            self.symbolic_count = self.symbolic_count.max(1);
        }
        let symbolic = self.symbolic.clone().expect("computed above");
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.values);
        self.numeric_count += 1;
        let factors = Lu::try_new_with_symbolic(symbolic, matrix).map_err(|error| match error {
            faer::sparse::linalg::LuError::SymbolicSingular { .. } => {
                LinearSolverError::Singular { error: f64::INFINITY }
            }
            faer::sparse::linalg::LuError::Generic(error) => LinearSolverError::Resources(format!("{error:?}")),
        })?;
        let error = self.probe(&factors);
        if error.is_nan() || error > LARGEST_PROBE_ERROR {
            return Err(LinearSolverError::Singular { error });
        }
        self.factors = Some(factors);
        Ok(())
    }

    /// Relative error with which the factors find a known vector again. Zero pivots do not stop the factorization,
    /// and a singular matrix has a solution for some right-hand sides, so only this tells them apart.
    fn probe(&self, factors: &Lu<usize, f64>) -> f64 {
        let known: Vec<f64> = (0..self.pattern.ncols()).map(|row| 1.0 + 0.5 * (row as f64).sin()).collect();
        let opposite = self.defect(&known, &vec![0.0; known.len()]);
        let found = direct(factors, &opposite);
        let error: Vec<f64> = found.iter().zip(&known).map(|(found, known)| found + known).collect();
        norm(&error) / norm(&known)
    }

    /// Solves for one right-hand side with the last factors, refined once.
    ///
    /// # Errors
    /// [`LinearSolverError::Singular`] if the solution does not satisfy the equations.
    pub(super) fn solve(&self, right: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let length = norm(right);
        if right.is_empty() || length == 0.0 {
            return Ok(vec![0.0; right.len()]);
        }
        let Some(factors) = &self.factors else {
            return Err(LinearSolverError::Singular { error: f64::INFINITY });
        };
        let mut solution = direct(factors, right);
        let correction = direct(factors, &self.defect(&solution, right));
        for (value, change) in solution.iter_mut().zip(&correction) {
            *value += change;
        }
        let error = norm(&self.defect(&solution, right)) / length;
        if error.is_nan() || error > LARGEST_ERROR {
            return Err(LinearSolverError::Singular { error });
        }
        Ok(solution)
    }

    /// `b - K x`.
    fn defect(&self, solution: &[f64], right: &[f64]) -> Vec<f64> {
        let mut defect = right.to_vec();
        for (column, value) in solution.iter().enumerate() {
            for place in self.pattern.col_range(column) {
                defect[self.pattern.row_idx()[place]] -= self.values[place] * value;
            }
        }
        defect
    }
}

/// One forward and backward substitution.
fn direct(factors: &Lu<usize, f64>, right: &[f64]) -> Vec<f64> {
    let mut solution = faer::Col::from_fn(right.len(), |row| right[row]);
    factors.solve_in_place(solution.as_mut());
    solution.iter().copied().collect()
}

/// Euclidean norm, summed in order.
pub(super) fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(length: usize) -> (Vec<Block>, Constraints) {
        let blocks = (0..length).map(|first| Block {
            dofs: vec![first, first + 1],
            matrix: vec![1.5 - (first % 3) as f64, -1.2, -0.8, 0.25 * (first % 2) as f64],
        });
        let mut prescribed = vec![None; length + 1];
        prescribed[0] = Some(0.0);
        (blocks.collect(), Constraints::new(prescribed))
    }

    #[test]
    fn indefinite_nonsymmetric_systems_are_solved_and_the_symbolic_factor_is_kept() {
        let (blocks, constraints) = chain(60);
        let mut solver = LinearSolver::new(blocks.iter().map(|block| block.dofs.as_slice()), &constraints);
        for round in 1..4 {
            solver.factorize(&blocks).unwrap();
            let right: Vec<f64> = (0..60).map(|row| (row as f64).sin()).collect();
            let solution = solver.solve(&right).unwrap();
            assert!(norm(&solver.defect(&solution, &right)) < 1e-12 * norm(&right));
            assert_eq!((solver.symbolic_count(), solver.numeric_count()), (1, round));
        }
    }

    #[test]
    fn singular_systems_are_refused() {
        let block = Block { dofs: vec![0, 1], matrix: vec![1.0, -1.0, -1.0, 1.0] };
        let constraints = Constraints::new(vec![None, None]);
        let mut solver = LinearSolver::new(std::iter::once(block.dofs.as_slice()), &constraints);
        let outcome = solver.factorize(std::slice::from_ref(&block)).and_then(|()| solver.solve(&[1.0, 0.0]));
        assert!(matches!(outcome, Err(LinearSolverError::Singular { .. })), "{outcome:?}");
        assert_eq!(
            solver.factorize(&[Block { matrix: vec![f64::NAN; 4], ..block }]),
            Err(LinearSolverError::NotFinite)
        );
    }
}
