//! Supernodal factors of a block matrix, without exchanges of rows.
//!
//! A network at rest is close to symmetric and positive definite, so that the fill-reducing order of the grains can be
//! kept. Sliding can spoil it: the caller must check the answer against the matrix and pivot if it is poor. With
//! `SYMMETRIC` the factors are those of the symmetric part at half the cost.
//!
//! `P` is the number of unknowns of a grain rounded up to whole vectors; the rows of a block are the lanes of a vector.

use super::block_matrix::{BlockMatrix, Columns};
use super::elimination::{Elimination, Supernode};
use crate::simd::{Vectorised, dispatch};
use std::ops::Range;

/// Blocks of discs that are updated at a time.
const AT_ONCE: usize = 3;

/// `A = L U` in the order of an [`Elimination`], `L` with unit diagonal.
pub(super) struct Factors<'a, const B: usize, const P: usize, const SYMMETRIC: bool> {
    elimination: &'a Elimination,
    /// Where each supernode begins in `lower` and `upper`; one more entry than there are supernodes.
    starts: Vec<usize>,
    /// `L`: per supernode, per row grain (own ones first), per scalar column the values of the grain's rows.
    lower: Vec<[f64; P]>,
    /// The transpose of `U` in the same layout. With `SYMMETRIC` only work space of the supernode at hand.
    upper: Vec<[f64; P]>,
    /// Dense factors of the diagonal blocks, row-major, `L` below and `U` on and above the diagonal.
    dense: Vec<f64>,
    /// Where each of them begins.
    dense_starts: Vec<usize>,
}

impl<'a, const B: usize, const P: usize, const SYMMETRIC: bool> Factors<'a, B, P, SYMMETRIC> {
    /// Factorizes `matrix`. A zero pivot shows as values that are not finite.
    pub(super) fn of(matrix: &BlockMatrix<B>, elimination: &'a Elimination) -> Self {
        dispatch(Factorization::<B, P, SYMMETRIC> { matrix, elimination })
    }

    /// Solves for several right-hand sides at once.
    pub(super) fn solve<const R: usize>(&self, loads: &[Columns<B, R>]) -> Vec<Columns<B, R>> {
        dispatch(Substitution { factors: self, loads })
    }

    #[inline(always)]
    fn factorized(matrix: &BlockMatrix<B>, elimination: &'a Elimination) -> Self {
        let (mut starts, mut dense_starts) = (vec![0], vec![0]);
        for (index, supernode) in elimination.supernodes.iter().enumerate() {
            let size = B * supernode.width;
            starts.push(starts[index] + size * (supernode.width + supernode.rows.len()));
            dense_starts.push(dense_starts[index] + size * size);
        }
        let total = starts.last().copied().unwrap_or(0);
        let mut factors = Self {
            elimination,
            lower: vec![[0.0; P]; total],
            upper: vec![[0.0; P]; if SYMMETRIC { 0 } else { total }],
            dense: vec![0.0; dense_starts.last().copied().unwrap_or(0)],
            starts,
            dense_starts,
        };
        factors.load(matrix);
        let mut work = Work { scaled: Vec::new(), positions: vec![0; elimination.grains()] };
        for supernode in 0..elimination.supernodes.len() {
            factors.eliminate(supernode, &mut work);
        }
        factors
    }

    #[inline(always)]
    fn load(&mut self, matrix: &BlockMatrix<B>) {
        for (grain, block) in matrix.diagonal.iter().enumerate() {
            let place = self.elimination.place_of[grain];
            let target = self.slot(place, place);
            for (column, values) in self.lower[target..target + B].iter_mut().enumerate() {
                for row in 0..B {
                    values[row] =
                        if SYMMETRIC { 0.5 * (block[row][column] + block[column][row]) } else { block[row][column] };
                }
            }
        }
        for ((&[first, second], upper), lower) in matrix.pairs.iter().zip(&matrix.upper).zip(&matrix.lower) {
            let places = [self.elimination.place_of[first], self.elimination.place_of[second]];
            // `down` is the block below the diagonal, `across` its mirror image.
            let (column_place, row_place, down, across) = if places[0] < places[1] {
                (places[0], places[1], lower, upper)
            } else {
                (places[1], places[0], upper, lower)
            };
            let target = self.slot(column_place, row_place);
            for column in 0..B {
                for row in 0..B {
                    if SYMMETRIC {
                        self.lower[target + column][row] = 0.5 * (down[row][column] + across[column][row]);
                    } else {
                        self.lower[target + column][row] = down[row][column];
                        self.upper[target + column][row] = across[column][row];
                    }
                }
            }
        }
    }

