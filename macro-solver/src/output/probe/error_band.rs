//! Error of a probe from the estimated error of the stresses.

use super::Probe;
use super::field::{FieldProbe, Part, Statistic};
use super::measure::Measure;
use super::stress_measure::StressMeasure;
use crate::formulation::tensor::matrix;
use crate::material::error_estimate::ErrorEstimate;
use crate::material::stress_level::stress_level;
use crate::observer::{FieldsView, StepReport};
use protocol::Tensor2;
use serde::{Deserialize, Serialize};

/// Relative size of the finite differences.
const DIFFERENCE: f64 = 1e-6;

/// What the errors of probes are related to: estimates are relative to the largest [level](stress_level) of the stress so far, and so are
/// the errors that a body keeps when it is unloaded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::output) struct LargestLevels {
    /// For each probe the largest level of the mean stress of its part, Pa; 0 for what has no error.
    of_probes: Vec<f64>,
}

impl LargestLevels {
    /// Takes note of an accepted step, and gives the estimated errors of the probes after it; none without an estimate.
    pub(in crate::output) fn errors(
        &mut self,
        probes: &[Probe],
        report: &StepReport,
        view: &FieldsView<'_>,
    ) -> Vec<Option<f64>> {
        self.of_probes.resize(probes.len(), 0.0);
        for (largest, probe) in self.of_probes.iter_mut().zip(probes) {
            *largest = largest.max(probe.quantity.level(view));
        }
        let Some(estimate) = &report.accuracy.combined() else { return Vec::new() };
        let with_levels = probes.iter().zip(&self.of_probes);
        with_levels.map(|(probe, &level)| probe.quantity.error(view, estimate, level)).collect()
    }
}

impl FieldProbe {
    /// Whether the value is a mean of stresses or a function of one.
    pub(super) fn has_error(&self) -> bool {
        matches!(self.measure, Measure::Stress(_)) && self.statistic == Statistic::Mean
    }

    /// Level of the mean stress of the part, Pa; 0 for what is no mean of stresses.
    pub(super) fn level(&self, view: &FieldsView<'_>) -> f64 {
        if !self.has_error() {
            return 0.0;
        }
        stress_level(view.mesh.dimension.count(), &matrix(&self.mean_stress(view)))
    }

    /// Estimated error of the value, in its unit; `None` for what is no mean of stresses. A function of the stress changes by at most
    /// the norm of its gradient times the error of the stress, which is relative to `level`, Pa.
    pub(super) fn error(&self, view: &FieldsView<'_>, estimate: &ErrorEstimate, level: f64) -> Option<f64> {
        let Measure::Stress(measure) = self.measure else { return None };
        if self.statistic != Statistic::Mean {
            return None;
        }
        let relative = if self.part == Part::Body { estimate.of_mean } else { estimate.rms };
        Some(gradient_norm(measure, &self.mean_stress(view), level)? * relative * level)
    }

    /// Mean stress of the part, Pa.
    fn mean_stress(&self, view: &FieldsView<'_>) -> Tensor2 {
        let component = |row, column| {
            let measure = Measure::Stress(StressMeasure::Component(row, column));
            Self { measure, ..self.clone() }.value(view, &super::References::default())
        };
        Tensor2(std::array::from_fn(|place| component(place / 3, place % 3)))
    }
}

/// Frobenius norm of the derivative of a measure by the stress; `None` without a level, and where the measure has no derivative.
fn gradient_norm(measure: StressMeasure, stress: &Tensor2, level: f64) -> Option<f64> {
    let step = DIFFERENCE * level;
    if step <= 0.0 {
        return None;
    }
    let slope = |place: usize| {
        let moved = |by: f64| {
            let mut moved = *stress;
            moved.0[place] += by;
            measure.of(&moved)
        };
        (moved(step) - moved(-step)) / (2.0 * step)
    };
    let norm = (0..9).map(|place| slope(place).powi(2)).sum::<f64>().sqrt();
    norm.is_finite().then_some(norm)
}

#[cfg(test)]
mod tests {
    use super::super::Quantity;
    use super::super::tests::{point, report, seen};
    use super::*;
    use crate::observer::StepAccuracy;

    /// A body that is unloaded from 400 to 50 kPa, and then pulled, keeps the error that it has got: it was taken relative to the pressure
    /// of the step, which said an eighth of it, and nothing under tension.
    #[test]
    fn errors_do_not_shrink_with_the_load() {
        let quantity = Quantity::Field(FieldProbe::mean(Measure::Stress(StressMeasure::Component(1, 1))));
        let probes = [Probe { name: "stress".into(), quantity }];
        let estimate = ErrorEstimate { points: 4, rms: 3e-3, largest: 5e-3, of_mean: 2e-3 };
        let accuracy = StepAccuracy { strain_per_step: 1e-5, estimate: Some(estimate), balance: None };
        let mut levels = LargestLevels::default();
        for (pressure, expected) in [(2e5, 400.0), (4e5, 800.0), (5e4, 800.0), (-1e3, 800.0), (0.0, 800.0)] {
            let report = StepReport { accuracy, ..report(1, 0, 1.0) };
            let errors = seen(&[point(1.0, [[-pressure, 0.0], [0.0, -pressure]], 1.0)], 0.0, |view| {
                levels.errors(&probes, &report, view)
            });
            assert!((errors[0].unwrap() / expected - 1.0).abs() < 1e-6, "{pressure}: {errors:?}");
        }
        let mut unknown = LargestLevels::default();
        seen(&[point(1.0, [[-1e5, 0.0], [0.0, -1e5]], 1.0)], 0.0, |view| {
            assert!(unknown.errors(&probes, &report(1, 0, 1.0), view).is_empty());
        });
    }

    #[test]
    fn gradients_of_linear_and_quotient_measures_are_known() {
        let stress = Tensor2::from_plane([[-1e5, 0.0], [0.0, -3e5]]);
        let norm = |measure| gradient_norm(measure, &stress, 2e5).unwrap();
        assert!((norm(StressMeasure::Component(0, 1)) - 1.0).abs() < 1e-8);
        assert!((norm(StressMeasure::Deviator) - 2f64.sqrt()).abs() < 1e-8);
        // d(yy/xx) = (d yy - r d xx) / xx with r = 3.
        assert!((norm(StressMeasure::Ratio) - 10f64.sqrt() / 1e5).abs() < 1e-11);
        assert_eq!(gradient_norm(StressMeasure::Ratio, &Tensor2::ZERO, 0.0), None);
    }
}
