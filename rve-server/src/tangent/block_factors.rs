//! LU factors of a block matrix with symmetric pattern, rows exchanged only inside the 3x3 diagonal blocks.
//!
//! A network at rest is close to symmetric and positive definite, so that no exchange between grains is needed and the
//! fill-reducing order of the grains can be kept; this is an order of magnitude cheaper than pivoting scalar rows.
//! Sliding can spoil it: the caller must check the answer against the matrix and pivot if it is poor.

use super::block_matrix::{BLOCK, Block, BlockMatrix};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// Factors `P A P^T = L U`, `L` with unit diagonal blocks.
pub(super) struct BlockFactors {
    /// Grain that is eliminated at each place.
    grain_at: Vec<usize>,
    /// Where each pivot begins in `rows`, `lower` and `upper`; one more entry than there are grains.
    starts: Vec<usize>,
    /// Places after the pivot that are linked to it, ascending.
    rows: Vec<usize>,
    /// `L` below the pivot, block by block as in `rows`.
    lower: Vec<Block>,
    /// `U` right of the pivot, block by block as in `rows`.
    upper: Vec<Block>,
    /// Inverses of the diagonal blocks of `U`.
    inverse: Vec<Block>,
}

impl BlockFactors {
    /// Orders, analyses and factorizes `matrix`. `None` if the ordering fails; a singular block shows as values that are
    /// not finite.
    pub(super) fn of(matrix: &BlockMatrix) -> Option<Self> {
        let grains = matrix.grains();
        let (grain_at, place_of) = order(matrix)?;
        let (starts, rows) = fill_pattern(matrix, &grain_at, &place_of);
        let zero = [[0.0; BLOCK]; BLOCK];
        let mut factors = Self {
            lower: vec![zero; rows.len()],
            upper: vec![zero; rows.len()],
            inverse: vec![zero; grains],
            grain_at,
            starts,
            rows,
        };
        factors.load(matrix, &place_of);
        for pivot in 0..grains {
            factors.eliminate(pivot);
        }
        Some(factors)
    }

    fn load(&mut self, matrix: &BlockMatrix, place_of: &[usize]) {
        for grain in 0..matrix.grains() {
            for entry in matrix.columns[grain]..matrix.columns[grain + 1] {
                let (row, column) = (place_of[matrix.rows[entry]], place_of[grain]);
                let block = matrix.blocks[entry];
                if row == column {
                    self.inverse[row] = block;
                } else if row > column {
                    let slot = self.slot(column, row);
                    self.lower[slot] = block;
                } else {
                    let slot = self.slot(row, column);
                    self.upper[slot] = block;
                }
            }
        }
    }

    fn slot(&self, pivot: usize, row: usize) -> usize {
        let range = self.starts[pivot]..self.starts[pivot + 1];
        range.start + self.rows[range].binary_search(&row).expect("the fill contains the matrix")
    }

    fn eliminate(&mut self, pivot: usize) {
        let inverse = inverted(&self.inverse[pivot]);
        self.inverse[pivot] = inverse;
        let range = self.starts[pivot]..self.starts[pivot + 1];
        for slot in range.clone() {
            self.lower[slot] = product(&self.lower[slot], &inverse);
        }
        for left in range.clone() {
            let column = self.rows[left];
            let (lower_left, upper_left) = (self.lower[left], self.upper[left]);
            subtract_product(&mut self.inverse[column], &lower_left, &upper_left);
            let mut target = self.starts[column];
            for right in left + 1..range.end {
                // The fill of a pivot is contained in that of its neighbours, so the walk always finds the row.
                while self.rows[target] < self.rows[right] {
                    target += 1;
                }
                let (lower_right, upper_right) = (self.lower[right], self.upper[right]);
                subtract_product(&mut self.lower[target], &lower_right, &upper_left);
                subtract_product(&mut self.upper[target], &lower_left, &upper_right);
            }
        }
    }

