//! Iterative solution of the balance equations of large cells of spheres, where the factors of a direct one fill up, when
//! sliding contacts spoil the symmetry.
//!
//! BiCGStab in double precision with the two-level inverse as preconditioner, all right-hand sides side by side in the
//! lanes of a vector, each with its own scalars.

use super::block_matrix::Columns;
use super::closeness::Closeness;
use super::single_precision::{SingleColumns, gather};
use super::two_level::{Problem, TwoLevel};
use crate::simd::{Vectorised, dispatch};

/// Iterations after which a network counts as singular: those that are not need some twenty. Beyond, the material next to
/// flows, and the answer would cost many increments and say little.
const MOST_ITERATIONS: u32 = 100;

/// Solves for all columns of the loads; `None` if that takes too many iterations or breaks down.
pub(super) fn solve<const B: usize, const P: usize>(
    problem: Problem<'_, B, P>,
    closeness: Closeness,
) -> Option<Vec<Columns<B, P>>> {
    dispatch(Iteration(problem, closeness))
}

struct Iteration<'a, const B: usize, const P: usize>(Problem<'a, B, P>, Closeness);

impl<const B: usize, const P: usize> Vectorised for Iteration<'_, B, P> {
    type Output = Option<Vec<Columns<B, P>>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self(problem, closeness) = self;
        let Problem { matrix, loads, .. } = problem;
        let zero = vec![[[0.0; P]; B]; loads.len()];
        let mut inverse = Inverse::of(problem);
        let wanted = dot(loads, loads).map(|square| closeness.residual_with_slip.powi(2) * square);
        let mut answers = zero.clone();
        let mut residual = loads.to_vec();
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
            let next_rho = dot(loads, &residual);
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
            matrix.apply(&forward, &mut moved);
            let along = dot(loads, &moved);
            alpha = std::array::from_fn(|lane| quotient(next_rho[lane], along[lane], open[lane]));
            add_scaled(&mut residual, &alpha.map(|value| -value), &moved);
            inverse.apply(&residual, &mut sideways);
            matrix.apply(&sideways, &mut carried);
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
    fn of(problem: Problem<'a, B, P>) -> Self {
        let zero = vec![[[0.0; P]; B]; problem.loads.len()];
        let norms = dot(problem.loads, problem.loads).map(f64::sqrt);
        Self {
            inverse: TwoLevel::of(problem),
            scale: norms.map(|norm| if norm > 0.0 { norm } else { 1.0 }),
            given: zero.clone(),
            found: zero,
            typical: problem.typical,
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
