//! Sparse solution of the balance equations, with a check that the answer deserves trust.

use super::assembly::{DIRECTIONS, Quadruple};
use super::block_factors::BlockFactors;
use super::block_matrix::{BLOCK, BlockMatrix};
use faer::Mat;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};

/// A network whose softest mode is this much softer than a contact counts as singular.
const SOFTEST_CREDIBLE_MODE: f64 = 1e-11;

/// Largest residual force of a credible solution, relative to the load and to the force of a contact moved as far as
/// the largest unknown.
const LARGEST_RESIDUAL: f64 = 1e-10;

/// Right-hand sides: the four directions and a probe.
const COLUMNS: usize = DIRECTIONS + 1;

/// Solves for the four right-hand sides `loads` (one row per scalar unknown). `None` if the matrix is singular to
/// working accuracy; `typical` is the stiffness of a contact, N/m.
///
/// Prestress and sliding make the matrix nonsymmetric, hence LU. The cheap factors without exchanges between grains
/// come first; where they are not good enough, scalar rows are pivoted.
pub(super) fn solve(matrix: &BlockMatrix, loads: &[Quadruple], typical: f64) -> Option<Vec<Quadruple>> {
    let columns: Vec<[f64; COLUMNS]> = loads.iter().enumerate().map(with_probe(typical)).collect();
    let answers = BlockFactors::of(matrix)
        .map(|factors| factors.solve(&columns))
        .filter(|answers| is_trustworthy(matrix, &columns, answers, typical))
        .or_else(|| {
            solve_with_pivoting(matrix, &columns).filter(|answers| is_trustworthy(matrix, &columns, answers, typical))
        })?;
    Some(answers.iter().map(|row| std::array::from_fn(|direction| row[direction])).collect())
}

fn solve_with_pivoting(matrix: &BlockMatrix, columns: &[[f64; COLUMNS]]) -> Option<Vec<[f64; COLUMNS]>> {
    let sparse = to_scalar_columns(matrix);
    let symbolic = SymbolicLu::try_new(sparse.symbolic()).ok()?;
    let factors = Lu::try_new_with_symbolic(symbolic, sparse.as_ref()).ok()?;
    let mut answers = Mat::from_fn(columns.len(), COLUMNS, |row, column| columns[row][column]);
    factors.solve_in_place(&mut answers);
    Some((0..columns.len()).map(|row| std::array::from_fn(|column| answers[(row, column)])).collect())
}

/// Appends the probe of the softest mode: a fixed load without regularity has a share of every mode. (Multiples of an
/// irrational number will not do: they are orthogonal to the alternating modes of lattices; their squares are not.)
fn with_probe(typical: f64) -> impl Fn((usize, &Quadruple)) -> [f64; COLUMNS] {
    move |(row, load)| {
        let mut column = [(((row as f64).powi(2) * std::f64::consts::GOLDEN_RATIO).fract() - 0.5) * typical; COLUMNS];
        column[..DIRECTIONS].copy_from_slice(load);
        column
    }
}

/// Whether the answers solve the equations and no mode is next to free. Written so that a NaN fails.
fn is_trustworthy(matrix: &BlockMatrix, loads: &[[f64; COLUMNS]], answers: &[[f64; COLUMNS]], typical: f64) -> bool {
    let softness = answers.iter().map(|row| row[DIRECTIONS].powi(2)).sum::<f64>().sqrt();
    let residual = matrix.residual_norms(loads, answers);
    softness * SOFTEST_CREDIBLE_MODE < 1.0
        && (0..COLUMNS).all(|column| {
            let load = loads.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
            let answer = answers.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
            residual[column] <= LARGEST_RESIDUAL * (load + typical * answer)
        })
}

fn to_scalar_columns(matrix: &BlockMatrix) -> SparseColMat<usize, f64> {
    let size = BLOCK * matrix.grains();
    let mut starts = vec![0];
    let mut rows = Vec::with_capacity(BLOCK * BLOCK * matrix.blocks.len());
    let mut values = Vec::with_capacity(rows.capacity());
    for grain in 0..matrix.grains() {
        for column in 0..BLOCK {
            for place in matrix.columns[grain]..matrix.columns[grain + 1] {
                for (row, block_row) in matrix.blocks[place].iter().enumerate() {
                    rows.push(BLOCK * matrix.rows[place] + row);
                    values.push(block_row[column]);
                }
            }
            starts.push(rows.len());
        }
    }
    SparseColMat::new(SymbolicSparseColMat::new_checked(size, size, starts, None, rows), values)
}
