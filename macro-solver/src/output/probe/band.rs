//! Width and inclination of a shear band.
//!
//! The measure `s` at the Gauss points is fitted, in the sense of least squares weighted with the volume, by a ridge
//!
//! ```text
//! s(x) = b + a exp(-d^2 / (2 w^2)),   d = n . x - c,   n = (-sin phi, cos phi)
//! ```
//!
//! The fit needs no threshold, and unlike principal axes of the strained volume its angle has no bias where the border of the body
//! cuts a band obliquely. Angles every 5 degrees with position and width from moments give the start; Levenberg-Marquardt steps
//! in the five parameters follow. Widths below the spacing of the points cannot be resolved. A band of constant strain between sharp
//! borders is reported with 0.84 of its width, because the nearest Gaussian is that much narrower.
//!
//! Two bands that cross make the misfit one of several minima: the moments see both at once. The steps therefore start from the best of
//! several positions across each direction too, and the least misfit that they lead to counts. The axis of a band lies within the body.

use super::field::Part;
use super::measure::Measure;
use super::reference::References;
use crate::observer::FieldsView;
use nalgebra::{SMatrix, SVector};

/// A property of the band that a measure shows.
#[derive(Clone, Debug, PartialEq)]
pub struct BandProbe {
    /// What shows the band, usually a shear strain.
    pub measure: Measure,
    /// Points that take part.
    pub part: Part,
    /// Stage, from 0, from whose start deformation is counted; without one from the start of the run.
    pub reference: Option<usize>,
    /// The two axes of the plane in which the band is a line, 0 = x, 1 = y, 2 = z.
    pub plane: [usize; 2],
    /// What is reported.
    pub property: BandProperty,
}

/// What is reported of a band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandProperty {
    /// Full width at half of the height above the surroundings, m, `2 sqrt(2 ln 2) w`.
    Width,
    /// Angle from the first to the second axis of the plane, degrees, above -90 and at most 90: 0 lies along the first axis.
    Inclination,
    /// Share of the variance of the measure that the ridge explains, at most 1.
    Quality,
}

impl BandProperty {
    /// Unit of the value; `-` if it has none.
    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Width => "m",
            Self::Inclination => "degrees",
            Self::Quality => "-",
        }
    }
}

impl BandProbe {
    /// Value after an accepted step; NaN where no ridge fits, for instance to a uniform field.
    pub fn value(&self, view: &FieldsView<'_>, references: &References) -> f64 {
        let origin = references.origin(self.reference);
        let samples: Vec<Sample> = self
            .part
            .of(view.points)
            .map(|(number, point)| Sample {
                place: self.plane.map(|axis| point.position[axis]),
                weight: point.volume,
                value: self.measure.at(number, point, origin),
            })
            .collect();
        let Some(ridge) = Ridge::fitted(&samples) else { return f64::NAN };
        match self.property {
            BandProperty::Width => ridge.width,
            BandProperty::Inclination => ridge.inclination,
            BandProperty::Quality => ridge.quality,
        }
    }
}

/// A band across layers whose direction is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerBand {
    /// Full width at half of the height above the surroundings, m, as [`BandProperty::Width`].
    pub width: f64,
    /// Coordinate of its middle, m.
    pub position: f64,
    /// Share of the variance that the band explains, at most 1.
    pub quality: f64,
}

impl LayerBand {
    /// The same fit as that of a [`BandProbe`], to values along a line: coordinate (m), weight and value of each layer. `None` where no
    /// ridge fits.
    pub fn across(layers: &[[f64; 3]]) -> Option<Self> {
        let sample = |&[coordinate, weight, value]: &[f64; 3]| Sample { place: [0.0, coordinate], weight, value };
        let samples: Vec<Sample> = layers.iter().map(sample).collect();
        let (scaled, length) = scaled(&samples)?;
        // At angle 0 the misfit does not change with the angle, which therefore stays.
        let fit = improved(&scaled, guess(&scaled, 0.0)?, MOST_STEPS);
        let middle = samples.iter().map(|one| one.weight * one.place[1]).sum::<f64>()
            / samples.iter().map(|one| one.weight).sum::<f64>();
        let position = middle + fit[1] * length;
        Ridge::of_fit(&scaled, length, &fit).map(|ridge| Self {
            width: ridge.width,
            position,
            quality: ridge.quality,
        })
    }
}

