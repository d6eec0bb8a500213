//! Large networks whose matrix is symmetric but for the prestress: conjugate gradients in single precision within
//! corrections in double precision.
//!
//! All right-hand sides run side by side in the lanes of a vector, each with its own scalars.

use super::block_matrix::Columns;
use super::single_precision::{SingleColumns, dot, gather};
use super::two_level::{Problem, TwoLevel};
use super::vectorised::{Vectorised, dispatch};

/// Norm of the residual over that of the load at which iterations end. A symmetric operator that is corrected by what is
/// left is right to about the square of this, times the softness of the softest motion.
const TOLERANCE: f64 = 3e-4;

/// The same for the residual in double precision: rounding of the iterations may leave a little more.
const ACCEPTED: f64 = 3.0 * TOLERANCE;

/// Most corrections.
const MOST_ROUNDS: u32 = 4;

/// Most iterations in all: a network that needs more stands at a mechanism, or its prestress spoils the symmetry.
const MOST_ITERATIONS: u32 = 300;

/// Solves for all columns of `loads`; the answers and what they leave of the loads. `None` if that takes too many
/// iterations or breaks down.
pub(super) fn solve<const B: usize, const P: usize>(problem: Problem<'_, B, P>) -> Option<[Vec<Columns<B, P>>; 2]> {
    dispatch(Corrections(problem))
}

struct Corrections<'a, const B: usize, const P: usize>(Problem<'a, B, P>);

impl<const B: usize, const P: usize> Vectorised for Corrections<'_, B, P> {
    type Output = Option<[Vec<Columns<B, P>>; 2]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self(problem) = self;
        let Problem { matrix, loads, typical, .. } = problem;
        let inverse = TwoLevel::of(problem);
        let mut iterations = Iterations::new(loads.len());
        let goal = squares(loads).map(|square| TOLERANCE * TOLERANCE * square);
        let mut answers = vec![[[0.0; P]; B]; loads.len()];
        let mut residual = loads.to_vec();
        for _ in 0..=MOST_ROUNDS {
            let square = squares(&residual);
            if square.iter().any(|value| !value.is_finite()) {
                return None;
            }
            if (0..P).all(|lane| square[lane] <= goal[lane] * (ACCEPTED / TOLERANCE).powi(2)) {
                return Some([answers, residual]);
            }
            let scale = square.map(|square| if square > 0.0 { square.sqrt() } else { 1.0 });
            gather(&residual, &inverse.order, &scale, &mut iterations.residual);
            let goal = std::array::from_fn(|lane| goal[lane] / (scale[lane] * scale[lane]));
            if !iterations.run(&inverse, &goal) {
                return None;
            }
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
    /// Iterations made.
    made: u32,
}

impl<const B: usize, const P: usize> Iterations<B, P> {
    fn new(grains: usize) -> Self {
        let zero = vec![[[0.0; P]; B]; grains];
        Self {
            answer: zero.clone(),
            residual: zero.clone(),
            guess: zero.clone(),
            direction: zero.clone(),
            moved: zero,
            made: 0,
        }
    }

    /// Iterates from the residual at hand until its squares are below `goal`. Whether it gets there.
    #[inline(always)]
    fn run(&mut self, inverse: &TwoLevel<'_, B, P>, goal: &[f64; P]) -> bool {
        self.answer.fill([[0.0; P]; B]);
        self.direction.fill([[0.0; P]; B]);
        let mut last: Option<[f64; P]> = None;
        loop {
            let square = dot(&self.residual, &self.residual);
            let open: [bool; P] = std::array::from_fn(|lane| square[lane] > goal[lane]);
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