    /// Where the block of a row place in the column of a place begins.
    #[inline(always)]
    fn slot(&self, column_place: usize, row_place: usize) -> usize {
        let index = self.elimination.supernode_of[column_place];
        let supernode = &self.elimination.supernodes[index];
        let row = if row_place < supernode.first + supernode.width {
            row_place - supernode.first
        } else {
            let rows = &self.elimination.rows[supernode.rows.clone()];
            supernode.width + rows.binary_search(&row_place).expect("the fill contains the matrix")
        };
        self.starts[index] + B * (row * supernode.width + column_place - supernode.first)
    }

    #[inline(always)]
    fn eliminate(&mut self, index: usize, work: &mut Work<P>) {
        let supernode = &self.elimination.supernodes[index];
        let size = B * supernode.width;
        self.factorize_diagonal(index, supernode);
        let dense = &self.dense[self.dense_starts[index]..self.dense_starts[index + 1]];
        let below = self.starts[index] + size * supernode.width;
        let end = self.starts[index + 1];
        for row in self.lower[below..end].chunks_exact_mut(size) {
            solve_lower_row(row, dense, size);
        }
        if SYMMETRIC {
            work.scaled.clear();
            for row in self.lower[below..end].chunks_exact(size) {
                work.scaled.extend(row.iter().enumerate().map(|(column, values)| {
                    let pivot = dense[column * size + column];
                    values.map(|value| value * pivot)
                }));
            }
        } else {
            for row in self.upper[below..end].chunks_exact_mut(size) {
                solve_upper_row(row, dense, size);
            }
        }
        self.update(supernode, size, below, end, work);
    }

    /// Gathers the diagonal block and factorizes it.
    #[inline(always)]
    fn factorize_diagonal(&mut self, index: usize, supernode: &Supernode) {
        let size = B * supernode.width;
        let dense = &mut self.dense[self.dense_starts[index]..self.dense_starts[index + 1]];
        for row_grain in 0..supernode.width {
            for column in 0..B * (row_grain + 1) {
                let place = self.starts[index] + row_grain * size + column;
                for lane in 0..B {
                    let row = B * row_grain + lane;
                    dense[row * size + column] = self.lower[place][lane];
                    if column < B * row_grain {
                        let mirror = if SYMMETRIC { self.lower[place][lane] } else { self.upper[place][lane] };
                        dense[column * size + row] = mirror;
                    }
                }
            }
        }
        for pivot in 0..size {
            let (above, rest) = dense.split_at_mut((pivot + 1) * size);
            let pivot_row = &above[pivot * size..];
            let reciprocal = 1.0 / pivot_row[pivot];
            for row in rest.chunks_exact_mut(size) {
                let factor = row[pivot] * reciprocal;
                row[pivot] = factor;
                for column in pivot + 1..size {
                    row[column] = (-factor).mul_add(pivot_row[column], row[column]);
                }
            }
        }
    }

    /// Subtracts the products of the rows below from the supernodes they belong to.
    #[inline(always)]
    fn update(&mut self, supernode: &Supernode, size: usize, below: usize, end: usize, work: &mut Work<P>) {
        let elimination = self.elimination;
        let rows = &elimination.rows[supernode.rows.clone()];
        let (lower_done, lower_rest) = self.lower.split_at_mut(end);
        let lower_panel = &lower_done[below..];
        let (upper_panel, upper_rest): (&[[f64; P]], &mut [[f64; P]]) = if SYMMETRIC {
            (&work.scaled, &mut [])
        } else {
            let (done, rest) = self.upper.split_at_mut(end);
            (&done[below..], rest)
        };
        let mut group = 0;
        while group < rows.len() {
            let target = elimination.supernode_of[rows[group]];
            let target_node = &elimination.supernodes[target];
            let target_size = B * target_node.width;
            let group_end = group + rows[group..].partition_point(|&row| row < target_node.first + target_node.width);
            locate(&rows[group..], target_node, &elimination.rows, &mut work.positions[group..rows.len()]);
            let target_start = self.starts[target] - end;
            for left in group..group_end {
                let weights_lower = &upper_panel[left * size..(left + 1) * size];
                let weights_upper = &lower_panel[left * size..(left + 1) * size];
                let column = target_start + B * (rows[left] - target_node.first);
                let place = |right: usize| column + work.positions[right] * target_size;
                subtract_products::<B, P>(lower_rest, place, left..rows.len(), lower_panel, weights_lower);
                if !SYMMETRIC {
                    subtract_products::<B, P>(upper_rest, place, left + 1..rows.len(), upper_panel, weights_upper);
                }
            }
            group = group_end;
        }
    }