/// The measure at one place.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// m.
    place: [f64; 2],
    weight: f64,
    value: f64,
}

/// The fitted ridge in the units of the body.
#[derive(Clone, Copy, Debug)]
struct Ridge {
    /// Full width at half height, m.
    width: f64,
    /// Degrees.
    inclination: f64,
    quality: f64,
}

/// Directions that are tried for the start.
const DIRECTIONS: usize = 36;

/// Positions across each direction that are tried for the start, and the width of a band there over the extent of the body.
const POSITIONS: usize = 12;
const FIRST_WIDTH: f64 = 0.1;

/// How many of those, the best ones, the fit starts from in addition to the moments.
const STARTS: usize = 4;

/// Steps from each start, which tell the minima apart.
const FIRST_STEPS: usize = 10;

/// Most steps of the fit.
const MOST_STEPS: usize = 200;

/// Parameters: angle, position, width, height, level; lengths over that of the body, values over their spread.
type Parameters = SVector<f64, 5>;

impl Ridge {
    fn fitted(samples: &[Sample]) -> Option<Self> {
        let (scaled, length) = scaled(samples)?;
        let angle = |number: usize| std::f64::consts::PI * number as f64 / DIRECTIONS as f64;
        let least = |guesses: &mut dyn Iterator<Item = Parameters>| {
            let weighed = guesses.map(|guess| (misfit(&scaled, &guess), guess));
            weighed.min_by(|one, other| one.0.total_cmp(&other.0))
        };
        let from_moments = least(&mut (0..DIRECTIONS).filter_map(|number| guess(&scaled, angle(number))))?;
        let mut across: Vec<(f64, Parameters)> = (0..DIRECTIONS)
            .filter_map(|number| {
                let ridges = (1..POSITIONS).filter_map(|place| {
                    ridge_at(&scaled, angle(number), 2.0 * place as f64 / POSITIONS as f64 - 1.0, FIRST_WIDTH)
                });
                least(&mut ridges.filter(|ridge| ridge[3] > 0.0))
            })
            .collect();
        across.sort_by(|one, other| one.0.total_cmp(&other.0));
        let starts = std::iter::once(from_moments).chain(across.into_iter().take(STARTS));
        let (_, best) = least(&mut starts.map(|(_, start)| improved(&scaled, start, FIRST_STEPS)))?;
        Self::of_fit(&scaled, length, &improved(&scaled, best, MOST_STEPS))
    }

    fn of_fit(scaled: &[Sample], length: f64, fit: &Parameters) -> Option<Self> {
        let [angle, centre, width, height, _] = fit.data.0[0];
        // The values have unit variance, and the weights the sum 1.
        let quality = 1.0 - misfit(scaled, fit);
        let places = || scaled.iter().map(|sample| -angle.sin() * sample.place[0] + angle.cos() * sample.place[1]);
        let is_inside = places().any(|place| place <= centre) && places().any(|place| place >= centre);
        let is_band = width.abs() < 1.0 && height > 0.0 && quality > 0.0 && is_inside;
        let turns = angle.to_degrees().rem_euclid(180.0);
        is_band.then(|| Self {
            width: 2.0 * (2.0 * 2_f64.ln()).sqrt() * width.abs() * length,
            inclination: if turns > 90.0 { turns - 180.0 } else { turns },
            quality,
        })
    }
}

/// Samples about their mean, with the extent of the body and the spread of the values as units, and that extent, m.
fn scaled(samples: &[Sample]) -> Option<(Vec<Sample>, f64)> {
    let total: f64 = samples.iter().map(|sample| sample.weight).sum();
    let mean = |value: &dyn Fn(&Sample) -> f64| {
        samples.iter().map(|sample| sample.weight * value(sample)).sum::<f64>() / total
    };
    let centre = [0, 1].map(|axis| mean(&|sample| sample.place[axis]));
    let level = mean(&|sample| sample.value);
    let spread = mean(&|sample| (sample.value - level).powi(2)).sqrt();
    let offset = |sample: &Sample| [0, 1].map(|axis: usize| sample.place[axis] - centre[axis]);
    let length = samples.iter().map(|sample| offset(sample)[0].hypot(offset(sample)[1])).fold(0.0, f64::max);
    // Rounding alone is no band.
    if !(spread > 1e-9 * level.abs() && spread > 0.0 && length > 0.0 && spread.is_finite()) {
        return None;
    }
    let scale = |sample: &Sample| Sample {
        place: offset(sample).map(|distance| distance / length),
        weight: sample.weight / total,
        value: (sample.value - level) / spread,
    };
    Some((samples.iter().map(scale).collect(), length))
}

