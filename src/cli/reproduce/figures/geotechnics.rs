//! What the geotechnical figures share: the friction angle of the cell, and the bounds that follow from it.

use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

/// The element test that the bounds need.
pub(super) fn strength_run(size: Size) -> Run {
    Run::new("strength", "scenes/geotechnics/element-biaxial.toml", Command::Element(None), size)
}

/// Sines of the friction angle of the cell: at the peak, and at large strain, the mean from 10 to 20 %.
pub(super) struct Strength {
    /// At the peak.
    pub(super) peak: f64,
    /// At large strain.
    pub(super) late: f64,
}

/// The strength of the cell.
///
/// # Errors
/// The rows cannot be read.
pub(super) fn strength(run: &Finished) -> Result<Strength, ReproduceError> {
    let curve = mobilised(run)?;
    Ok(Strength { peak: peak(&curve)?[1], late: mean_between(&curve, 0.1, 0.2) })
}

/// Sine of the mobilised friction angle over the compression.
///
/// # Errors
/// The rows cannot be read.
pub(super) fn mobilised(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table()?;
    let ratio =
        table.column("sigma_yy")?.into_iter().zip(table.column("sigma_xx")?).map(|(yy, xx)| liu_ratio(yy / xx));
    Ok(table.column("F_yy")?.iter().zip(ratio).map(|(stretch, sine)| [1.0 - stretch, sine]).collect())
}

/// Rankine's coefficient of passive pressure; its inverse is the active one.
pub(super) fn passive(sine: f64) -> f64 {
    (1.0 + sine) / (1.0 - sine)
}

/// Prandtl's bearing capacity factor of the surcharge.
pub(super) fn surcharge_factor(sine: f64) -> f64 {
    let tangent = sine.asin().tan();
    (std::f64::consts::PI * tangent).exp() * passive(sine)
}

/// Pressure in a cavity over the outer one, in a ring of radii `outer` and `inner` that yields everywhere.
pub(super) fn cavity_pressure(sine: f64, outer_over_inner: f64) -> f64 {
    let k = passive(sine);
    outer_over_inner.powf((k - 1.0) / k)
}

/// A row for a bound between the strength at large strain and that at the peak.
pub(super) fn bound(
    quantity: &str,
    source: &'static str,
    strength: &Strength,
    law: impl Fn(f64) -> f64,
    ours: f64,
    share: f64,
) -> Comparison {
    let (one, other) = (law(strength.late), law(strength.peak));
    let theirs = Theirs::Between(one.min(other), one.max(other));
    Comparison::new(quantity, "-", theirs, source, ours, Tolerance::Relative(share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bounds_have_their_well_known_values_at_thirty_degrees() {
        assert!((passive(0.5) - 3.0).abs() < 1e-12);
        assert!((surcharge_factor(0.5) - 18.40).abs() < 0.01);
        assert!((cavity_pressure(0.5, 8.0) - 4.0).abs() < 1e-12);
    }
}
