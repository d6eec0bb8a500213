//! Iterative solution by BiCGStab with an incomplete LU factorization (van der Vorst 1992; no fill, ILU(0)).
//!
//! For large spatial meshes, where the fill of a direct factorization grows with the 4/3 power of the unknowns. The
//! matrix is given by columns, as the direct solver keeps it. One thread and a fixed order: reproducible to the bit.

use crate::solve::vectors::{add, dot};

/// Columns of a square sparse matrix with a symmetric pattern and sorted rows.
#[derive(Clone, Copy)]
pub(in crate::solve) struct Columns<'a> {
    /// First entry of every column, and their number at the end.
    pub(in crate::solve) starts: &'a [usize],
    /// Row of every entry.
    pub(in crate::solve) rows: &'a [usize],
    /// Every entry.
    pub(in crate::solve) values: &'a [f64],
}

impl Columns<'_> {
    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// `K x`.
    fn times(&self, vector: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.count()];
        for (column, value) in vector.iter().enumerate() {
            for entry in self.starts[column]..self.starts[column + 1] {
                product[self.rows[entry]] += self.values[entry] * value;
            }
        }
        product
    }
}

/// Incomplete factors with the pattern of the matrix. The columns of `K` are the rows of its transpose, so the factors
/// are those of `K^T = L U` by rows, and `K = U^T L^T`.
#[derive(Clone, Debug)]
pub(in crate::solve) struct IncompleteFactors {
    starts: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    diagonal: Vec<usize>,
}

impl IncompleteFactors {
    /// Factorizes; `None` if a pivot vanishes or a diagonal entry is missing.
    pub(in crate::solve) fn new(matrix: Columns<'_>) -> Option<Self> {
        let count = matrix.count();
        let mut factors = Self {
            starts: matrix.starts.to_vec(),
            columns: matrix.rows.to_vec(),
            values: matrix.values.to_vec(),
            diagonal: Vec::with_capacity(count),
        };
        let mut place_in_row = vec![usize::MAX; count];
        for row in 0..count {
            let entries = factors.starts[row]..factors.starts[row + 1];
            entries.clone().for_each(|entry| place_in_row[factors.columns[entry]] = entry);
            factors.diagonal.push(entries.clone().find(|&entry| factors.columns[entry] == row)?);
            for entry in entries.clone().take_while(|&entry| factors.columns[entry] < row) {
                let pivot_row = factors.columns[entry];
                let factor = factors.values[entry] / factors.values[factors.diagonal[pivot_row]];
                factors.values[entry] = factor;
                for other in factors.diagonal[pivot_row] + 1..factors.starts[pivot_row + 1] {
                    let target = place_in_row[factors.columns[other]];
                    if target != usize::MAX {
                        factors.values[target] -= factor * factors.values[other];
                    }
                }
            }
            let pivot = factors.values[factors.diagonal[row]];
            if pivot == 0.0 || !pivot.is_finite() {
                return None;
            }
            factors.starts[row..row + 2].windows(2).for_each(|pair| {
                factors.columns[pair[0]..pair[1]].iter().for_each(|&column| place_in_row[column] = usize::MAX);
            });
        }
        Some(factors)
    }

    /// `(U^T L^T)^-1 b`.
    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut solution = right.to_vec();
        for row in 0..solution.len() {
            let value = solution[row] / self.values[self.diagonal[row]];
            solution[row] = value;
            for entry in self.diagonal[row] + 1..self.starts[row + 1] {
                solution[self.columns[entry]] -= self.values[entry] * value;
            }
        }
        for row in (0..solution.len()).rev() {
            let value = solution[row];
            for entry in self.starts[row]..self.diagonal[row] {
                solution[self.columns[entry]] -= self.values[entry] * value;
            }
        }
        solution
    }
}

/// A solution and what it took.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::solve) struct Solution {
    /// The solution.
    pub(in crate::solve) values: Vec<f64>,
    /// Iterations.
    pub(in crate::solve) iterations: u64,
}

/// Solves `K x = b` until `|b - K x| <= tolerance |b|`; `None` if that takes more than `most` iterations or breaks down.
pub(in crate::solve) fn solve(
    matrix: Columns<'_>,
    factors: &IncompleteFactors,
    right: &[f64],
    tolerance: f64,
    most: u64,
) -> Option<Solution> {
    let goal = tolerance * dot(right, right).sqrt();
    let mut solution = vec![0.0; right.len()];
    let mut residual = right.to_vec();
    let shadow = right.to_vec();
    let (mut direction, mut image) = (vec![0.0; right.len()], vec![0.0; right.len()]);
    let (mut rho, mut alpha, mut omega) = (1.0, 1.0, 1.0);
    for iterations in 1..=most {
        let next = dot(&shadow, &residual);
        let beta = next / rho * (alpha / omega);
        rho = next;
        for ((p, r), v) in direction.iter_mut().zip(&residual).zip(&image) {
            *p = r + beta * (*p - omega * v);
        }
        let smooth = factors.solve(&direction);
        image = matrix.times(&smooth);
        alpha = rho / dot(&shadow, &image);
        add(&mut residual, -alpha, &image);
        add(&mut solution, alpha, &smooth);
        if dot(&residual, &residual).sqrt() <= goal {
            return Some(Solution { values: solution, iterations });
        }
        let smooth = factors.solve(&residual);
        let turned = matrix.times(&smooth);
        omega = dot(&turned, &residual) / dot(&turned, &turned);
        add(&mut solution, omega, &smooth);
        add(&mut residual, -omega, &turned);
        let length = dot(&residual, &residual).sqrt();
        if length <= goal {
            return Some(Solution { values: solution, iterations });
        }
        if !length.is_finite() || rho == 0.0 || omega == 0.0 {
            return None;
        }
    }
    None
}
