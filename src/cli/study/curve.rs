//! One path of one packing: what is measured in its rows, and the values that a study takes from them.

use macro_solver::output::{Axes, Rank, StressMeasure};
use protocol::Tensor2;
use rve_server::programs::rve_test::ElementRow;
use scene_reader::{ChosenRows, PathStrain, RowMeasure};
use std::ops::Range;

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
        let stress = Tensor2::from_rows(&row.stress);
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
                    if *measure == RowMeasure::Dilatancy {
                        *value = dilatancy;
                    } else {
                        // Their quotient; where the volume changes as fast as the sample is compressed, it has none and no weight.
                        weights.push(dilatancy);
                        *value = if dilatancy == 0.0 { f64::NAN } else { stress_ratio / dilatancy };
                    }
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
/// less than three rows. Rows of another branch of the path, behind a reversal of the axial strain, do not count.
fn slope_at(kept: &[Kept], row: usize, half_width: f64) -> (f64, f64) {
    let near = &kept[branch_around(kept, row, half_width)];
    let mean = |value: fn(&Kept) -> f64| near.iter().map(value).sum::<f64>() / near.len() as f64;
    let (axial, volume) = (mean(|kept| kept.axial), mean(|kept| kept.volume));
    let spread: f64 = near.iter().map(|kept| (kept.axial - axial).powi(2)).sum();
    if near.len() < 3 || spread <= 0.0 {
        return (f64::NAN, f64::NAN);
    }
    let product: f64 = near.iter().map(|kept| (kept.axial - axial) * (kept.volume - volume)).sum();
    (1.0 + product / spread, mean(|kept| kept.stress_ratio))
}

/// The rows around one of them, up to a reversal of the axial strain or the first that is farther than `half_width` away. A row at
/// which the strain turns back belongs to the branch that leads to it.
fn branch_around(kept: &[Kept], row: usize, half_width: f64) -> Range<usize> {
    let direction = |step: usize| kept.get(step + 1).map_or(0.0, |next| next.axial - kept[step].axial);
    let own = if row > 0 { direction(row - 1) } else { direction(0) };
    let is_near = |other: usize| (kept[other].axial - kept[row].axial).abs() <= half_width;
    let (mut first, mut last) = (row, row);
    while first > 0 && direction(first - 1) * own >= 0.0 && is_near(first - 1) {
        first -= 1;
    }
    while last + 1 < kept.len() && direction(last) * own >= 0.0 && is_near(last + 1) {
        last += 1;
    }
    first..last + 1
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
    let last = path.strain.last().copied().unwrap_or(f64::NAN);
    let stopped = |reason: &String| format!("stopped at a strain of {last:.4}: {reason}");
    let needs = |strain: f64| match &path.stopped {
        _ if reached >= strain - SAME_STRAIN => Ok(()),
        Some(reason) => Err(stopped(reason)),
        None => {
            Err(format!("the largest strain of the path is {reached:.4} (extension counts negative), below {strain}"))
        }
    };
    let window = |from: f64, to: Option<f64>| match (to, &path.stopped) {
        // A path of extension begins at the upper end of its range: it has to come out at the lower one.
        (Some(to), Some(reason)) if from + SAME_STRAIN < last && last < to - SAME_STRAIN => Err(stopped(reason)),
        (Some(to), _) => needs(to).map(|()| (from, to)),
        (None, Some(reason)) => Err(stopped(reason)),
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
            // A slope has no number at an end of the path.
            for row in rows_between(window(from, to)?).into_iter().filter(|row| values[*row].is_finite()) {
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
    if found.is_finite() { Ok(found) } else { Err("no row in the range of strain has a number".to_owned()) }
}

/// The value where the path first passes a strain; NaN if it never does.
fn at_strain(strain: &[f64], values: &[f64], at: f64) -> f64 {
    for (row, here) in strain.iter().enumerate() {
        if (here - at).abs() <= SAME_STRAIN {
            return values[row];
        }
        if let Some(next) = strain.get(row + 1)
            && (next - at).abs() > SAME_STRAIN
            && (here - at) * (next - at) < 0.0
        {
            let share = (at - here) / (next - here);
            return values[row] + share * (values[row + 1] - values[row]);
        }
    }
    f64::NAN
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

    /// A path that turns back and meets the strain to the digit on its way: the first passage counts, between two rows.
    #[test]
    fn the_first_passage_of_a_path_that_returns_counts() {
        let returning = path(&[0.0, 0.004, 0.008, 0.005, 0.002], &[1.0, 2.0, 3.0, 7.0, 8.0], None);
        let at = |strain| value(&returning, 0, ChosenRows::At(strain)).unwrap();
        assert!((at(0.005) - 2.25).abs() < 1e-12, "{}", at(0.005));
        assert_eq!([at(0.004), at(0.008)], [2.0, 3.0]);
    }

    /// In extension the strain is negative and the largest one zero from the start: what counts is that the range was left again.
    #[test]
    fn a_path_of_extension_that_stopped_within_the_range_has_no_value_there() {
        let stopped = path(&[0.0, -0.02, -0.05], &[1.0, 2.0, 4.0], Some("snap"));
        for rows in [ChosenRows::Mean(-0.1, Some(-0.01)), ChosenRows::Largest(f64::NEG_INFINITY, Some(0.0))] {
            assert!(value(&stopped, 0, rows).unwrap_err().contains("stopped at a strain of -0.0500: snap"));
        }
        assert_eq!(value(&stopped, 0, ChosenRows::Mean(-0.05, Some(-0.01))), Ok(3.0));
    }

    #[test]
    fn rows_without_a_number_are_left_out_of_a_mean() {
        let ends = path(&[0.0, 0.1, 0.2, 0.3], &[f64::NAN, 2.0, 4.0, f64::NAN], None);
        assert_eq!(value(&ends, 0, ChosenRows::Mean(0.0, None)), Ok(3.0));
        assert!(value(&ends, 0, ChosenRows::Mean(0.25, None)).unwrap_err().contains("no row in the range"));
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
        // Unloading on another slope does not touch the first branch, its last row included.
        let back = |row: i32| Kept { axial: 0.1 - 0.01 * f64::from(row), volume: 0.9, stress_ratio: 0.0 };
        let both: Vec<Kept> = kept.iter().copied().chain((1..8).map(back)).collect();
        for row in 0..11 {
            assert_eq!(slope_at(&both, row, 0.0201), slope_at(&kept, row, 0.0201), "row {row}");
        }
        assert!((slope_at(&both, 14, 0.0201).0 - 1.0).abs() < 1e-12, "the volume stays in unloading");
    }
}
