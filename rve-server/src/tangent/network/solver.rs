//! Direct solution of the balance equations, with a check that the answer deserves trust.

use super::block_matrix::{BlockMatrix, Columns, largest};
use super::closeness::Closeness;
use super::elimination::Elimination;
use super::factors::Factors;
use super::orderings::Orderings;
use crate::simd::{Vectorised, dispatch};
use faer::Mat;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};

/// A network whose softest mode is this much softer than a contact counts as singular.
const SOFTEST_CREDIBLE_MODE: f64 = 1e-11;

/// Residual, over the force of a contact moved as far as the largest unknown, of an answer that shows a free mode: far below the mode's own
/// stiffness.
const RESIDUAL_OF_A_MODE: f64 = 1e-13;

/// Corrections that the factors of the symmetric part may need: prestress makes the matrix differ from it by its ratio to
/// the stiffness, and each correction gains as much.
const MOST_CORRECTIONS: u32 = 6;

/// Solves for the first `B` columns of `loads`. `None` if the matrix is singular to working accuracy; `typical` is the
/// stiffness of a contact, N/m. `is_symmetric` says that only prestress keeps the matrix from being symmetric.
///
/// The cheap factors without exchanges of rows come first; where they are not good enough, rows are pivoted. Where they solve the equations
/// and show a mode that is next to free, pivoting would show the same one.
pub(super) fn solve<const B: usize, const P: usize>(
    orderings: &mut Orderings,
    matrix: &BlockMatrix<B>,
    loads: &[Columns<B, P>],
    typical: f64,
    is_symmetric: bool,
    closeness: Closeness,
) -> Option<Vec<Columns<B, P>>> {
    let largest_residual = closeness.residual_of_factors;
    let columns = with_probe(loads, typical);
    let elimination = orderings.of(matrix.grains(), &matrix.pairs)?;
    let elimination = &elimination;
    let columns = &columns;
    let factorized =
        |symmetric| dispatch(Direct { matrix, elimination, columns, typical, symmetric, largest_residual });
    for symmetric in [true, false] {
        if symmetric && !is_symmetric {
            continue;
        }
        match factorized(symmetric) {
            Attempt::Solved(answers) => return Some(answers),
            Attempt::Singular => return None,
            Attempt::Poor => {}
        }
    }
    let answers = solve_with_pivoting(matrix, columns)?;
    let residual = matrix.residual(columns, &answers);
    let verdict = judged(&largest(columns), &answers, &residual, typical, largest_residual);
    (verdict == Verdict::Sound).then_some(answers)
}

/// How a factorization has ended.
enum Attempt<const B: usize, const P: usize> {
    Solved(Vec<Columns<B, P>>),
    /// The equations are solved, and a mode is next to free.
    Singular,
    /// The equations are not solved well enough.
    Poor,
}

/// What answers are worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Sound,
    Singular,
    Poor,
}

/// Factors without exchange of rows and iterative refinement.
struct Direct<'a, const B: usize, const P: usize> {
    matrix: &'a BlockMatrix<B>,
    elimination: &'a Elimination,
    columns: &'a [Columns<B, P>],
    typical: f64,
    symmetric: bool,
    largest_residual: f64,
}

impl<const B: usize, const P: usize> Vectorised for Direct<'_, B, P> {
    type Output = Attempt<B, P>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        if self.symmetric {
            let factors = Factors::<B, P, true>::of(self.matrix, self.elimination);
            self.refine(&factors, MOST_CORRECTIONS)
        } else {
            let factors = Factors::<B, P, false>::of(self.matrix, self.elimination);
            self.refine(&factors, 1)
        }
    }
}

impl<const B: usize, const P: usize> Direct<'_, B, P> {
    #[inline(always)]
    fn refine<const SYMMETRIC: bool>(
        &self,
        factors: &Factors<'_, B, P, SYMMETRIC>,
        corrections: u32,
    ) -> Attempt<B, P> {
        let load = largest(self.columns);
        let mut answers = factors.solve(self.columns);
        for correction in 0..=corrections {
            let residual = self.matrix.residual(self.columns, &answers);
            match judged(&load, &answers, &residual, self.typical, self.largest_residual) {
                Verdict::Sound => return Attempt::Solved(answers),
                Verdict::Singular => return Attempt::Singular,
                Verdict::Poor => {}
            }
            if correction < corrections {
                for (answer, change) in answers.iter_mut().flatten().zip(factors.solve(&residual).iter().flatten()) {
                    for lane in 0..P {
                        answer[lane] += change[lane];
                    }
                }
            }
        }
        Attempt::Poor
    }
}

