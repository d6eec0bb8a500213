//! What one increment of an element test aims at.

use super::path::{COMPONENTS, Matrix, Operator, SegmentKinematics, flat, tensor_of};
use super::servo::Miss;
use crate::space::add_scaled;

/// Share of the largest stress at which a segment has started that counts for the scale of the stress tolerance. On the way to no stress at
/// all, pressure and targets would leave nothing to measure by; within a hundredth of where it came from, a cell is measured by them.
pub(super) const LEAST_SHARE: f64 = 1e-2;

/// Change of an unknown component over that of the prescribed ones up to which it is expected again, and the strain up to which it always is.
const MOST_AGAIN: f64 = 10.0;
const SMALL_STRAIN: f64 = 5e-3;

/// Targets of one increment.
#[derive(Clone)]
pub(super) struct Step {
    pub(super) kinematics: SegmentKinematics,
    /// G of the committed state.
    pub(super) committed_gradient: Matrix,
    /// G with its prescribed components at their new values and its unknown ones as committed.
    pub(super) gradient: Matrix,
    /// Stress targets of the controlled components, Pa.
    pub(super) targets: [Option<f64>; COMPONENTS],
    /// Largest stress component at the start of this segment or one before, Pa.
    pub(super) level: f64,
}

impl Step {
    /// Makes `gradient` the committed state.
    pub(super) fn advance_committed(&mut self, gradient: Matrix) {
        self.committed_gradient = gradient;
        self.kinematics.committed = self.kinematics.deformation(&gradient);
    }

    /// The controlled component farthest from its target.
    pub(super) fn miss(&self, stress: &Matrix) -> Miss {
        Miss::farthest(stress, &self.targets)
    }

    /// `gradient` with its unknown components taken from `source`.
    pub(super) fn with_unknowns(&self, source: &Matrix) -> Matrix {
        let (mut values, source) = (flat(&self.gradient), flat(source));
        for place in 0..COMPONENTS {
            if self.targets[place].is_some() {
                values[place] = source[place];
            }
        }
        tensor_of(&values)
    }

    /// Whether the unknown components may change again as they did: not after a rearrangement that moved them by much more than what is
    /// prescribed moves now. Where all components are unknown there is nothing to tell by.
    pub(super) fn goes_on_with(&self, change: &Matrix) -> bool {
        let prescribed = flat(&add_scaled(&self.gradient, -1.0, &self.committed_gradient));
        let largest =
            |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most: f64, value| most.max(value.abs()));
        let given = largest(&mut prescribed.into_iter());
        let unknown = (0..COMPONENTS).filter(|place| self.targets[*place].is_some());
        let changed = flat(change);
        given == 0.0 || largest(&mut unknown.map(|place| changed[place])) <= SMALL_STRAIN.max(MOST_AGAIN * given)
    }

    /// Stress to first order if only the prescribed components move.
    pub(super) fn expected_stress(&self, stress: &Matrix, derivative: &Operator) -> Matrix {
        let change = flat(&add_scaled(&self.gradient, -1.0, &self.committed_gradient));
        let mut expected = flat(stress);
        for (value, row) in expected.iter_mut().zip(derivative) {
            *value += row.iter().zip(&change).map(|(coefficient, part)| coefficient * part).sum::<f64>();
        }
        tensor_of(&expected)
    }

    /// Scale of the stress tolerance, Pa.
    pub(super) fn stress_scale(&self, stress: &Matrix, dimension: usize) -> f64 {
        let pressure = (stress[0][0] + stress[1][1] + stress[2][2]).abs() / dimension as f64;
        let least = pressure.max(LEAST_SHARE * self.level);
        self.targets.iter().flatten().fold(least, |largest, target| largest.max(target.abs()))
    }
}

/// The larger of a level of stress and the largest of these components, Pa.
pub(super) fn raised_level(level: f64, stress: &[f64]) -> f64 {
    stress.iter().fold(level, |largest, component| largest.max(component.abs()))
}
