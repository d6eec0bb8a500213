//! How far an iterate is from the end of its step, by the criteria of a stage.

use super::driver::Solver;
use super::vectors::norm;
use crate::problem::{ConvergenceMeasures, DisplacementMeasure};

/// A correction below this share of the displacements so far is round-off: a step in which nothing moves converges.
const ROUND_OFF: f64 = 1e-12;

/// A correction below this share of the extent of the body is so too: a body without stress has displacements of round-off only.
const ROUND_OFF_OF_EXTENT: f64 = 1e-13;

/// In stages in which nothing changes but friction: corrections below this share of the extent of the body are round-off. A body that bears
/// the change has no displacement that its corrections could be compared with.
const UNMOVED: f64 = 1e-9;

impl Solver<'_> {
    /// Convergence measures of an iterate whose next correction is `correction`.
    pub(super) fn convergence_measures(
        &self,
        force: f64,
        iterate: &[f64],
        correction: &[f64],
        full_step: f64,
    ) -> ConvergenceMeasures {
        let size = match self.stage().tolerances.criteria.displacement {
            Some(DisplacementMeasure::Step) => norm(iterate),
            Some(DisplacementMeasure::FullStep) | None => full_step * norm(iterate),
        };
        let unmoved = if self.stage().changes_friction_alone() { UNMOVED } else { ROUND_OFF_OF_EXTENT };
        let least = unmoved * self.body.extent() * (correction.len() as f64).sqrt();
        let round_off = least.max(ROUND_OFF * norm(&self.body.displacements));
        let work = |forces: &[f64], along: &[f64]| {
            forces.iter().zip(along).map(|(force, along)| force * along).sum::<f64>().abs()
        };
        let energy = work(&self.balance.residual(), correction);
        ConvergenceMeasures {
            force,
            displacement: ratio(norm(correction), size, round_off),
            energy: if energy == 0.0 { 0.0 } else { energy / work(&self.balance.internal, iterate) },
        }
    }

    /// Size of a full step over that of the step to `stage_fraction`; 1 for the initial equilibrium, which has no size.
    pub(super) fn full_step(&self, stage_fraction: f64) -> f64 {
        let size = stage_fraction - self.stage_fraction;
        if size > 0.0 { 1.0 / (self.stage().control.increments as f64 * size) } else { 1.0 }
    }
}

/// A ratio that is 0 when nothing is left to correct.
fn ratio(correction: f64, step: f64, round_off: f64) -> f64 {
    if correction <= round_off { 0.0 } else { correction / step }
}