/// A ridge in a given direction: position and width from the moments of what lies above the mean, heights by least squares.
fn guess(samples: &[Sample], angle: f64) -> Option<Parameters> {
    let normal = [-angle.sin(), angle.cos()];
    let across = |sample: &Sample| normal[0] * sample.place[0] + normal[1] * sample.place[1];
    let excess = |sample: &Sample| sample.weight * sample.value.max(0.0).powi(2);
    let total: f64 = samples.iter().map(excess).sum();
    let centre = samples.iter().map(|sample| excess(sample) * across(sample)).sum::<f64>() / total;
    let square = samples.iter().map(|sample| excess(sample) * (across(sample) - centre).powi(2)).sum::<f64>() / total;
    ridge_at(samples, angle, centre, square.sqrt())
}

/// A ridge of given direction, position and width: heights by least squares of value = level + height g, with the mean value 0 and
/// weights of the sum 1.
fn ridge_at(samples: &[Sample], angle: f64, centre: f64, width: f64) -> Option<Parameters> {
    let normal = [-angle.sin(), angle.cos()];
    let across = |sample: &Sample| normal[0] * sample.place[0] + normal[1] * sample.place[1];
    let shape = |sample: &Sample| (-0.5 * ((across(sample) - centre) / width).powi(2)).exp();
    let mean: f64 = samples.iter().map(|sample| sample.weight * shape(sample)).sum();
    let variance: f64 = samples.iter().map(|sample| sample.weight * (shape(sample) - mean).powi(2)).sum();
    let covariance: f64 = samples.iter().map(|sample| sample.weight * shape(sample) * sample.value).sum();
    let height = covariance / variance;
    let parameters = Parameters::new(angle, centre, width, height, -height * mean);
    parameters.iter().all(|value| value.is_finite()).then_some(parameters)
}

/// Model and its derivatives by the parameters.
fn ridge(place: [f64; 2], parameters: &Parameters) -> (f64, Parameters) {
    let [angle, centre, width, height, level] = parameters.data.0[0];
    let (sin, cos) = angle.sin_cos();
    let across = -sin * place[0] + cos * place[1] - centre;
    let along = cos * place[0] + sin * place[1];
    let shape = (-0.5 * (across / width).powi(2)).exp();
    let slope = height * shape * across / (width * width);
    (level + height * shape, Parameters::new(slope * along, slope, slope * across / width, shape, 1.0))
}

/// Weighted mean of the squared residuals.
fn misfit(samples: &[Sample], parameters: &Parameters) -> f64 {
    samples.iter().map(|sample| sample.weight * (sample.value - ridge(sample.place, parameters).0).powi(2)).sum()
}

