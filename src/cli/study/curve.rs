//! One path of one packing: what is measured in its rows, and the values that a study takes from them.

use macro_solver::output::{Axes, Rank, StressMeasure};
use protocol::Tensor2;
use rve_server::programs::rve_test::ElementRow;
use scene_reader::{ChosenRows, PathStrain, RowMeasure};

/// The rows of a path.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Path {
    /// Strain of every row, as the test defines it.
    pub(super) strain: Vec<f64>,
    /// For every measure its value in every row.
    pub(super) measures: Vec<Vec<f64>>,
    /// For every measure the weights of its rows in a mean; empty for equal ones. A ratio is weighted with its denominator: single rows
    /// whose denominator is near zero would decide the mean of ratios, and do not decide the ratio of means.
    pub(super) weights: Vec<Vec<f64>>,
    /// Why the path ended early.
    pub(super) stopped: Option<String>,
    /// Rows with a shortcut or a degradation: what it was, and in how many rows.
    pub(super) fallbacks: Vec<(&'static str, u64)>,
}

/// What is kept of a row until the path has ended.
#[derive(Clone, Copy, Debug)]
struct Kept {
    /// Logarithmic axial compression and volume strain.
    axial: f64,
    volume: f64,
    stress_ratio: f64,
}

/// Collects the rows of a path.
#[derive(Debug)]
pub(super) struct Collector<'a> {
    measures: &'a [RowMeasure],
    strain: PathStrain,
    path: Path,
    kept: Vec<Kept>,
}

impl<'a> Collector<'a> {
    /// For these measures.
    pub(super) fn new(measures: &'a [RowMeasure], strain: PathStrain) -> Self {
        let path = Path {
            measures: vec![Vec::new(); measures.len()],
            weights: vec![Vec::new(); measures.len()],
            ..Path::default()
        };
        Self { measures, strain, path, kept: Vec::new() }
    }

    /// Adds a row.
    pub(super) fn add(&mut self, row: &ElementRow) {
        let f = &row.deformation;
        let stretch = match self.strain {
            PathStrain::CompressionX | PathStrain::ShearXy => f[0][0],
            PathStrain::CompressionY => f[1][1],
            PathStrain::CompressionZ => f[2][2],
        };
        let strain = if self.strain == PathStrain::ShearXy { f[0][1] } else { 1.0 - stretch };
        self.path.strain.push(strain);
        let volume = determinant(f);
        let stress = Tensor2(std::array::from_fn(|place| row.stress[place / 3][place % 3]));
        let axes = if row.dimension == 2 { Axes::Plane } else { Axes::Space };
        let stress_ratio = StressMeasure::PrincipalRatio(Rank::Major, Rank::Minor, axes).of(&stress);
        self.kept.push(Kept { axial: -stretch.ln(), volume: volume.ln(), stress_ratio });
        for (measure, values) in self.measures.iter().zip(&mut self.path.measures) {
            values.push(match measure {
                RowMeasure::StressRatio => stress_ratio,
                RowMeasure::MobilisedSine => (stress_ratio - 1.0) / (stress_ratio + 1.0),
                RowMeasure::MeanPressure => StressMeasure::Pressure(row.dimension as usize).of(&stress),
                RowMeasure::VoidRatio => row.void_ratio,
                RowMeasure::CoordinationNumber => row.coordination_number,
                RowMeasure::CoordinationNumberNoRattlers => row.coordination_number_no_rattlers,
                RowMeasure::FabricAnisotropy => row.fabric_anisotropy,
                RowMeasure::SlidingFraction => row.sliding_fraction,
                RowMeasure::VolumeStrain => volume - 1.0,
                // Slopes, which need the rows that follow.
                RowMeasure::Dilatancy | RowMeasure::StressOverDilatancy => f64::NAN,
            });
        }
    }

