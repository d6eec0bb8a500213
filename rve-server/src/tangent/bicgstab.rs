//! Iterative solution of the balance equations of large cells of spheres, where the factors of a direct one fill up, when
//! sliding contacts spoil the symmetry.
//!
//! BiCGStab in double precision with the two-level inverse as preconditioner, all right-hand sides side by side in the
//! lanes of a vector, each with its own scalars.

use super::block_matrix::{Block, BlockMatrix, Columns};
use super::single::{SingleColumns, gather};
use super::two_level::{Groups, TwoLevel};
use super::vectorised::{Vectorised, dispatch};

/// Norm of the residual over that of the load at which a column counts as solved. The operator is then right to about
/// this figure.
const TOLERANCE: f64 = 1e-6;

/// Iterations after which a network counts as singular: those that are not need some twenty. Beyond, the material next to
/// flows, and the answer would cost many increments and say little.
const MOST_ITERATIONS: u32 = 400;

/// Solves for all columns of `loads`; `None` if that takes too many iterations or breaks down. `typical` is the stiffness of
/// a contact, N/m.
pub(super) fn solve<const B: usize, const P: usize>(
    matrix: &BlockMatrix<B>,
    loads: &[Columns<B, P>],
    groups: &Groups<B>,
    typical: f64,
) -> Option<Vec<Columns<B, P>>> {
    dispatch(Iteration { matrix, loads, groups, typical })
}

struct Iteration<'a, const B: usize, const P: usize> {
    matrix: &'a BlockMatrix<B>,
    loads: &'a [Columns<B, P>],
    groups: &'a Groups<B>,
    typical: f64,
}

impl<const B: usize, const P: usize> Vectorised for Iteration<'_, B, P> {
    type Output = Option<Vec<Columns<B, P>>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let zero = vec![[[0.0; P]; B]; self.loads.len()];
        let mut inverse = Inverse::of(&self);
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
            inverse.apply(&direction, &mut forward);
            self.apply(&forward, &mut moved);
            let along = dot(self.loads, &moved);
            alpha = std::array::from_fn(|lane| quotient(next_rho[lane], along[lane], open[lane]));
            add_scaled(&mut residual, &alpha.map(|value| -value), &moved);
            inverse.apply(&residual, &mut sideways);
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
    /// `result = matrix * values`.
    #[inline(always)]
    fn apply(&self, values: &[Columns<B, P>], result: &mut [Columns<B, P>]) {
        for ((result, block), value) in result.iter_mut().zip(&self.matrix.diagonal).zip(values) {
            *result = [[0.0; P]; B];
            add_product(result, block, value);
        }
        for ((&[first, second], upper), lower) in
            self.matrix.pairs.iter().zip(&self.matrix.upper).zip(&self.matrix.lower)
        {
            add_product(&mut result[first], upper, &values[second]);
            add_product(&mut result[second], lower, &values[first]);
        }
    }
}

/// The two-level inverse between vectors in double precision, grains in the order of the matrix.
struct Inverse<'a, const B: usize, const P: usize> {
    inverse: TwoLevel<'a, B, P>,
    /// Norms of the loads: over them, all values are plain numbers.
    scale: [f64; P],
    given: Vec<SingleColumns<B, P>>,
    found: Vec<SingleColumns<B, P>>,
    typical: f64,
}

impl<'a, const B: usize, const P: usize> Inverse<'a, B, P> {
    #[inline(always)]
    fn of(iteration: &Iteration<'a, B, P>) -> Self {
        let zero = vec![[[0.0; P]; B]; iteration.loads.len()];
        let norms = dot(iteration.loads, iteration.loads).map(f64::sqrt);
        Self {
            inverse: TwoLevel::of(iteration.matrix, iteration.groups, iteration.typical),
            scale: norms.map(|norm| if norm > 0.0 { norm } else { 1.0 }),
            given: zero.clone(),
            found: zero,
            typical: iteration.typical,
        }
    }

    #[inline(always)]
    fn apply(&mut self, values: &[Columns<B, P>], result: &mut [Columns<B, P>]) {
        gather(values, &self.inverse.order, &self.scale, &mut self.given);
        self.inverse.apply(&self.given, &mut self.found);
        for (found, &grain) in self.found.iter().zip(&self.inverse.order) {
            for unknown in 0..B {
                for lane in 0..P {
                    result[grain][unknown][lane] =
                        f64::from(found[unknown][lane]) * (self.scale[lane] / self.typical);
                }
            }
        }
    }
}

/// `target += block * values`.
#[inline(always)]
fn add_product<const B: usize, const P: usize>(target: &mut Columns<B, P>, block: &Block<B>, values: &Columns<B, P>) {
    for row in 0..B {
        let mut sum = target[row];
        for column in 0..B {
            for lane in 0..P {
                sum[lane] = block[row][column].mul_add(values[column][lane], sum[lane]);
            }
        }
        target[row] = sum;
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
