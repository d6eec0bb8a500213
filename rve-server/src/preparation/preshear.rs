//! Initial anisotropy: the packing is sheared by a searched amount and brought back to its target stress, so that its
//! contacts remember the shear while its stress does not.

use super::compaction::{Compaction, StepsWithoutPressure};
use super::recipe::AnisotropyTarget;
use super::stress_target::Matrix;
use crate::definition::PackingError;
use crate::homogenization::fabric::NO_MINOR_VALUE;
use crate::solver::SolverFor;
use crate::space::largest_component;
use serde::{Deserialize, Serialize};

/// Change of fabric per shear strain that is assumed before the first try. Shortening an axis turns contacts towards it.
const FIRST_RESPONSE: f64 = -2.0;

/// Responses that are believed, in magnitude: outside, the shear would run away.
const BELIEVED: [f64; 2] = [0.2, 40.0];

/// Largest component of the shear strain.
const LARGEST_SHEAR: f64 = 0.1;

/// Most tries.
const MOST_TRIES: usize = 25;

/// One try of the search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShearAttempt {
    /// Largest component of the shear strain.
    pub shear: f64,
    /// Fabric anisotropy after the stress was restored.
    pub anisotropy: f64,
}

/// Searches the shear strain. `prepared` makes a compaction in the state before the shear; the returned compaction is at its target
/// stress and has the anisotropy requested.
///
/// # Errors
/// [`PackingError::Content`] if the anisotropy is not reached.
pub(crate) fn presheared<'a, S: SolverFor>(
    target: &AnisotropyTarget,
    dimension: usize,
    prepared: &mut dyn FnMut() -> Result<Compaction<'a, S>, PackingError>,
) -> Result<(Compaction<'a, S>, Vec<ShearAttempt>), PackingError> {
    let wanted = axial_fabric(target, dimension);
    let mut attempts = Vec::new();
    let mut shear = [[0.0; 3]; 3];
    let mut response = FIRST_RESPONSE;
    let mut last: Option<(Matrix, Matrix)> = None;
    let mut farthest = 0.0;
    for _ in 0..MOST_TRIES {
        let mut compaction = prepared()?;
        if last.is_some() {
            compaction.strain(&shear)?;
        }
        compaction.servo(StepsWithoutPressure::Many)?;
        let fabric = compaction.fabric_deviator()?;
        let anisotropy = anisotropy_of(&fabric, dimension);
        attempts.push(ShearAttempt { shear: largest_component(&shear), anisotropy });
        let missing = combined(&wanted, -1.0, &fabric);
        farthest = largest_component(&missing);
        // The direction counts as well as the value: both principal values must be where they are wanted.
        if (anisotropy - target.value).abs() <= target.tolerance && largest_component(&missing) <= target.tolerance {
            return Ok((compaction, attempts));
        }
        if let Some((last_shear, last_fabric)) = &last {
            let (step, effect) = (combined(&shear, -1.0, last_shear), combined(&fabric, -1.0, last_fabric));
            let slope = contraction(&effect, &step) / contraction(&step, &step);
            if slope.is_finite() {
                response = -slope.abs().clamp(BELIEVED[0], BELIEVED[1]);
            }
        }
        last = Some((shear, fabric));
        shear = combined(&shear, 1.0 / response, &missing);
        let excess = largest_component(&shear) / LARGEST_SHEAR;
        if excess > 1.0 {
            shear = shear.map(|row| row.map(|value| value / excess));
        }
    }
    let reached: Vec<String> = attempts.iter().map(|attempt| format!("{:.4}", attempt.anisotropy)).collect();
    Err(PackingError::Content(format!(
        "anisotropy {} +- {} along axis {} was not reached in {MOST_TRIES} tries ({}; in the last one a component of the fabric was off by \
         {farthest:.4}); widen anisotropy.tolerance, raise anisotropy.friction or use more grains",
        target.value,
        target.tolerance,
        target.axis,
        reached.join(", ")
    )))
}

/// Fabric deviator with the requested anisotropy, most contacts along the requested axis and the other axes alike.
fn axial_fabric(target: &AnisotropyTarget, dimension: usize) -> Matrix {
    let share = 1.0 / (dimension as f64 + target.value);
    let mean = 1.0 / dimension as f64;
    let mut fabric = [[0.0; 3]; 3];
    for (i, row) in fabric.iter_mut().enumerate().take(dimension) {
        let principal = if i + 1 == target.axis as usize { (1.0 + target.value) * share } else { share };
        row[i] = principal - mean;
    }
    fabric
}

/// Major over minor principal value minus 1 of the fabric with this deviator and unit trace. Two equal minor values, which axial
/// fabrics have, are a double root of the characteristic cubic: the search needs them more accurately than it gives them.
pub(crate) fn anisotropy_of(deviator: &Matrix, dimension: usize) -> f64 {
    let mean = 1.0 / dimension as f64;
    let whole = nalgebra::DMatrix::from_fn(dimension, dimension, |i, j| {
        0.5 * (deviator[i][j] + deviator[j][i]) + if i == j { mean } else { 0.0 }
    });
    let values = whole.symmetric_eigenvalues();
    let (major, minor) = (values.max(), values.min());
    if minor <= NO_MINOR_VALUE * major { 0.0 } else { major / minor - 1.0 }
}

fn combined(a: &Matrix, scale: f64, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + scale * b[i][j]))
}

fn contraction(a: &Matrix, b: &Matrix) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wanted_fabric_has_the_wanted_anisotropy() {
        for dimension in [2, 3] {
            let target = AnisotropyTarget { value: 0.08, tolerance: 1e-3, axis: 2, friction: 0.4 };
            let fabric = axial_fabric(&target, dimension);
            let trace: f64 = (0..3).map(|i| fabric[i][i]).sum();
            assert!(trace.abs() < 1e-15 && fabric[1][1] > 0.0);
            assert!((anisotropy_of(&fabric, dimension) - 0.08).abs() < 1e-14);
        }
    }
}