/// Adds the probe of the softest mode to column `B`: a fixed load without regularity has a share of every mode.
/// (Multiples of an irrational number will not do: they are orthogonal to the alternating modes of lattices; their
/// squares are not.)
fn with_probe<const B: usize, const P: usize>(loads: &[Columns<B, P>], typical: f64) -> Vec<Columns<B, P>> {
    let mut columns = loads.to_vec();
    for (row, values) in columns.iter_mut().flatten().enumerate() {
        values[B] = (((row as f64).powi(2) * std::f64::consts::GOLDEN_RATIO).fract() - 0.5) * typical;
    }
    columns
}

/// Whether the answers solve the equations and no mode is next to free; `load` is the [`largest`] load of each column. Written so
/// that a NaN fails.
#[inline(always)]
fn judged<const B: usize, const P: usize>(
    load: &[f64; P],
    answers: &[Columns<B, P>],
    residual: &[Columns<B, P>],
    typical: f64,
    largest_residual: f64,
) -> Verdict {
    let softness = answers.iter().flatten().map(|row| row[B] * row[B]).sum::<f64>().sqrt();
    let (answer, residual) = (largest(answers), largest(residual));
    let is_solved =
        (0..=B).all(|column| residual[column] <= largest_residual * (load[column] + typical * answer[column]));
    let is_credible = softness * SOFTEST_CREDIBLE_MODE < 1.0;
    // An answer that solves all but the equations given proves that those are all but singular, whatever the factors are worth elsewhere.
    let shows_mode = softness.is_finite() && residual[B] <= RESIDUAL_OF_A_MODE * typical * answer[B];
    match (is_solved, is_credible) {
        (true, true) => Verdict::Sound,
        (_, false) if shows_mode => Verdict::Singular,
        _ => Verdict::Poor,
    }
}

fn solve_with_pivoting<const B: usize, const P: usize>(
    matrix: &BlockMatrix<B>,
    columns: &[Columns<B, P>],
) -> Option<Vec<Columns<B, P>>> {
    let sparse = to_scalar_columns(matrix);
    let symbolic = SymbolicLu::try_new(sparse.symbolic()).ok()?;
    let factors = Lu::try_new_with_symbolic(symbolic, sparse.as_ref()).ok()?;
    let mut answers = Mat::from_fn(B * columns.len(), B + 1, |row, column| columns[row / B][row % B][column]);
    factors.solve_in_place(&mut answers);
    let answer = |grain: usize| {
        std::array::from_fn(|unknown| {
            std::array::from_fn(|column| if column <= B { answers[(B * grain + unknown, column)] } else { 0.0 })
        })
    };
    Some((0..columns.len()).map(answer).collect())
}

fn to_scalar_columns<const B: usize>(matrix: &BlockMatrix<B>) -> SparseColMat<usize, f64> {
    let mut blocks: Vec<_> = matrix.diagonal.iter().enumerate().map(|(grain, block)| (grain, grain, block)).collect();
    for ((&[first, second], upper), lower) in matrix.pairs.iter().zip(&matrix.upper).zip(&matrix.lower) {
        blocks.push((second, first, upper));
        blocks.push((first, second, lower));
    }
    // By column, then by row.
    blocks.sort_unstable_by_key(|(column, row, _)| (*column, *row));
    let size = B * matrix.grains();
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for column_blocks in blocks.chunk_by(|a, b| a.0 == b.0) {
        for column in 0..B {
            for (_, row_grain, block) in column_blocks {
                for (row, block_row) in block.iter().enumerate() {
                    rows.push(B * row_grain + row);
                    values.push(block_row[column]);
                }
            }
            starts.push(rows.len());
        }
    }
    SparseColMat::new(SymbolicSparseColMat::new_checked(size, size, starts, None, rows), values)
}
