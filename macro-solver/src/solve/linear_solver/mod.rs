//! Sparse solution of the global equations, direct or iterative.
//!
//! The direct way is LU with partial pivoting: the matrix is not symmetric (slip tangents, follower pressure, averages over
//! neighbours) and past the peak not definite. The pattern and its symbolic factor are computed once per stage. One thread and a fixed order of additions
//! make the result reproducible to the bit.

mod krylov;

use crate::model::assembly::block::{Block, BlockDofs};
use crate::model::constraints::Constraints;
use crate::problem::EquationSolver;
use crate::solve::linear_solver::krylov::{Columns, IncompleteFactors};
use crate::solve::vectors::norm;
use faer::prelude::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use std::num::NonZeroUsize;
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

/// Tolerance and cap of the iterative way; what does not converge is solved directly.
const ITERATIVE_TOLERANCE: f64 = 1e-9;
const MOST_ITERATIONS: u64 = 1000;

/// Rows of one column while the pattern is collected.
#[derive(Clone, Debug, Default)]
struct Column {
    rows: Vec<usize>,
    /// Number of rows when they were last sorted.
    sorted: usize,
}

impl Column {
    /// Adds rows, known or not. Blocks name most rows many times, so they are sorted whenever they have doubled.
    fn add(&mut self, rows: &[usize]) {
        self.rows.extend_from_slice(rows);
        if self.rows.len() > 2 * self.sorted.max(64) {
            self.sort();
        }
    }

    /// All rows, ascending.
    fn into_rows(mut self) -> Vec<usize> {
        self.sort();
        self.rows
    }

    fn sort(&mut self) {
        self.rows.sort_unstable();
        self.rows.dedup();
        self.sorted = self.rows.len();
    }
}

/// The global matrix over the unknowns and its factors.
pub(super) struct LinearSolver {
    pattern: SymbolicSparseColMat<usize>,
    values: Vec<f64>,
    /// For every entry of every block, in order: its place in `values`, from 1; `None` in prescribed rows or columns.
    places: Vec<Option<NonZeroUsize>>,
    symbolic: Option<SymbolicLu<usize>>,
    factors: Option<Lu<usize, f64>>,
    method: EquationSolver,
    incomplete: Option<IncompleteFactors>,
    iteration_count: u64,
    fallback_count: u64,
    symbolic_count: u64,
    numeric_count: u64,
    /// Whether the analysis of this pattern is in the count.
    analysed: bool,
}

