//! Error of a probe from the estimated error of the stresses.

use super::field::{FieldProbe, Part, Statistic};
use super::measure::Measure;
use super::stress_measure::StressMeasure;
use crate::material::error_estimate::ErrorEstimate;
use crate::observer::FieldsView;
use protocol::Tensor2;

/// Relative size of the finite differences.
const DIFFERENCE: f64 = 1e-6;

impl FieldProbe {
    /// Whether the value is a mean of stresses or a function of one.
    pub(super) fn has_error(&self) -> bool {
        matches!(self.measure, Measure::Stress(_)) && self.statistic == Statistic::Mean
    }

    /// Estimated error of the value, in its unit; `None` for what is no mean of stresses. A function of the stress changes by at most
    /// the norm of its gradient times the error of the stress.
    pub(super) fn error(&self, view: &FieldsView<'_>, estimate: &ErrorEstimate) -> Option<f64> {
        let Measure::Stress(measure) = self.measure else { return None };
        if self.statistic != Statistic::Mean {
            return None;
        }
        let component = |row, column| {
            let measure = Measure::Stress(StressMeasure::Component(row, column));
            Self { measure, ..self.clone() }.value(view, &super::References::default())
        };
        let stress = Tensor2(std::array::from_fn(|place| component(place / 3, place % 3)));
        let axes = view.mesh.dimension.count();
        let pressure = StressMeasure::Pressure(axes).of(&stress);
        let relative = if self.part == Part::Body { estimate.of_mean } else { estimate.rms };
        Some(gradient_norm(measure, &stress, pressure)? * relative * pressure)
    }
}

/// Frobenius norm of the derivative of a measure by the stress; `None` at a stress without pressure.
fn gradient_norm(measure: StressMeasure, stress: &Tensor2, pressure: f64) -> Option<f64> {
    let step = DIFFERENCE * pressure;
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
    Some((0..9).map(|place| slope(place).powi(2)).sum::<f64>().sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

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
