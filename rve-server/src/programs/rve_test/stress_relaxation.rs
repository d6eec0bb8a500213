//! Relaxation of the controlled stresses in small committed strains, where no search finds a strain that meets them.
//!
//! A cell that has come to a point where its equilibrium under the controlled stresses ceases to exist snaps to another
//! state, which no trial from the state before it may reach: the stresses jump with the strain. A test with a soft loading
//! device goes through such a snap. So does this one: the unbalanced stress strains the cell step by step, and every step is
//! committed. Each is the elastic answer to the unbalanced stress times a gain, which grows while the stress follows less
//! than expected (contacts slide, or the cell softens) and falls when the unbalanced stress turns round. Contacts that
//! turn back are elastic, so the target is met from the far side at the latest.

use super::path::{COMPONENTS, Matrix, Operator, flat, tensor_of};
use nalgebra::{DMatrix, DVector};
use protocol::RveError;

/// Most committed steps of relaxed stresses in one increment.
pub(super) const MOST_RELAXED: u32 = 600;

/// Steps of a relaxation after which it ends as near to the stresses as a snap may leave the cell.
pub(super) const STEPS_BEFORE_NEAREST: u32 = 100;

/// Largest difference between a controlled stress and its target that is accepted where the cell snaps across the
/// target, relative to the scale of the stress tolerance: the mean pressure, or the largest target if that is greater.
pub(super) const LARGEST_JUMP: f64 = 0.05;

/// Largest change of a strain component in one step, dimensionless.
const LARGEST_STEP: f64 = 5e-4;

/// Range of the gain.
const GAIN: [f64; 2] = [0.125, 64.0];

/// Share of the unbalanced stress that is left after a step, above which the gain grows.
const SLOW: f64 = 0.5;

/// Stiffness of the softest mode over that of the stiffest, below which an operator says nothing about a step.
const SOUND: f64 = 1e-3;

/// Unknown strain components, numbered 11, 12, 13, 21, ..., their targets, and the gain of the next step.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Relaxation {
    unknowns: Vec<usize>,
    targets: Vec<f64>,
    gain: f64,
    last: Option<DVector<f64>>,
}

impl Relaxation {
    /// Begins with a gain of one.
    pub(super) fn new(targets: &[Option<f64>; COMPONENTS]) -> Self {
        Self {
            unknowns: (0..COMPONENTS).filter(|place| targets[*place].is_some()).collect(),
            targets: targets.iter().flatten().copied().collect(),
            gain: 1.0,
            last: None,
        }
    }

    /// Whether an operator `d sigma / dG` resists every unknown strain.
    pub(super) fn is_sound(&self, elastic: &Operator) -> bool {
        let values = self.symmetric(elastic).symmetric_eigenvalues();
        values.min() > SOUND * values.max() && values.max() > 0.0
    }

    /// The strain after the next step, given the committed strain, its stress (Pa) and the elastic operator there (Pa), which is
    /// sound; prescribed components are those of `gradient`.
    pub(super) fn next(&mut self, gradient: &Matrix, stress: &Matrix, elastic: &Operator) -> Matrix {
        let stress = flat(stress);
        let residual = DVector::from_iterator(
            self.unknowns.len(),
            self.unknowns.iter().zip(&self.targets).map(|(&component, target)| stress[component] - target),
        );
        if let Some(last) = &self.last {
            let left = last.dot(&residual) / last.norm_squared();
            let factor = if left < 0.0 {
                0.5
            } else if left > SLOW {
                2.0
            } else {
                1.0
            };
            self.gain = (self.gain * factor).clamp(GAIN[0], GAIN[1]);
        }
        let step = self.symmetric(elastic).lu().solve(&residual).unwrap_or_else(|| DVector::zeros(residual.len()));
        let largest = step.amax();
        let scale = if largest > 0.0 { self.gain.min(LARGEST_STEP / largest) } else { 0.0 };
        let mut next = flat(gradient);
        for (&component, part) in self.unknowns.iter().zip(step.iter()) {
            next[component] -= scale * part;
        }
        self.last = Some(residual);
        tensor_of(&next)
    }

    fn symmetric(&self, operator: &Operator) -> DMatrix<f64> {
        let unknowns = &self.unknowns;
        DMatrix::from_fn(unknowns.len(), unknowns.len(), |row, column| {
            0.5 * (operator[unknowns[row]][unknowns[column]] + operator[unknowns[column]][unknowns[row]])
        })
    }
}

/// Whether a trial was refused for the size of its strain, so that a search cannot go on.
pub(super) fn is_out_of_range(reason: &RveError) -> bool {
    matches!(reason, RveError::TargetTooLarge { .. } | RveError::TargetInverted { .. })
}
