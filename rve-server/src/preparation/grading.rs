//! Grain sizes: how many grains of which radius a packing holds.
//!
//! Every grading is laid out by quantiles, not drawn at random: all seeds of one recipe have the same radii and differ in
//! the grains' places alone.

use crate::definition::PackingError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest deviation of a sieve curve that is accepted unless the recipe says otherwise, as a share of the mass.
const SIEVE_TOLERANCE: f64 = 0.02;

/// Grain sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "distribution", rename_all = "snake_case", deny_unknown_fields)]
pub enum Grading {
    /// Radii evenly spread between two values: grain k of N has the radius at the quantile (k + 1/2) / N.
    Uniform {
        /// Smallest radius, m.
        #[schemars(extend("x-unit" = "m"))]
        smallest_radius: f64,
        /// Largest radius, m.
        #[schemars(extend("x-unit" = "m"))]
        largest_radius: f64,
    },
    /// Given radii, repeated in order until there are enough.
    List {
        /// Radii, m.
        #[schemars(extend("x-unit" = "m"))]
        radii: Vec<f64>,
    },
    /// Two sizes.
    Bidisperse {
        /// Radius of the small grains, m.
        #[schemars(extend("x-unit" = "m"))]
        small_radius: f64,
        /// Radius of the large grains, m.
        #[schemars(extend("x-unit" = "m"))]
        large_radius: f64,
        /// Number of large grains over number of all grains, dimensionless.
        #[schemars(extend("x-unit" = "-"))]
        large_share: f64,
    },
    /// Number density proportional to `radius^exponent` between two radii.
    PowerLaw {
        /// Smallest radius, m.
        #[schemars(extend("x-unit" = "m"))]
        smallest_radius: f64,
        /// Largest radius, m.
        #[schemars(extend("x-unit" = "m"))]
        largest_radius: f64,
        /// Exponent of the number density, dimensionless; 0 is the uniform grading, about -3 the many small and few
        /// large grains of crushed rock.
        #[schemars(extend("x-unit" = "-"))]
        exponent: f64,
    },
    /// A sieve curve by mass; between two sieves the mass is spread evenly over the logarithm of the size.
    Sieve {
        /// Mesh sizes, m (grain diameters), ascending.
        #[schemars(extend("x-unit" = "m"))]
        sizes: Vec<f64>,
        /// Mass passing each sieve over the whole mass, ascending from 0 to 1.
        #[schemars(extend("x-unit" = "-"))]
        passing: Vec<f64>,
        /// Largest accepted difference between the curve of the grains and `passing` at a sieve.
        #[serde(default = "sieve_tolerance")]
        #[schemars(extend("x-unit" = "-"))]
        tolerance: f64,
    },
}

fn sieve_tolerance() -> f64 {
    SIEVE_TOLERANCE
}

impl Grading {
    /// Checks every key, for a packing of `number` grains.
    ///
    /// # Errors
    /// [`PackingError::Content`] naming the key and the remedy.
    pub fn validate(&self, number: usize) -> Result<(), PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        match self {
            Self::Uniform { smallest_radius, largest_radius } => check_range(*smallest_radius, *largest_radius),
            Self::PowerLaw { smallest_radius, largest_radius, exponent } => {
                if !(exponent.is_finite() && exponent.abs() <= 20.0) {
                    return refuse(format!("grading.exponent = {exponent} must lie between -20 and 20"));
                }
                check_range(*smallest_radius, *largest_radius)
            }
            Self::List { radii } => {
                if radii.is_empty() || !radii.iter().all(|radius| radius.is_finite() && *radius > 0.0) {
                    return refuse("grading.radii must hold positive numbers only, at least one".into());
                }
                Ok(())
            }
            Self::Bidisperse { small_radius, large_radius, large_share } => {
                let sound = *small_radius > 0.0 && large_radius > small_radius && large_radius.is_finite();
                if !sound {
                    return refuse(format!(
                        "grading: 0 < small_radius = {small_radius} < large_radius = {large_radius} must hold"
                    ));
                }
                if !(*large_share > 0.0 && *large_share < 1.0) {
                    return refuse(format!("grading.large_share = {large_share} must lie between 0 and 1"));
                }
                let missing = match large_grains(*large_share, number) {
                    0 => "large",
                    large if large == number => "small",
                    _ => return Ok(()),
                };
                let one = 1.0 / number as f64;
                refuse(format!(
                    "grading.large_share = {large_share} leaves no {missing} grain among {number}: with one grain of a size it is {one} or {}",
                    1.0 - one
                ))
            }
            Self::Sieve { sizes, passing, tolerance } => check_sieves(sizes, passing, *tolerance),
        }
    }

    /// The radii of `number` grains in `dimension` dimensions, m. The dimension matters where sizes are given by mass:
    /// the mass of a grain is proportional to `radius^dimension`.
    pub fn radii(&self, number: usize, dimension: u32) -> Vec<f64> {
        let quantiles = (0..number).map(|grain| (grain as f64 + 0.5) / number as f64);
        match self {
            Self::Uniform { smallest_radius, largest_radius } => {
                quantiles.map(|quantile| smallest_radius + (largest_radius - smallest_radius) * quantile).collect()
            }
            Self::List { radii } => radii.iter().copied().cycle().take(number).collect(),
            Self::Bidisperse { small_radius, large_radius, large_share } => quantiles
                .map(|quantile| if is_large(quantile, *large_share) { *large_radius } else { *small_radius })
                .collect(),
            Self::PowerLaw { smallest_radius, largest_radius, exponent } => quantiles
                .map(|quantile| power_quantile(*smallest_radius, *largest_radius, exponent + 1.0, quantile))
                .collect(),
            Self::Sieve { sizes, passing, .. } => sieve_radii(sizes, passing, f64::from(dimension), quantiles),
        }
    }

    /// Largest difference between the mass passing a sieve as asked and that of `radii`, with the accepted value;
    /// nothing for gradings that are not sieve curves.
    pub fn sieve_deviation(&self, radii: &[f64], dimension: u32) -> Option<(f64, f64)> {
        let Self::Sieve { sizes, passing, tolerance } = self else { return None };
        let mass = |radius: &f64| radius.powi(dimension as i32);
        let whole: f64 = radii.iter().map(mass).sum();
        let deviation = sizes.iter().zip(passing).map(|(size, requested)| {
            let passed: f64 = radii.iter().filter(|radius| 2.0 * **radius < *size).map(mass).sum();
            (passed / whole - requested).abs()
        });
        Some((deviation.fold(0.0, f64::max), *tolerance))
    }
}