    #[inline(always)]
    fn solved<const R: usize>(&self, loads: &[Columns<B, R>]) -> Vec<Columns<B, R>> {
        let elimination = self.elimination;
        let mut work: Vec<[f64; R]> = elimination.grain_at.iter().flat_map(|&grain| loads[grain]).collect();
        for (index, supernode) in elimination.supernodes.iter().enumerate() {
            let size = B * supernode.width;
            let dense = &self.dense[self.dense_starts[index]..self.dense_starts[index + 1]];
            let (known, rest) = work[B * supernode.first..].split_at_mut(size);
            for row in 1..size {
                let (done, open) = known.split_at_mut(row);
                for (factor, values) in dense[row * size..].iter().zip(done.iter()) {
                    subtract(&mut open[0], *factor, values);
                }
            }
            let offset = supernode.first + supernode.width;
            let panel = &self.lower[self.starts[index] + size * supernode.width..self.starts[index + 1]];
            for (row, values) in elimination.rows[supernode.rows.clone()].iter().zip(panel.chunks_exact(size)) {
                let target = &mut rest[B * (row - offset)..B * (row - offset + 1)];
                let mut sum: [[f64; R]; B] = std::array::from_fn(|lane| target[lane]);
                for (factors, value) in values.iter().zip(known.iter()) {
                    for lane in 0..B {
                        subtract(&mut sum[lane], factors[lane], value);
                    }
                }
                target.copy_from_slice(&sum);
            }
        }
        for (index, supernode) in elimination.supernodes.iter().enumerate().rev() {
            let size = B * supernode.width;
            let dense = &self.dense[self.dense_starts[index]..self.dense_starts[index + 1]];
            let (open, known) = work[B * supernode.first..].split_at_mut(size);
            if SYMMETRIC {
                for (row, values) in open.iter_mut().enumerate() {
                    let reciprocal = 1.0 / dense[row * size + row];
                    *values = values.map(|value| value * reciprocal);
                }
            }
            let offset = supernode.first + supernode.width;
            let panel = if SYMMETRIC { &self.lower } else { &self.upper };
            let panel = &panel[self.starts[index] + size * supernode.width..self.starts[index + 1]];
            for (row, values) in elimination.rows[supernode.rows.clone()].iter().zip(panel.chunks_exact(size)) {
                let source: [[f64; R]; B] = std::array::from_fn(|lane| known[B * (row - offset) + lane]);
                for (factors, target) in values.iter().zip(open.iter_mut()) {
                    for lane in 0..B {
                        subtract(target, factors[lane], &source[lane]);
                    }
                }
            }
            for row in (0..size).rev() {
                let (before, after) = open.split_at_mut(row + 1);
                for (column, values) in after.iter().enumerate() {
                    let column = row + 1 + column;
                    let factor = if SYMMETRIC { dense[column * size + row] } else { dense[row * size + column] };
                    subtract(&mut before[row], factor, values);
                }
                if !SYMMETRIC {
                    let reciprocal = 1.0 / dense[row * size + row];
                    before[row] = before[row].map(|value| value * reciprocal);
                }
            }
        }
        let mut answers = vec![[[0.0; R]; B]; loads.len()];
        for (&grain, values) in elimination.grain_at.iter().zip(work.chunks_exact(B)) {
            answers[grain] = std::array::from_fn(|lane| values[lane]);
        }
        answers
    }
}

/// The factorization as work that is dispatched.
struct Factorization<'m, 'a, const B: usize, const P: usize, const SYMMETRIC: bool> {
    matrix: &'m BlockMatrix<B>,
    elimination: &'a Elimination,
}

impl<'a, const B: usize, const P: usize, const SYMMETRIC: bool> Vectorised
    for Factorization<'_, 'a, B, P, SYMMETRIC>
{
    type Output = Factors<'a, B, P, SYMMETRIC>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        Factors::factorized(self.matrix, self.elimination)
    }
}

/// Forward and backward substitution, likewise.
struct Substitution<'m, 'a, const B: usize, const P: usize, const R: usize, const SYMMETRIC: bool> {
    factors: &'m Factors<'a, B, P, SYMMETRIC>,
    loads: &'m [Columns<B, R>],
}