    /// The path, with slopes over ranges of axial strain of this half width.
    pub(super) fn finish(mut self, half_width: f64, stopped: Option<String>) -> Path {
        let columns = self.path.measures.iter_mut().zip(&mut self.path.weights);
        for (measure, (values, weights)) in self.measures.iter().zip(columns) {
            if measure.needs_compression() {
                for (row, value) in values.iter_mut().enumerate() {
                    let (dilatancy, stress_ratio) = slope_at(&self.kept, row, half_width);
                    *value = match measure {
                        RowMeasure::Dilatancy => dilatancy,
                        _ => {
                            weights.push(dilatancy);
                            stress_ratio / dilatancy
                        }
                    };
                }
            }
        }
        self.path.stopped = stopped;
        self.path
    }
}

fn determinant(f: &[[f64; 3]; 3]) -> f64 {
    f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
        + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0])
}

/// `1 + d(volume strain) / d(axial compression)` by least squares over the rows near one of them, and their mean stress ratio. NaN with
/// less than three rows.
fn slope_at(kept: &[Kept], row: usize, half_width: f64) -> (f64, f64) {
    let near: Vec<&Kept> = kept.iter().filter(|other| (other.axial - kept[row].axial).abs() <= half_width).collect();
    let mean = |value: fn(&Kept) -> f64| near.iter().map(|kept| value(kept)).sum::<f64>() / near.len() as f64;
    let (axial, volume) = (mean(|kept| kept.axial), mean(|kept| kept.volume));
    let spread: f64 = near.iter().map(|kept| (kept.axial - axial).powi(2)).sum();
    if near.len() < 3 || spread <= 0.0 {
        return (f64::NAN, f64::NAN);
    }
    let product: f64 = near.iter().map(|kept| (kept.axial - axial) * (kept.volume - volume)).sum();
    (1.0 + product / spread, mean(|kept| kept.stress_ratio))
}

/// Strains that differ by less are the same: increments are shares of a segment.
const SAME_STRAIN: f64 = 1e-9;

/// The value that `rows` chooses from a path.
///
/// # Errors
/// Why there is none: the path stopped early, does not reach the strain, or the measure has no number there.
pub(super) fn value(path: &Path, measure: usize, rows: ChosenRows) -> Result<f64, String> {
    let values = &path.measures[measure];
    let reached = path.strain.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let needs = |strain: f64| match &path.stopped {
        _ if reached >= strain - SAME_STRAIN => Ok(()),
        Some(reason) => Err(format!("stopped at a strain of {reached:.4}: {reason}")),
        None => {
            Err(format!("the largest strain of the path is {reached:.4} (extension counts negative), below {strain}"))
        }
    };
    let window = |from: f64, to: Option<f64>| match (to, &path.stopped) {
        (Some(to), _) => needs(to).map(|()| (from, to)),
        (None, Some(reason)) => Err(format!("stopped at a strain of {reached:.4}: {reason}")),
        (None, None) => Ok((from, f64::INFINITY)),
    };
    let rows_between = |(from, to): (f64, f64)| -> Vec<usize> {
        let inside = |row: &usize| (from - SAME_STRAIN..=to + SAME_STRAIN).contains(&path.strain[*row]);
        (0..path.strain.len()).filter(inside).collect()
    };
    let between = |range: (f64, f64)| rows_between(range).into_iter().map(|row| values[row]);
    let found = match rows {
        ChosenRows::Largest(from, to) => between(window(from, to)?).fold(f64::NEG_INFINITY, f64::max),
        ChosenRows::Smallest(from, to) => between(window(from, to)?).fold(f64::INFINITY, f64::min),
        ChosenRows::StrainOfLargest(from, to) => {
            // Backwards, so that the first of equal rows counts.
            let rows = rows_between(window(from, to)?).into_iter().rev().filter(|row| values[*row].is_finite());
            rows.max_by(|one, other| values[*one].total_cmp(&values[*other])).map_or(f64::NAN, |row| path.strain[row])
        }
        ChosenRows::Mean(from, to) => {
            let weight = |row: usize| path.weights[measure].get(row).copied().unwrap_or(1.0);
            let (mut sum, mut weights) = (0.0, 0.0);
            for row in rows_between(window(from, to)?) {
                sum += weight(row) * values[row];
                weights += weight(row);
            }
            sum / weights
        }
        ChosenRows::At(at) => {
            needs(at)?;
            at_strain(&path.strain, values, at)
        }
    };
    if found.is_finite() { Ok(found) } else { Err("there is no row with a number in the range of strain".to_owned()) }
}