/// Levenberg-Marquardt steps until they change nothing, at most `most_steps`.
fn improved(samples: &[Sample], start: Parameters, most_steps: usize) -> Parameters {
    let (mut best, mut least) = (start, misfit(samples, &start));
    let mut damping = 1e-3;
    for _ in 0..most_steps {
        let (mut normal, mut right) = (SMatrix::<f64, 5, 5>::zeros(), Parameters::zeros());
        for sample in samples {
            let (value, gradient) = ridge(sample.place, &best);
            normal += sample.weight * gradient * gradient.transpose();
            right += sample.weight * (sample.value - value) * gradient;
        }
        let damped = normal + SMatrix::from_diagonal(&(damping * normal.diagonal().add_scalar(1e-12)));
        let Some(step) = damped.cholesky().map(|factors| factors.solve(&right)) else { break };
        let next = best + step;
        let found = misfit(samples, &next);
        if found < least {
            let is_done = step.norm() < 1e-12 * best.norm();
            (best, least, damping) = (next, found, (0.3 * damping).max(1e-12));
            if is_done {
                break;
            }
        } else {
            damping *= 4.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of 40 x 80 mm with a band through a place off its centre.
    fn band(angle: f64, profile: impl Fn(f64) -> f64) -> Vec<Sample> {
        let (sin, cos) = angle.to_radians().sin_cos();
        let mut samples = Vec::new();
        for row in 0..80 {
            for column in 0..40 {
                let place = [1e-3 * (f64::from(column) + 0.5), 1e-3 * (f64::from(row) + 0.5)];
                let across = -sin * (place[0] - 0.018) + cos * (place[1] - 0.045);
                samples.push(Sample { place, weight: 1e-6 * (1.0 + f64::from(row % 3)), value: profile(across) });
            }
        }
        samples
    }

    #[test]
    fn a_gaussian_band_is_found_to_the_digits_of_the_fit() {
        let profile = |across: f64| 0.02 + 0.3 * (-0.5 * (across / 0.003).powi(2)).exp();
        for angle in [35.0, -55.0, 0.0, 90.0, 47.3] {
            let ridge = Ridge::fitted(&band(angle, profile)).unwrap();
            assert!((ridge.inclination - angle).abs() < 1e-6, "{ridge:?}");
            assert!((ridge.width - 0.003 * (8.0 * 2_f64.ln()).sqrt()).abs() < 1e-9, "{ridge:?}");
            assert!(ridge.quality > 1.0 - 1e-9, "{ridge:?}");
        }
    }

    /// The Gaussian nearest to a step function of width 1, in the sense of least squares on a line without end, has the full width at half
    /// height 0.8407.
    #[test]
    fn a_band_of_constant_strain_has_five_sixths_of_its_width() {
        let ridge = Ridge::fitted(&band(35.0, |across| if across.abs() < 0.005 { 0.2 } else { 0.01 })).unwrap();
        assert!((ridge.inclination - 35.0).abs() < 0.3, "{ridge:?}");
        assert!((ridge.width / 0.010 - 0.8407).abs() < 0.02, "{ridge:?}");
        assert!(ridge.quality > 0.8, "{ridge:?}");
    }

    /// Two bands that cross, the fainter one wide: moments see both and lead to neither; the stronger one is found.
    #[test]
    fn the_stronger_of_two_bands_that_cross_is_found() {
        let faint = band(-47.0, |across| 0.2 * (-0.5 * (across / 0.005).powi(2)).exp());
        let strong = band(46.0, |across| 0.3 * (-0.5 * (across / 0.004).powi(2)).exp());
        let both = strong.iter().zip(&faint).map(|(one, other)| Sample { value: one.value + other.value, ..*one });
        let ridge = Ridge::fitted(&both.collect::<Vec<_>>()).unwrap();
        assert!((ridge.inclination - 46.0).abs() < 3.0 && ridge.quality > 0.5, "{ridge:?}");
    }

    /// What grows towards a border of the body, and on beyond it, has no axis in the body.
    #[test]
    fn the_foot_of_a_ridge_outside_the_body_is_no_band() {
        let layers: Vec<[f64; 3]> = (0..12)
            .map(|layer| {
                [0.01 * f64::from(layer), 0.01, (-0.5 * ((0.01 * f64::from(layer) - 0.16) / 0.05_f64).powi(2)).exp()]
            })
            .collect();
        assert_eq!(LayerBand::across(&layers), None);
    }

    /// Twelve layers of unequal thickness with a Gaussian of growth: width and position to the digits of the fit, and no band in a uniform
    /// growth.
    #[test]
    fn a_band_across_layers_has_its_width_and_position() {
        let layers = |value: fn(f64) -> f64| -> Vec<[f64; 3]> {
            let coordinate = |layer: i32| 0.01 * f64::from(layer) + 0.001 * f64::from(layer % 2);
            (0..12).map(|layer| [coordinate(layer), 0.01, value(coordinate(layer))]).collect()
        };
        let band = LayerBand::across(&layers(|y| 0.01 + 0.2 * (-0.5 * ((y - 0.083) / 0.012).powi(2)).exp())).unwrap();
        assert!((band.width - 0.012 * (8.0 * 2_f64.ln()).sqrt()).abs() < 1e-9, "{band:?}");
        assert!((band.position - 0.083).abs() < 1e-9 && band.quality > 1.0 - 1e-9, "{band:?}");
        assert!(LayerBand::across(&layers(|_| 0.1)).is_none() && LayerBand::across(&[]).is_none());
    }

    #[test]
    fn a_uniform_field_has_no_band() {
        assert!(Ridge::fitted(&band(20.0, |_| 0.1)).is_none());
        assert!(Ridge::fitted(&[]).is_none());
    }
}
