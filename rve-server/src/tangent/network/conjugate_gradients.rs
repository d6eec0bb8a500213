//! Large networks whose matrix is symmetric but for the prestress: conjugate gradients in single precision within
//! corrections in double precision.
//!
//! All right-hand sides run side by side in the lanes of a vector, each with its own scalars.

use super::block_matrix::Columns;
use super::closeness::Closeness;
use super::single_precision::{SingleColumns, dot, gather};
use super::two_level::{Problem, TwoLevel};
use crate::simd::{Vectorised, dispatch};

/// Iterations whose work is the estimate of what was missing before them.
const LOOK_BACK: usize = 4;

/// Residual in double precision over the one at which iterations in single precision have ended: beyond it they are corrected.
const LARGEST_DRIFT: f64 = 3.0;

/// Most corrections.
const MOST_ROUNDS: u32 = 4;

/// Most iterations in all: a network that needs more stands at a mechanism, or its prestress spoils the symmetry.
const MOST_ITERATIONS: u32 = 300;

/// Solves for all columns of `loads`; the answers and what they leave of the loads. `None` if that takes too many
/// iterations or breaks down.
pub(super) fn solve<const B: usize, const P: usize>(
    problem: Problem<'_, B, P>,
    closeness: Closeness,
) -> Option<[Vec<Columns<B, P>>; 2]> {
    dispatch(Corrections(problem, closeness))
}

struct Corrections<'a, const B: usize, const P: usize>(Problem<'a, B, P>, Closeness);

impl<const B: usize, const P: usize> Vectorised for Corrections<'_, B, P> {
    type Output = Option<[Vec<Columns<B, P>>; 2]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self(problem, closeness) = self;
        let Problem { matrix, loads, typical, .. } = problem;
        let inverse = TwoLevel::of(problem);
        let mut iterations = Iterations::new(loads.len(), closeness.missing_work);
        let goal = squares(loads).map(|square| closeness.residual.powi(2) * square);
        // Squares of the residuals that are as good as wanted.
        let mut wanted = goal;
        let mut answers = vec![[[0.0; P]; B]; loads.len()];
        let mut residual = loads.to_vec();
        for _ in 0..=MOST_ROUNDS {
            let square = squares(&residual);
            if square.iter().any(|value| !value.is_finite()) {
                return None;
            }
            if (0..P).all(|lane| square[lane] <= wanted[lane] * LARGEST_DRIFT.powi(2)) {
                return Some([answers, residual]);
            }
            let scale = square.map(|square| if square > 0.0 { square.sqrt() } else { 1.0 });
            gather(&residual, &inverse.order, &scale, &mut iterations.residual);
            let goals = std::array::from_fn(|lane| goal[lane] / (scale[lane] * scale[lane]));
            if !iterations.run(&inverse, &goals, &scale) {
                return None;
            }
            let left = dot(&iterations.residual, &iterations.residual);
            wanted = std::array::from_fn(|lane| goal[lane].max(left[lane] * scale[lane] * scale[lane]));
            for (change, &grain) in iterations.answer.iter().zip(&inverse.order) {
                for unknown in 0..B {
                    for lane in 0..P {
                        answers[grain][unknown][lane] += f64::from(change[unknown][lane]) * (scale[lane] / typical);
                    }
                }
            }
            residual = matrix.residual(loads, &answers);
        }
        None
    }
}

/// Vectors of the iteration, grains in the order of the inverse.
struct Iterations<const B: usize, const P: usize> {
    answer: Vec<SingleColumns<B, P>>,
    residual: Vec<SingleColumns<B, P>>,
    /// The approximate inverse times the residual.
    guess: Vec<SingleColumns<B, P>>,
    direction: Vec<SingleColumns<B, P>>,
    /// The matrix times the direction.
    moved: Vec<SingleColumns<B, P>>,
    /// Work of each load on its motions, over `1 / typical`.
    work: [f64; P],
    /// [`Closeness::missing_work`].
    missing_work: f64,
    /// Iterations made.
    made: u32,
}