impl LinearSolver {
    /// Prepares the pattern for blocks over these degrees of freedom; later blocks must keep this order.
    pub(super) fn new<'a>(
        blocks: impl Iterator<Item = &'a BlockDofs> + Clone,
        constraints: &Constraints,
        method: EquationSolver,
    ) -> Self {
        let size = constraints.free().len();
        let mut columns = vec![Column::default(); size];
        let unknowns = |dofs: &[usize]| dofs.iter().filter_map(|&dof| constraints.unknown(dof)).collect::<Vec<_>>();
        for dofs in blocks.clone() {
            let (rows, others) = (unknowns(&dofs.rows), unknowns(dofs.columns()));
            for &column in &others {
                columns[column].add(&rows);
            }
            if rows != others {
                // The incomplete factors rely on a symmetric pattern, also where distances differ by rounding.
                rows.iter().for_each(|&row| columns[row].add(&others));
            }
        }
        let mut starts = vec![0];
        let mut rows = Vec::new();
        for column in columns {
            rows.extend(column.into_rows());
            starts.push(rows.len());
        }
        let mut places = Vec::new();
        for dofs in blocks {
            for &row in &dofs.rows {
                for &column in dofs.columns() {
                    let unknowns = constraints.unknown(row).zip(constraints.unknown(column));
                    places.push(unknowns.and_then(|(row, column)| {
                        let known = &rows[starts[column]..starts[column + 1]];
                        let within = known.binary_search(&row).expect("the pattern holds every block entry");
                        NonZeroUsize::new(starts[column] + within + 1)
                    }));
                }
            }
        }
        let values = vec![0.0; rows.len()];
        let pattern = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        Self {
            pattern,
            values,
            places,
            symbolic: None,
            factors: None,
            method,
            incomplete: None,
            iteration_count: 0,
            fallback_count: 0,
            symbolic_count: 0,
            numeric_count: 0,
            analysed: false,
        }
    }

    /// Iterations of the iterative way so far.
    pub(super) fn iteration_count(&self) -> u64 {
        self.iteration_count
    }

    /// Times that the iterative way failed and the direct one was taken.
    pub(super) fn fallback_count(&self) -> u64 {
        self.fallback_count
    }

    /// Symbolic factorizations so far: one for each stage that solved anything.
    pub(super) fn symbolic_count(&self) -> u64 {
        self.symbolic_count
    }

    /// Numeric factorizations so far.
    pub(super) fn numeric_count(&self) -> u64 {
        self.numeric_count
    }

    /// Whether the analysis of this pattern has been counted.
    pub(super) fn is_analysed(&self) -> bool {
        self.analysed
    }

    /// Counts on from an earlier process, as [`Self::go_on_counting`]; a pattern that was analysed there is analysed again, which
    /// changes no bit and is not counted.
    pub(super) fn count_from(&mut self, counts: [u64; 4], analysed: bool) {
        self.go_on_counting(counts);
        self.analysed = analysed;
    }

    /// All counts so far: symbolic and numeric factorizations, iterations, direct fallbacks.
    pub(super) fn counts(&self) -> [u64; 4] {
        [self.symbolic_count, self.numeric_count, self.iteration_count, self.fallback_count]
    }

    /// Counts on from the equations of an earlier stage.
    pub(super) fn go_on_counting(&mut self, counts: [u64; 4]) {
        [self.symbolic_count, self.numeric_count, self.iteration_count, self.fallback_count] = counts;
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
                self.values[place.get() - 1] += entry;
            }
        }
        self.factorize_values()
    }

    /// Entries of the matrix that was factorized last, in the order of its pattern, N/m.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Whether the equations of the matrix that was factorized last are solved directly, by choice or because iterations have failed.
    pub(super) fn solves_directly(&self) -> bool {
        self.incomplete.is_none()
    }

    /// Factorizes a matrix that an earlier process had factorized, for direct solutions if that process had come to them; `false` if it is
    /// that of another pattern.
    ///
    /// # Errors
    /// See [`LinearSolverError`].
    pub(super) fn factorize_again(&mut self, values: &[f64], directly: bool) -> Result<bool, LinearSolverError> {
        if values.len() != self.values.len() {
            return Ok(false);
        }
        self.values.copy_from_slice(values);
        if directly && !values.is_empty() {
            self.incomplete = None;
            self.factorize_directly()?;
        } else {
            self.factorize_values()?;
        }
        Ok(true)
    }

    fn factorize_values(&mut self) -> Result<(), LinearSolverError> {
        self.factors = None;
        if self.values.is_empty() {
            return Ok(());
        }
        if !self.values.iter().all(|value| value.is_finite()) {
            return Err(LinearSolverError::NotFinite);
        }
        self.incomplete = None;
        if self.method == EquationSolver::Iterative {
            self.incomplete = IncompleteFactors::new(self.columns());
            if self.incomplete.is_some() {
                return Ok(());
            }
            self.fallback_count += 1;
        }
        self.factorize_directly()
    }

    fn columns(&self) -> Columns<'_> {
        let (starts, rows) = (self.pattern.col_ptr(), self.pattern.row_idx());
        Columns { starts, rows, values: &self.values }
    }

    fn factorize_directly(&mut self) -> Result<(), LinearSolverError> {
        if self.symbolic.is_none() {
            let symbolic = SymbolicLu::try_new(self.pattern.as_ref())
                .map_err(|error| LinearSolverError::Resources(format!("{error:?}")))?;
            self.symbolic = Some(symbolic);
            self.symbolic_count += u64::from(!self.analysed);
            self.analysed = true;
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
    pub(super) fn solve(&mut self, right: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let length = norm(right);
        if right.is_empty() || length == 0.0 {
            return Ok(vec![0.0; right.len()]);
        }
        if let Some(incomplete) = &self.incomplete {
            match krylov::solve(self.columns(), incomplete, right, ITERATIVE_TOLERANCE, MOST_ITERATIONS) {
                Some(solution) => {
                    self.iteration_count += solution.iterations;
                    return Ok(solution.values);
                }
                None => {
                    self.fallback_count += 1;
                    self.incomplete = None;
                    self.factorize_directly()?;
                }
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Amplitude, Origin, Prescribed};

    /// So many degrees of freedom, the first of them held or not.
    fn split(count: usize, first_is_held: bool) -> Constraints {
        let hold = Prescribed { value: 0.0, origin: Origin::Stage, history: &Amplitude::Constant };
        let prescribed: Vec<_> = (0..count).map(|dof| (first_is_held && dof == 0).then_some(hold)).collect();
        Constraints::new(&prescribed, &[], &vec![0.0; count])
    }

    fn chain(length: usize) -> (Vec<Block>, Constraints) {
        let blocks = (0..length).map(|first| Block {
            dofs: BlockDofs::square(vec![first, first + 1]),
            matrix: vec![1.5 - (first % 3) as f64, -1.2, -0.8, 0.25 * (first % 2) as f64],
        });
        (blocks.collect(), split(length + 1, true))
    }

    #[test]
    fn indefinite_nonsymmetric_systems_are_solved_and_the_symbolic_factor_is_kept() {
        let (blocks, constraints) = chain(60);
        let mut solver =
            LinearSolver::new(blocks.iter().map(|block| &block.dofs), &constraints, EquationSolver::Direct);
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
        let block = Block { dofs: BlockDofs::square(vec![0, 1]), matrix: vec![1.0, -1.0, -1.0, 1.0] };
        let constraints = split(2, false);
        let mut solver = LinearSolver::new(std::iter::once(&block.dofs), &constraints, EquationSolver::Direct);
        let outcome = solver.factorize(std::slice::from_ref(&block)).and_then(|()| solver.solve(&[1.0, 0.0]));
        assert!(matches!(outcome, Err(LinearSolverError::Singular { .. })), "{outcome:?}");
        assert_eq!(
            solver.factorize(&[Block { matrix: vec![f64::NAN; 4], ..block }]),
            Err(LinearSolverError::NotFinite)
        );
    }

    /// A grid of springs, nonsymmetric by a drift: both ways find the same solution; a singular matrix falls back to the
    /// direct way, which refuses it.
    #[test]
    fn the_iterative_way_agrees_with_the_direct_one_and_falls_back_where_it_fails() {
        let side = 12;
        let node = |x: usize, y: usize| side * y + x;
        let pairs = (0..side).flat_map(|x| (0..side).map(move |y| (x, y))).flat_map(|(x, y)| {
            let right = (x + 1 < side).then(|| [node(x, y), node(x + 1, y)]);
            let up = (y + 1 < side).then(|| [node(x, y), node(x, y + 1)]);
            right.into_iter().chain(up)
        });
        let blocks: Vec<Block> = pairs
            .map(|dofs| Block { dofs: BlockDofs::square(dofs.to_vec()), matrix: vec![1.0, -0.9, -1.1, 1.0] })
            .collect();
        let constraints = split(side * side, true);
        let solver = |method| LinearSolver::new(blocks.iter().map(|block| &block.dofs), &constraints, method);
        let (mut direct, mut iterative) = (solver(EquationSolver::Direct), solver(EquationSolver::Iterative));
        let right: Vec<f64> = (0..side * side - 1).map(|row| (row as f64).cos()).collect();
        direct.factorize(&blocks).unwrap();
        iterative.factorize(&blocks).unwrap();
        let (one, other) = (direct.solve(&right).unwrap(), iterative.solve(&right).unwrap());
        let error: Vec<f64> = one.iter().zip(&other).map(|(one, other)| one - other).collect();
        assert!(norm(&error) < 1e-7 * norm(&one), "{:e}", norm(&error) / norm(&one));
        assert!(iterative.iteration_count() > 3 && iterative.fallback_count() == 0);
        assert_eq!((iterative.symbolic_count(), direct.symbolic_count()), (0, 1));
        let block = Block { dofs: BlockDofs::square(vec![0, 1]), matrix: vec![1.0, -1.0, -1.0, 1.0] };
        let free = split(2, false);
        let mut singular = LinearSolver::new(std::iter::once(&block.dofs), &free, EquationSolver::Iterative);
        let outcome = singular.factorize(std::slice::from_ref(&block));
        assert!(matches!(outcome, Err(LinearSolverError::Singular { .. })), "{outcome:?}");
        assert_eq!(singular.fallback_count(), 1);
    }
}