    /// Solves for several right-hand sides at once, one row per scalar unknown.
    pub(super) fn solve<const COLUMNS: usize>(&self, loads: &[[f64; COLUMNS]]) -> Vec<[f64; COLUMNS]> {
        let grains = self.grain_at.len();
        let mut work: Vec<[[f64; COLUMNS]; BLOCK]> =
            self.grain_at.iter().map(|&grain| std::array::from_fn(|row| loads[BLOCK * grain + row])).collect();
        for pivot in 0..grains {
            let known = work[pivot];
            for slot in self.starts[pivot]..self.starts[pivot + 1] {
                subtract_applied(&mut work[self.rows[slot]], &self.lower[slot], &known);
            }
        }
        let mut answers = vec![[0.0; COLUMNS]; loads.len()];
        for pivot in (0..grains).rev() {
            let mut rest = work[pivot];
            for slot in self.starts[pivot]..self.starts[pivot + 1] {
                subtract_applied(&mut rest, &self.upper[slot], &work[self.rows[slot]]);
            }
            let mut negative = [[0.0; COLUMNS]; BLOCK];
            subtract_applied(&mut negative, &self.inverse[pivot], &rest);
            work[pivot] = negative.map(|row| row.map(|value| -value));
            let first = BLOCK * self.grain_at[pivot];
            answers[first..first + BLOCK].copy_from_slice(&work[pivot]);
        }
        answers
    }
}

/// A fill-reducing order: the grain at each place, and the place of each grain.
fn order(matrix: &BlockMatrix) -> Option<(Vec<usize>, Vec<usize>)> {
    let grains = matrix.grains();
    let pattern = SymbolicSparseColMatRef::new_checked(grains, grains, &matrix.columns, None, &matrix.rows);
    let (mut grain_at, mut place_of) = (vec![0; grains], vec![0; grains]);
    let mut memory = MemBuffer::new(amd::order_scratch::<usize>(grains, matrix.rows.len()));
    let stack = MemStack::new(&mut memory);
    amd::order(&mut grain_at, &mut place_of, pattern, amd::Control::default(), stack).ok()?;
    Some((grain_at, place_of))
}

/// The pattern of `L`: a pivot's fill is its own links and the fill of every earlier pivot whose first link it is.
fn fill_pattern(matrix: &BlockMatrix, grain_at: &[usize], place_of: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let grains = matrix.grains();
    let mut starts = vec![0];
    let mut rows: Vec<usize> = Vec::new();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); grains];
    let mut seen_by = vec![usize::MAX; grains];
    for pivot in 0..grains {
        let first = rows.len();
        seen_by[pivot] = pivot;
        let grain = grain_at[pivot];
        for entry in matrix.columns[grain]..matrix.columns[grain + 1] {
            let row = place_of[matrix.rows[entry]];
            if row > pivot && seen_by[row] != pivot {
                seen_by[row] = pivot;
                rows.push(row);
            }
        }
        for &child in &children[pivot] {
            for slot in starts[child]..starts[child + 1] {
                let row = rows[slot];
                if row > pivot && seen_by[row] != pivot {
                    seen_by[row] = pivot;
                    rows.push(row);
                }
            }
        }
        rows[first..].sort_unstable();
        if let Some(&parent) = rows.get(first) {
            children[parent].push(pivot);
        }
        starts.push(rows.len());
    }
    (starts, rows)
}

fn product(left: &Block, right: &Block) -> Block {
    let mut negative = [[0.0; BLOCK]; BLOCK];
    subtract_product(&mut negative, left, right);
    negative.map(|row| row.map(|value| -value))
}

#[inline]
fn subtract_product(target: &mut Block, left: &Block, right: &Block) {
    subtract_applied(target, left, right);
}

/// `target -= left * right`, written so that a row of `target` is one vector.
#[inline]
fn subtract_applied<const COLUMNS: usize>(
    target: &mut [[f64; COLUMNS]; BLOCK],
    left: &Block,
    right: &[[f64; COLUMNS]; BLOCK],
) {
    for (target_row, left_row) in target.iter_mut().zip(left) {
        for column in 0..COLUMNS {
            target_row[column] -=
                left_row[0] * right[0][column] + left_row[1] * right[1][column] + left_row[2] * right[2][column];
        }
    }
}

/// Gauss-Jordan with row exchanges; a singular block gives values that are not finite.
fn inverted(block: &Block) -> Block {
    let mut rest = *block;
    let mut inverse = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for column in 0..BLOCK {
        let mut best = column;
        for row in column + 1..BLOCK {
            if rest[row][column].abs() > rest[best][column].abs() {
                best = row;
            }
        }
        rest.swap(column, best);
        inverse.swap(column, best);
        let scale = 1.0 / rest[column][column];
        rest[column] = rest[column].map(|value| value * scale);
        inverse[column] = inverse[column].map(|value| value * scale);
        for row in (0..BLOCK).filter(|row| *row != column) {
            let factor = rest[row][column];
            for other in 0..BLOCK {
                rest[row][other] -= factor * rest[column][other];
                inverse[row][other] -= factor * inverse[column][other];
            }
        }
    }
    inverse
}