impl<const B: usize, const P: usize> Iterations<B, P> {
    fn new(grains: usize, missing_work: f64) -> Self {
        let zero = vec![[[0.0; P]; B]; grains];
        Self {
            answer: zero.clone(),
            residual: zero.clone(),
            guess: zero.clone(),
            direction: zero.clone(),
            moved: zero,
            work: [0.0; P],
            missing_work,
            made: 0,
        }
    }

    /// Iterates from the residual at hand, `scale` times smaller than it is, until its squares are below `goal` or little work of the
    /// loads is missing. Whether it gets there.
    ///
    /// Each iteration adds to that work what the answers gain in the norm of the energy, so that the last gains tell what was missing
    /// before them.
    #[inline(always)]
    fn run(&mut self, inverse: &TwoLevel<'_, B, P>, goal: &[f64; P], scale: &[f64; P]) -> bool {
        self.answer.fill([[0.0; P]; B]);
        self.direction.fill([[0.0; P]; B]);
        let mut last: Option<[f64; P]> = None;
        let mut gains = [[f64::INFINITY; P]; LOOK_BACK];
        let mut open = [true; P];
        loop {
            let square = dot(&self.residual, &self.residual);
            for lane in 0..P {
                let missing: f64 = gains.iter().map(|gain| gain[lane]).sum();
                open[lane] &= square[lane] > goal[lane] && missing > self.missing_work * self.work[lane];
            }
            if square.iter().any(|value| !value.is_finite()) || self.made == MOST_ITERATIONS {
                return false;
            }
            if !open.contains(&true) {
                return true;
            }
            self.made += 1;
            inverse.apply(&self.residual, &mut self.guess);
            let gain = dot(&self.residual, &self.guess);
            let keep: [f32; P] = std::array::from_fn(|lane| match last {
                Some(last) => quotient(gain[lane], last[lane], open[lane]),
                None => 0.0,
            });
            last = Some(gain);
            for (direction, guess) in self.direction.iter_mut().zip(&self.guess) {
                for unknown in 0..B {
                    for lane in 0..P {
                        direction[unknown][lane] = keep[lane].mul_add(direction[unknown][lane], guess[unknown][lane]);
                    }
                }
            }
            inverse.matrix.apply(&self.direction, &mut self.moved);
            let stiffness = dot(&self.direction, &self.moved);
            let length: [f32; P] = std::array::from_fn(|lane| quotient(gain[lane], stiffness[lane], open[lane]));
            for lane in 0..P {
                let work = f64::from(length[lane]) * gain[lane] * scale[lane] * scale[lane];
                self.work[lane] += work;
                // A loss shows that the matrix is not definite: then gains tell nothing.
                gains[self.made as usize % LOOK_BACK][lane] = if work < 0.0 { f64::INFINITY } else { work };
            }
            let vectors = self.answer.iter_mut().zip(&mut self.residual).zip(&self.direction).zip(&self.moved);
            for (((answer, residual), direction), moved) in vectors {
                for unknown in 0..B {
                    for lane in 0..P {
                        answer[unknown][lane] = length[lane].mul_add(direction[unknown][lane], answer[unknown][lane]);
                        residual[unknown][lane] =
                            (-length[lane]).mul_add(moved[unknown][lane], residual[unknown][lane]);
                    }
                }
            }
        }
    }
}

/// A ratio, or 0 for a column that is solved or has nothing to divide by.
#[inline(always)]
fn quotient(numerator: f64, denominator: f64, open: bool) -> f32 {
    if open && denominator != 0.0 { (numerator / denominator) as f32 } else { 0.0 }
}

#[inline(always)]
fn squares<const B: usize, const P: usize>(values: &[Columns<B, P>]) -> [f64; P] {
    let mut sum = [0.0; P];
    for row in values.iter().flatten() {
        for lane in 0..P {
            sum[lane] = row[lane].mul_add(row[lane], sum[lane]);
        }
    }
    sum
}
