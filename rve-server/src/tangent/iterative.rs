//! Iterative solution of the balance equations of large cells of spheres, where the factors of a direct one fill up.
//!
//! BiCGStab with the inverse diagonal blocks as preconditioner, all right-hand sides side by side in the lanes of a
//! vector, each with its own scalars. It copes with the asymmetry of slip and with mechanisms that carry no load.

use super::block_matrix::{Block, BlockMatrix, Columns, subtract_applied};
use super::vectorised::{Vectorised, dispatch};

/// Norm of the residual over that of the load at which a column counts as solved. The operator is then right to about
/// this figure.
pub(super) const TOLERANCE: f64 = 1e-6;

/// Iterations after which a network counts as singular.
const MOST_ITERATIONS: u32 = 1500;

/// Solves for all columns of `loads`; `None` if that takes too many iterations or breaks down.
pub(super) fn solve<const B: usize, const P: usize>(
    matrix: &BlockMatrix<B>,
    loads: &[Columns<B, P>],
) -> Option<Vec<Columns<B, P>>> {
    dispatch(Iteration { matrix, loads })
}

struct Iteration<'a, const B: usize, const P: usize> {
    matrix: &'a BlockMatrix<B>,
    loads: &'a [Columns<B, P>],
}

impl<const B: usize, const P: usize> Vectorised for Iteration<'_, B, P> {
    type Output = Option<Vec<Columns<B, P>>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let zero = vec![[[0.0; P]; B]; self.loads.len()];
        let inverses = self.inverses();
        let wanted = dot(self.loads, self.loads).map(|square| TOLERANCE * TOLERANCE * square);
        let mut answers = zero.clone();
        let mut residual = self.loads.to_vec();
        let mut direction = zero.clone();
        let (mut moved, mut carried) = (zero.clone(), zero.clone());
        let (mut forward, mut sideways) = (zero.clone(), zero);
        let (mut rho, mut alpha, mut omega) = ([1.0; P], [1.0; P], [1.0; P]);
        for _ in 0..MOST_ITERATIONS {
            let square = dot(&residual, &residual);
            let open: [bool; P] = std::array::from_fn(|lane| square[lane] > wanted[lane]);
            if square.iter().any(|value| !value.is_finite()) {
                return None;
            }
            if !open.contains(&true) {
                return Some(answers);
            }
            let next_rho = dot(self.loads, &residual);
            let beta: [f64; P] = std::array::from_fn(|lane| {
                quotient(next_rho[lane] * alpha[lane], rho[lane] * omega[lane], open[lane])
            });
            for ((direction, residual), moved) in direction.iter_mut().zip(&residual).zip(&moved) {
                for unknown in 0..B {
                    for lane in 0..P {
                        let old = (-omega[lane]).mul_add(moved[unknown][lane], direction[unknown][lane]);
                        direction[unknown][lane] = beta[lane].mul_add(old, residual[unknown][lane]);
                    }
                }
            }
            precondition(&inverses, &direction, &mut forward);
            self.apply(&forward, &mut moved);
            let along = dot(self.loads, &moved);
            alpha = std::array::from_fn(|lane| quotient(next_rho[lane], along[lane], open[lane]));
            add_scaled(&mut residual, &alpha.map(|value| -value), &moved);
            precondition(&inverses, &residual, &mut sideways);
            self.apply(&sideways, &mut carried);
            let (projected, length) = (dot(&carried, &residual), dot(&carried, &carried));
            omega = std::array::from_fn(|lane| quotient(projected[lane], length[lane], open[lane]));
            add_scaled(&mut answers, &alpha, &forward);
            add_scaled(&mut answers, &omega, &sideways);
            add_scaled(&mut residual, &omega.map(|value| -value), &carried);
            rho = next_rho;
        }
        None
    }
}

impl<const B: usize, const P: usize> Iteration<'_, B, P> {
    /// Inverses of the diagonal blocks, their symmetric part.
    #[inline(always)]
    fn inverses(&self) -> Vec<Block<B>> {
        self.matrix.diagonal.iter().map(inverted).collect()
    }

    /// `result = matrix * values`.
    #[inline(always)]
    fn apply(&self, values: &[Columns<B, P>], result: &mut [Columns<B, P>]) {
        for ((result, block), value) in result.iter_mut().zip(&self.matrix.diagonal).zip(values) {
            *result = [[0.0; P]; B];
            subtract_applied(result, block, value);
        }
        for ((&[first, second], upper), lower) in
            self.matrix.pairs.iter().zip(&self.matrix.upper).zip(&self.matrix.lower)
        {
            subtract_applied(&mut result[first], upper, &values[second]);
            subtract_applied(&mut result[second], lower, &values[first]);
        }
        for row in result.iter_mut().flatten() {
            *row = row.map(|value| -value);
        }
    }
}

/// A ratio, or 0 for a column that is solved or has nothing to divide by.
#[inline(always)]
fn quotient(numerator: f64, denominator: f64, open: bool) -> f64 {
    if open && denominator != 0.0 { numerator / denominator } else { 0.0 }
}

#[inline(always)]
fn dot<const B: usize, const P: usize>(a: &[Columns<B, P>], b: &[Columns<B, P>]) -> [f64; P] {
    let mut sum = [0.0; P];
    for (a, b) in a.iter().zip(b) {
        for unknown in 0..B {
            for lane in 0..P {
                sum[lane] = a[unknown][lane].mul_add(b[unknown][lane], sum[lane]);
            }
        }
    }
    sum
}

#[inline(always)]
fn add_scaled<const B: usize, const P: usize>(
    target: &mut [Columns<B, P>],
    factors: &[f64; P],
    values: &[Columns<B, P>],
) {
    for (target, values) in target.iter_mut().zip(values) {
        for unknown in 0..B {
            for lane in 0..P {
                target[unknown][lane] = factors[lane].mul_add(values[unknown][lane], target[unknown][lane]);
            }
        }
    }
}

#[inline(always)]
fn precondition<const B: usize, const P: usize>(
    inverses: &[Block<B>],
    values: &[Columns<B, P>],
    result: &mut [Columns<B, P>],
) {
    for ((result, inverse), value) in result.iter_mut().zip(inverses).zip(values) {
        for unknown in 0..B {
            let mut sum = [0.0; P];
            for other in 0..B {
                for lane in 0..P {
                    sum[lane] = inverse[unknown][other].mul_add(value[other][lane], sum[lane]);
                }
            }
            result[unknown] = sum;
        }
    }
}

/// Inverse of the block's symmetric part by Gauss-Jordan; a pivot that is next to nothing leaves its unknown as it is.
#[inline(always)]
fn inverted<const B: usize>(block: &Block<B>) -> Block<B> {
    let mut rest: Block<B> =
        std::array::from_fn(|row| std::array::from_fn(|column| 0.5 * (block[row][column] + block[column][row])));
    let largest = rest.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let mut inverse: Block<B> =
        std::array::from_fn(|row| std::array::from_fn(|column| if row == column { 1.0 } else { 0.0 }));
    for pivot in 0..B {
        if rest[pivot][pivot].abs() <= 1e-6 * largest {
            rest[pivot][pivot] = largest;
        }
        let scale = 1.0 / rest[pivot][pivot];
        rest[pivot] = rest[pivot].map(|value| value * scale);
        inverse[pivot] = inverse[pivot].map(|value| value * scale);
        for row in (0..B).filter(|row| *row != pivot) {
            let factor = rest[row][pivot];
            for column in 0..B {
                rest[row][column] -= factor * rest[pivot][column];
                inverse[row][column] -= factor * inverse[pivot][column];
            }
        }
    }
    inverse
}