impl<const B: usize, const P: usize, const R: usize, const SYMMETRIC: bool> Vectorised
    for Substitution<'_, '_, B, P, R, SYMMETRIC>
{
    type Output = Vec<Columns<B, R>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.factors.solved(self.loads)
    }
}

/// Work space of the factorization.
struct Work<const P: usize> {
    /// `L D` of the supernode at hand.
    scaled: Vec<[f64; P]>,
    /// Row of each of its rows in the supernode that is updated.
    positions: Vec<usize>,
}

/// Finds `rows` among the rows of `target`.
#[inline(always)]
fn locate(rows: &[usize], target: &Supernode, all_rows: &[usize], positions: &mut [usize]) {
    let below = &all_rows[target.rows.clone()];
    let mut cursor = 0;
    for (row, position) in rows.iter().zip(positions) {
        if *row < target.first + target.width {
            *position = row - target.first;
        } else {
            // The fill of a column is contained in that of the columns it reaches, so the walk always finds the row.
            while below[cursor] < *row {
                cursor += 1;
            }
            *position = target.width + cursor;
        }
    }
}

/// One block row of `L`: `row U = given`.
#[inline(always)]
fn solve_lower_row<const P: usize>(row: &mut [[f64; P]], dense: &[f64], size: usize) {
    for column in 0..size {
        let (done, open) = row.split_at_mut(column);
        let mut value = open[0];
        for (known, upper) in done.iter().zip(dense[column..].iter().step_by(size)) {
            subtract(&mut value, *upper, known);
        }
        let reciprocal = 1.0 / dense[column * size + column];
        open[0] = value.map(|value| value * reciprocal);
    }
}

/// One block column of `U`, transposed: `L column = given`.
#[inline(always)]
fn solve_upper_row<const P: usize>(row: &mut [[f64; P]], dense: &[f64], size: usize) {
    for column in 1..size {
        let (done, open) = row.split_at_mut(column);
        for (known, lower) in done.iter().zip(&dense[column * size..]) {
            subtract(&mut open[0], *lower, known);
        }
    }
}

/// `target -= factor * values`.
#[inline(always)]
fn subtract<const N: usize>(target: &mut [f64; N], factor: f64, values: &[f64; N]) {
    for lane in 0..N {
        target[lane] = (-factor).mul_add(values[lane], target[lane]);
    }
}

/// Subtracts the products of the rows `rights` of a panel from the blocks at their places, several at a time as long as that many are left:
/// a broadcast weight then serves several sums, and more sums are under way than a multiplication takes cycles.
#[inline(always)]
fn subtract_products<const B: usize, const P: usize>(
    targets: &mut [[f64; P]],
    place: impl Fn(usize) -> usize,
    rights: Range<usize>,
    panel: &[[f64; P]],
    weights: &[[f64; P]],
) {
    let mut right = rights.start;
    // Nine vectors of sums for discs; the twelve of one block of spheres leave no room for another.
    if B * P < 24 {
        while right + AT_ONCE <= rights.end {
            let places = std::array::from_fn(|one| place(right + one));
            subtract_block_products::<B, P, AT_ONCE>(targets, places, right, panel, weights);
            right += AT_ONCE;
        }
    }
    for right in right..rights.end {
        subtract_block_products::<B, P, 1>(targets, [place(right)], right, panel, weights);
    }
}

/// `target[c][lane] -= sum_k source[k][lane] * weights[k][c]` for `N` blocks, summed in registers; sums do not depend on `N`.
#[inline(always)]
fn subtract_block_products<const B: usize, const P: usize, const N: usize>(
    targets: &mut [[f64; P]],
    places: [usize; N],
    first: usize,
    panel: &[[f64; P]],
    weights: &[[f64; P]],
) {
    let size = weights.len();
    let sources: [&[[f64; P]]; N] = std::array::from_fn(|one| &panel[(first + one) * size..(first + one + 1) * size]);
    let mut sums = [[[0.0; P]; B]; N];
    for (k, weight) in weights.iter().enumerate() {
        for (sum, source) in sums.iter_mut().zip(&sources) {
            for column in 0..B {
                for lane in 0..P {
                    sum[column][lane] = source[k][lane].mul_add(weight[column], sum[column][lane]);
                }
            }
        }
    }
    for (sum, place) in sums.iter().zip(places) {
        for (target, sum) in targets[place..place + B].iter_mut().zip(sum) {
            for lane in 0..P {
                target[lane] -= sum[lane];
            }
        }
    }
}
