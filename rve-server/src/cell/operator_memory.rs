//! Averages and calibrations of tangent operators, as part of the state of a cell.

use protocol::Tensor4;
use serde::{Deserialize, Serialize};

/// Factors of UCKO and UCKO-2DOF.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The factor of both stiffnesses, UCKO; 0 if the consistent operator gives no positive one.
    pub single: f64,
    /// The factors of `k_n` and of `k_t`, UCKO-2DOF; 0 if the consistent operator does not give two positive ones.
    pub pair: [f64; 2],
}

/// Consistent operators averaged so far and calibration factors. Belongs to a state: it is committed and
/// rolled back with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OperatorMemory {
    /// Number of operators in the sum.
    samples: u32,
    /// Their sum, all 81 components, Pa; empty before the first.
    sum: Vec<f64>,
    /// Factors of UCKO and UCKO-2DOF.
    calibration: Option<Calibration>,
}

impl OperatorMemory {
    /// Whether all numbers are usable: a sum of the right length and only finite numbers.
    pub(crate) fn is_sound(&self) -> bool {
        let length = if self.samples == 0 { 0 } else { Tensor4::ZERO.0.len() };
        let factors = self.calibration.iter().flat_map(|factors| [factors.single, factors.pair[0], factors.pair[1]]);
        self.sum.len() == length && self.sum.iter().copied().chain(factors).all(f64::is_finite)
    }

    /// Number of operators averaged.
    pub(crate) fn samples(&self) -> u32 {
        self.samples
    }

    /// Adds an operator to the average.
    pub(crate) fn add(&mut self, operator: &Tensor4) {
        self.sum.resize(operator.0.len(), 0.0);
        self.samples += 1;
        for (sum, value) in self.sum.iter_mut().zip(operator.0) {
            *sum += value;
        }
    }

    /// The average, Pa; `None` before the first sample.
    pub(crate) fn mean(&self) -> Option<Tensor4> {
        let count = f64::from(self.samples);
        let mut mean = Tensor4::ZERO;
        mean.0.iter_mut().zip(&self.sum).for_each(|(value, sum)| *value = sum / count);
        (self.samples > 0).then_some(mean)
    }

    /// The calibration, if there is one.
    pub(crate) fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref()
    }

    /// Sets the calibration.
    pub(crate) fn calibrate(&mut self, calibration: Calibration) {
        self.calibration = Some(calibration);
    }
}