/// Whether the grain at a quantile is one of the large ones of two sizes.
fn is_large(quantile: f64, large_share: f64) -> bool {
    quantile >= 1.0 - large_share
}

/// How many grains of two sizes are large.
fn large_grains(large_share: f64, number: usize) -> usize {
    (0..number).filter(|grain| is_large((*grain as f64 + 0.5) / number as f64, large_share)).count()
}

fn check_range(smallest: f64, largest: f64) -> Result<(), PackingError> {
    if smallest > 0.0 && largest >= smallest && largest.is_finite() {
        return Ok(());
    }
    Err(PackingError::Content(format!(
        "grading: 0 < smallest_radius = {smallest} <= largest_radius = {largest} must hold"
    )))
}

fn check_sieves(sizes: &[f64], passing: &[f64], tolerance: f64) -> Result<(), PackingError> {
    let refuse = |reason: &str| Err(PackingError::Content(reason.into()));
    if sizes.len() < 2 || sizes.len() != passing.len() {
        return refuse("grading: sizes and passing need the same number of entries, at least two");
    }
    if !(sizes[0] > 0.0 && sizes.windows(2).all(|pair| pair[1] > pair[0]) && sizes[sizes.len() - 1].is_finite()) {
        return refuse("grading.sizes must be positive and ascending, m");
    }
    if !passing.windows(2).all(|pair| pair[1] >= pair[0]) || passing[0] != 0.0 || passing[passing.len() - 1] != 1.0 {
        return refuse("grading.passing must ascend from 0 (finest sieve) to 1 (coarsest)");
    }
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return refuse("grading.tolerance must be a positive share of the mass");
    }
    Ok(())
}

/// Radius at a quantile of a number density proportional to `radius^(power - 1)`.
fn power_quantile(smallest: f64, largest: f64, power: f64, quantile: f64) -> f64 {
    if power.abs() < 1e-12 {
        return smallest * (largest / smallest).powf(quantile);
    }
    // Relative to the largest radius, so that no power overflows.
    let low = (smallest / largest).powf(power);
    let radius = largest * (low + quantile * (1.0 - low)).powf(1.0 / power);
    radius.clamp(smallest, largest)
}

