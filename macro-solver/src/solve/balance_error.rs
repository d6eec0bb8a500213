//! Error of the stresses that the tolerances of the equilibrium leave.

use super::driver::Solver;
use crate::material::stress_level::stress_level;
use crate::observer::BalanceError;
use nalgebra::Matrix3;

impl Solver<'_> {
    /// Error of the committed total stresses, those of grains and pore fluid together, whose next correction of the displacements would be
    /// `correction`, by the tangents of the last evaluation; `None` before the body has been under stress. Costs no evaluation.
    pub(super) fn balance_error(&mut self, correction: &[f64]) -> Option<BalanceError> {
        let points = self.points.all();
        let axes = self.body.mesh().dimension.count();
        let levels = points.iter().map(|point| stress_level(axes, &point.response.stress));
        let largest = &mut self.statistics.largest_pressure;
        *largest = largest.max(levels.sum::<f64>() / points.len() as f64);
        let gradients = self.body.gradients(correction);
        let changes = self.points.total_stress_changes(&gradients);
        (*largest > 0.0).then(|| relative(&changes, *largest))
    }
}

/// Changes of the stresses of all points over a [level](stress_level) of stresses, Pa.
fn relative(changes: &[Matrix3<f64>], pressure: f64) -> BalanceError {
    let count = changes.len() as f64;
    let squares: f64 = changes.iter().map(Matrix3::norm_squared).sum();
    let sum: Matrix3<f64> = changes.iter().sum();
    BalanceError { rms: (squares / count).sqrt() / pressure, of_mean: sum.norm() / count / pressure }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_changes_cancel_in_the_mean_only() {
        let change = Matrix3::new(3.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0);
        let error = relative(&[change, -change], 100.0);
        assert!((error.rms - 0.05).abs() < 1e-15 && error.of_mean == 0.0);
        assert!((relative(&[change, change], 100.0).of_mean - 0.05).abs() < 1e-15);
    }
}
