//! Limited-memory BFGS on the free degrees of freedom: corrections of kept factors from what iterates have taught.
//!
//! A pair is the change of the displacements from one accepted iterate of an attempt to the next and the change of the
//! out-of-balance force that came with it. Pairs of earlier steps stay, up to a number; a failed attempt drops them all.

use crate::problem::QuasiNewton;
use crate::solve::vectors::{add, difference, dot};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Pairs in whose direction the body has lost its stiffness, or gained it by noise, are not used: cosine between change
/// of displacement and change of force.
const LEAST_COSINE: f64 = 1e-2;

/// What has been learnt.
#[derive(Clone, Debug, Default)]
pub(in crate::solve) struct Memory {
    most: usize,
    min_change: f64,
    pairs: VecDeque<Pair>,
    last: Option<Iterate>,
}

/// One pair, over the unknowns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::solve) struct Pair {
    step: Vec<f64>,
    force: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Iterate {
    displacements: Vec<f64>,
    residual: Vec<f64>,
}

impl Memory {
    pub(in crate::solve) fn new(settings: &QuasiNewton) -> Self {
        Self { most: settings.pairs, min_change: settings.min_change, pairs: VecDeque::new(), last: None }
    }

    /// Starts an attempt: its first iterate has no predecessor.
    pub(in crate::solve) fn begin_attempt(&mut self, again: bool) {
        self.last = None;
        if again {
            self.pairs.clear();
        }
    }

    /// Takes an accepted iterate and its out-of-balance force; `change` tells the largest change of any point's
    /// displacement gradient that a change of the unknowns brings.
    pub(in crate::solve) fn learn(
        &mut self,
        displacements: &[f64],
        residual: &[f64],
        change: impl Fn(&[f64]) -> f64,
    ) {
        if let Some(last) = &self.last {
            let pair = Pair {
                step: difference(displacements, &last.displacements),
                force: difference(residual, &last.residual),
            };
            let cosine =
                dot(&pair.step, &pair.force) / (dot(&pair.step, &pair.step) * dot(&pair.force, &pair.force)).sqrt();
            if cosine > LEAST_COSINE && change(&pair.step) >= self.min_change {
                self.pairs.push_back(pair);
                if self.pairs.len() > self.most {
                    self.pairs.pop_front();
                }
            }
        }
        self.last = Some(Iterate { displacements: displacements.to_vec(), residual: residual.to_vec() });
    }

    /// `H right`, where `H` is the inverse that the pairs have made of `solve`.
    ///
    /// # Errors
    /// Those of `solve`.
    pub(in crate::solve) fn apply<E>(
        &self,
        right: &[f64],
        solve: impl FnOnce(&[f64]) -> Result<Vec<f64>, E>,
    ) -> Result<Vec<f64>, E> {
        let mut right = right.to_vec();
        let mut shares = Vec::with_capacity(self.pairs.len());
        for pair in self.pairs.iter().rev() {
            let share = dot(&pair.step, &right) / dot(&pair.step, &pair.force);
            add(&mut right, -share, &pair.force);
            shares.push(share);
        }
        let mut solution = solve(&right)?;
        for (pair, share) in self.pairs.iter().zip(shares.into_iter().rev()) {
            let back = dot(&pair.force, &solution) / dot(&pair.step, &pair.force);
            add(&mut solution, share - back, &pair.step);
        }
        Ok(solution)
    }

    pub(in crate::solve) fn record(&self) -> Vec<Pair> {
        self.pairs.iter().cloned().collect()
    }

    /// Takes up saved pairs; `false` if they belong to other unknowns.
    pub(in crate::solve) fn restore(&mut self, pairs: Vec<Pair>, unknowns: usize) -> bool {
        let fits = pairs.iter().all(|pair| pair.step.len() == unknowns && pair.force.len() == unknowns);
        self.pairs = pairs.into();
        fits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A symmetric positive matrix; the kept factors are those of its diagonal.
    const MATRIX: [[f64; 3]; 3] = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.5], [0.5, -0.5, 2.0]];

    fn times(vector: &[f64]) -> Vec<f64> {
        MATRIX.iter().map(|row| dot(row, vector)).collect()
    }

    fn diagonal(right: &[f64]) -> Result<Vec<f64>, ()> {
        Ok((0..3).map(|row| right[row] / MATRIX[row][row]).collect())
    }

    /// On a linear problem the newest pair is always met, and the iteration ends far sooner than that of the kept factors.
    #[test]
    fn a_linear_problem_is_solved_in_few_iterations() {
        let load = [1.0, -2.0, 0.7];
        let iterations = |pairs: usize| {
            let mut memory = Memory::new(&QuasiNewton { pairs, min_change: 0.0 });
            memory.begin_attempt(false);
            let mut iterate = vec![0.0; 3];
            for turn in 0..100 {
                let residual = difference(&times(&iterate), &load);
                if dot(&residual, &residual).sqrt() < 1e-10 {
                    return turn;
                }
                memory.learn(&iterate, &residual, |_| 1.0);
                if let Some(newest) = memory.pairs.back() {
                    let met = memory.apply(&newest.force, diagonal).unwrap();
                    assert!(met.iter().zip(&newest.step).all(|(met, step)| (met - step).abs() < 1e-12));
                }
                let right: Vec<f64> = residual.iter().map(|value| -value).collect();
                add(&mut iterate, 1.0, &memory.apply(&right, diagonal).unwrap());
            }
            100
        };
        let (plain, remembered) = (iterations(0), iterations(10));
        assert!(remembered <= 9 && plain > 2 * remembered, "{plain} {remembered}");
    }

    #[test]
    fn noise_and_softening_are_not_learnt_and_a_failure_forgets() {
        let mut memory = Memory::new(&QuasiNewton { pairs: 2, min_change: 0.5 });
        memory.begin_attempt(false);
        memory.learn(&[0.0], &[0.0], |step| step[0].abs());
        memory.learn(&[0.1], &[0.2], |step| step[0].abs());
        assert!(memory.pairs.is_empty(), "a change below the gate");
        memory.learn(&[1.1], &[-0.8], |step| step[0].abs());
        assert!(memory.pairs.is_empty(), "force falls while the displacement grows");
        for turn in 1..5 {
            memory.learn(&[1.1 + f64::from(turn)], &[f64::from(turn)], |step| step[0].abs());
        }
        assert_eq!(memory.pairs.len(), 2);
        memory.begin_attempt(false);
        assert_eq!(memory.pairs.len(), 2);
        memory.begin_attempt(true);
        assert!(memory.pairs.is_empty() && memory.last.is_none());
    }
}
