//! Corrections that are noise: the body is in balance, and what is left of the out-of-balance force is what the cells' own tolerance leaves.
//!
//! Grains come to rest within a tolerance, so that the stress of a cell is known to some share of its pressure. The smaller a step is, the
//! larger is the correction that this share brings about, over the displacements of the step, and no iteration and no smaller step takes it
//! away. It does not fall, and unlike the motion of a body that gives way it turns from increment to increment.

use crate::solve::vectors::{dot, norm};

/// Share of the least correction so far that one below it has to have.
const GAIN: f64 = 0.9;

/// Increments in a row without a gain after which corrections that turn are noise.
const FEWEST: usize = 3;

/// Largest cosine of the angle between successive corrections of which the second has turned.
const TURNED: f64 = 0.5;

/// Largest correction that can be noise, as the displacement criterion measures it.
const LARGEST: f64 = 1.0;

/// Corrections of a body whose forces are in balance, one after the other.
#[derive(Debug)]
pub(super) struct CorrectionNoise {
    least: f64,
    without_gain: usize,
    has_turned: bool,
    last: Vec<f64>,
}

impl CorrectionNoise {
    /// None so far.
    pub(super) fn new() -> Self {
        Self { least: f64::INFINITY, without_gain: 0, has_turned: false, last: Vec::new() }
    }

    /// Takes the next correction and its size, as the displacement criterion measures it; whether they are noise by now.
    pub(super) fn is_noise(&mut self, correction: &[f64], size: f64) -> bool {
        if size < GAIN * self.least {
            (self.least, self.without_gain, self.has_turned) = (size, 0, false);
        } else {
            self.without_gain += 1;
            self.has_turned |= dot(&self.last, correction) <= TURNED * norm(&self.last) * norm(correction);
        }
        self.last = correction.to_vec();
        self.without_gain >= FEWEST && self.has_turned && size <= LARGEST
    }
}

#[cfg(test)]
mod tests {
    use super::CorrectionNoise;

    /// Whether each of these corrections, every one with its size, ends it.
    fn noise(corrections: &[([f64; 2], f64)]) -> Vec<bool> {
        let mut noise = CorrectionNoise::new();
        corrections.iter().map(|(correction, size)| noise.is_noise(correction, *size)).collect()
    }

    #[test]
    fn corrections_that_neither_fall_nor_keep_their_direction_are_noise() {
        let (along, back, across) = ([1.0, 0.0], [-1.0, 0.1], [0.1, 1.0]);
        assert_eq!(noise(&[(along, 0.2), (back, 0.25), (across, 0.19), (along, 0.2)]), [false, false, false, true]);
        // A body that gives way moves on and on.
        assert_eq!(noise(&[(along, 0.2); 8]), [false; 8]);
        // Iterations that converge, however slowly.
        let falling: Vec<_> =
            (0..8).map(|number| (if number % 2 == 0 { along } else { back }, 0.89f64.powi(number))).collect();
        assert_eq!(noise(&falling), [false; 8]);
        // More than the step itself.
        assert_eq!(noise(&[(along, 1.2), (back, 1.25), (across, 1.3), (along, 1.1)]), [false; 4]);
    }
}