/// The value where the path first passes a strain; NaN if it never does.
fn at_strain(strain: &[f64], values: &[f64], at: f64) -> f64 {
    if let Some(row) = strain.iter().position(|strain| (strain - at).abs() <= SAME_STRAIN) {
        return values[row];
    }
    let passes = |row: &usize| (strain[*row] - at) * (strain[row + 1] - at) <= 0.0;
    match (0..strain.len().saturating_sub(1)).find(passes) {
        Some(row) => {
            let share = (at - strain[row]) / (strain[row + 1] - strain[row]);
            values[row] + share * (values[row + 1] - values[row])
        }
        None => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(strain: &[f64], values: &[f64], stopped: Option<&str>) -> Path {
        Path {
            strain: strain.to_vec(),
            measures: vec![values.to_vec()],
            weights: vec![Vec::new()],
            stopped: stopped.map(str::to_owned),
            fallbacks: Vec::new(),
        }
    }

    #[test]
    fn values_are_taken_from_the_chosen_rows() {
        let whole = path(&[0.0, 0.1, 0.2, 0.3], &[1.0, 3.0, 2.0, 1.0], None);
        let take = |rows| value(&whole, 0, rows).unwrap();
        assert_eq!(take(ChosenRows::Largest(f64::NEG_INFINITY, None)), 3.0);
        assert_eq!(take(ChosenRows::Smallest(0.1, Some(0.2))), 2.0);
        assert_eq!(take(ChosenRows::StrainOfLargest(0.0, None)), 0.1);
        assert_eq!(take(ChosenRows::StrainOfLargest(0.15, None)), 0.2);
        assert_eq!(take(ChosenRows::Mean(0.1, None)), 2.0);
        assert_eq!(take(ChosenRows::At(0.3)), 1.0);
        assert!((take(ChosenRows::At(0.05)) - 2.0).abs() < 1e-12);
        assert!(value(&whole, 0, ChosenRows::At(0.4)).unwrap_err().contains("largest strain of the path is 0.3000"));
        assert!(value(&whole, 0, ChosenRows::Mean(0.11, Some(0.12))).is_err(), "no row lies there");
    }

    #[test]
    fn a_path_that_stopped_early_gives_what_lies_before_and_nothing_else() {
        let stopped = path(&[0.0, 0.1], &[1.0, 3.0], Some("snap"));
        assert_eq!(value(&stopped, 0, ChosenRows::Mean(0.0, Some(0.1))), Ok(2.0));
        for rows in [ChosenRows::Largest(0.0, None), ChosenRows::Largest(0.0, Some(0.2)), ChosenRows::At(0.2)] {
            assert!(value(&stopped, 0, rows).unwrap_err().contains("stopped at a strain of 0.1000: snap"));
        }
    }

    #[test]
    fn the_mean_of_a_ratio_is_the_ratio_of_the_means() {
        let ratio =
            Path { weights: vec![vec![1.0, 0.001, 2.0]], ..path(&[0.0, 0.1, 0.2], &[2.0, 3000.0, 1.0], None) };
        let found = value(&ratio, 0, ChosenRows::Mean(0.0, None)).unwrap();
        assert!((found - 7.0 / 3.001).abs() < 1e-12, "{found}");
    }

    #[test]
    fn dilatancy_is_the_slope_of_the_volume_over_the_axial_strain() {
        let kept: Vec<Kept> = (0..11)
            .map(|row| {
                let axial = 0.01 * f64::from(row);
                Kept { axial, volume: 0.3 * axial, stress_ratio: 2.0 + 10.0 * axial }
            })
            .collect();
        let (dilatancy, stress_ratio) = slope_at(&kept, 5, 0.0201);
        assert!((dilatancy - 1.3).abs() < 1e-12 && (stress_ratio - 2.5).abs() < 1e-12);
        assert!(slope_at(&kept, 5, 0.005).0.is_nan(), "one row has no slope");
    }
}