/// Radii whose mass curve is the sieve curve. Mass spread evenly over ln(size) in a class means a number density
/// proportional to `size^(-dimension - 1)` there.
fn sieve_radii(sizes: &[f64], passing: &[f64], dimension: f64, quantiles: impl Iterator<Item = f64>) -> Vec<f64> {
    let numbers: Vec<f64> = sizes
        .windows(2)
        .zip(passing.windows(2))
        .map(|(size, mass)| {
            let per_mass =
                (size[0].powf(-dimension) - size[1].powf(-dimension)) / (dimension * (size[1] / size[0]).ln());
            (mass[1] - mass[0]) * per_mass
        })
        .collect();
    let whole: f64 = numbers.iter().sum();
    quantiles
        .map(|quantile| {
            let mut left = quantile * whole;
            let mut class = 0;
            while class + 1 < numbers.len() && left >= numbers[class] {
                left -= numbers[class];
                class += 1;
            }
            let share = if numbers[class] > 0.0 { (left / numbers[class]).clamp(0.0, 1.0) } else { 0.0 };
            0.5 * power_quantile(sizes[class], sizes[class + 1], -dimension, share)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(grading: &Grading) -> String {
        grading.validate(100).unwrap_err().to_string()
    }

    #[test]
    fn two_sizes_come_in_their_shares() {
        let grading = Grading::Bidisperse { small_radius: 1.0, large_radius: 1.4, large_share: 0.25 };
        grading.validate(1000).unwrap();
        let radii = grading.radii(1000, 2);
        assert_eq!(radii.iter().filter(|radius| **radius == 1.4).count(), 250);
    }

    /// A share so small, or so large, that one of the sizes is missing.
    #[test]
    fn two_sizes_are_refused_where_one_has_no_grain() {
        let share = |large_share| Grading::Bidisperse { small_radius: 1.0, large_radius: 1.4, large_share };
        let refused = reason(&share(0.004));
        assert!(
            refused.contains("leaves no large grain among 100") && refused.contains("it is 0.01 or 0.99"),
            "{refused}"
        );
        assert!(reason(&share(0.996)).contains("leaves no small grain among 100"));
        for sound in [0.01, 0.99] {
            share(sound).validate(100).unwrap();
        }
        share(0.004).validate(1000).unwrap();
    }

    /// Mean of a power of the radius against its integral.
    #[test]
    fn power_law_has_the_moments_of_its_density() {
        for exponent in [-3.2, -1.0, 0.0, 1.05] {
            let grading = Grading::PowerLaw { smallest_radius: 0.5, largest_radius: 2.0, exponent };
            let radii = grading.radii(20_000, 3);
            let mean_cube = radii.iter().map(|radius| radius.powi(3)).sum::<f64>() / radii.len() as f64;
            let integral = |power: f64| {
                if power.abs() < 1e-9 { 4f64.ln() } else { (2f64.powf(power) - 0.5f64.powf(power)) / power }
            };
            let expected = integral(exponent + 4.0) / integral(exponent + 1.0);
            assert!((mean_cube / expected - 1.0).abs() < 1e-6, "{exponent}: {mean_cube} against {expected}");
        }
        let flat = Grading::PowerLaw { smallest_radius: 0.5, largest_radius: 2.0, exponent: 0.0 }.radii(7, 2);
        let uniform = Grading::Uniform { smallest_radius: 0.5, largest_radius: 2.0 }.radii(7, 2);
        assert!(flat.iter().zip(&uniform).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn sieve_curve_is_met_by_mass_in_both_dimensions() {
        let grading = Grading::Sieve {
            sizes: vec![1e-4, 2e-4, 3e-4, 6e-4],
            passing: vec![0.0, 0.2, 0.7, 1.0],
            tolerance: SIEVE_TOLERANCE,
        };
        grading.validate(1000).unwrap();
        for (dimension, number, allowed) in [(2, 4000, 2e-3), (3, 20_000, 2e-3), (2, 400, SIEVE_TOLERANCE)] {
            let radii = grading.radii(number, dimension);
            assert!(radii.is_sorted() && radii[0] >= 0.5e-4 && radii[number - 1] <= 3e-4);
            let (deviation, _) = grading.sieve_deviation(&radii, dimension).unwrap();
            assert!(deviation < allowed, "{dimension}D, {number} grains: {deviation}");
        }
        // Ten grains cannot follow such a curve, and that is seen.
        let few = grading.radii(10, 3);
        assert!(grading.sieve_deviation(&few, 3).unwrap().0 > SIEVE_TOLERANCE);
    }

    #[test]
    fn an_empty_class_holds_no_grain() {
        let (sizes, passing) = (vec![1.0, 2.0, 3.0, 4.0], vec![0.0, 0.5, 0.5, 1.0]);
        let radii = Grading::Sieve { sizes, passing, tolerance: 0.1 }.radii(500, 2);
        assert!(radii.iter().all(|radius| *radius <= 1.0 || *radius >= 1.5));
    }

    #[test]
    fn defects_name_their_key() {
        let sieve = |sizes: &[f64], passing: &[f64]| {
            reason(&Grading::Sieve { sizes: sizes.into(), passing: passing.into(), tolerance: 0.1 })
        };
        assert!(sieve(&[1.0], &[1.0]).contains("at least two"));
        assert!(sieve(&[2.0, 1.0], &[0.0, 1.0]).contains("grading.sizes"));
        assert!(sieve(&[1.0, 2.0], &[0.1, 1.0]).contains("grading.passing"));
        let two = Grading::Bidisperse { small_radius: 1.0, large_radius: 1.4, large_share: 1.5 };
        assert!(reason(&two).contains("grading.large_share"));
        let power = Grading::PowerLaw { smallest_radius: 1.0, largest_radius: 0.5, exponent: 0.0 };
        assert!(reason(&power).contains("smallest_radius"));
    }
}
