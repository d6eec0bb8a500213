//! Curves and the numbers that papers quote of them.

use super::error::ReproduceError;

/// Points of a curve in the order of the run.
pub(super) type Curve = Vec<[f64; 2]>;

/// A curve of two columns.
pub(super) fn curve(x: &[f64], y: &[f64]) -> Curve {
    x.iter().zip(y).map(|(x, y)| [*x, *y]).collect()
}

/// The highest point.
///
/// # Errors
/// The curve has no points.
pub(super) fn peak(curve: &[[f64; 2]]) -> Result<[f64; 2], ReproduceError> {
    extreme(curve, 1.0)
}

/// The lowest point.
///
/// # Errors
/// The curve has no points.
pub(super) fn trough(curve: &[[f64; 2]]) -> Result<[f64; 2], ReproduceError> {
    extreme(curve, -1.0)
}

fn extreme(curve: &[[f64; 2]], sign: f64) -> Result<[f64; 2], ReproduceError> {
    let points = curve.iter().filter(|point| point[1].is_finite());
    let found = points.max_by(|one, other| (sign * one[1]).total_cmp(&(sign * other[1])));
    found.copied().ok_or_else(|| ReproduceError::NotFound("a curve has no points".to_owned()))
}

/// Value at `x`, on the first straight line between two points that passes it; NaN where the curve does not reach.
pub(super) fn value_at(curve: &[[f64; 2]], x: f64) -> f64 {
    let between = |pair: &&[[f64; 2]]| {
        let (low, high) = (pair[0][0].min(pair[1][0]), pair[0][0].max(pair[1][0]));
        (low..=high).contains(&x)
    };
    match curve.windows(2).find(between) {
        Some([from, to]) if to[0] != from[0] => from[1] + (x - from[0]) / (to[0] - from[0]) * (to[1] - from[1]),
        Some([from, ..]) => from[1],
        _ => f64::NAN,
    }
}

/// Where the curve first passes `level` after `x`; NaN if it never does.
pub(super) fn crossing(curve: &[[f64; 2]], level: f64, after: f64) -> f64 {
    let passes = |pair: &&[[f64; 2]]| {
        pair[0][0] >= after && (pair[0][1] - level) * (pair[1][1] - level) <= 0.0 && pair[0][1] != pair[1][1]
    };
    match curve.windows(2).find(passes) {
        Some([from, to]) => from[0] + (level - from[1]) / (to[1] - from[1]) * (to[0] - from[0]),
        _ => f64::NAN,
    }
}

/// The middle value, or the mean of the middle two; NaN without values.
pub(super) fn median_of(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let count = values.len();
    match (count, count % 2) {
        (0, _) => f64::NAN,
        (_, 1) => values[count / 2],
        _ => 0.5 * (values[count / 2 - 1] + values[count / 2]),
    }
}

/// Mean of the values between two abscissas; NaN without points there.
pub(super) fn mean_between(curve: &[[f64; 2]], low: f64, high: f64) -> f64 {
    let values: Vec<f64> =
        curve.iter().filter(|point| (low..=high).contains(&point[0])).map(|point| point[1]).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// Area under a curve of straight lines between the points; of a closed loop that is run clockwise, its area: the work of a stress over a
/// strain.
pub(super) fn work(curve: &[[f64; 2]]) -> f64 {
    curve.windows(2).map(|pair| 0.5 * (pair[0][1] + pair[1][1]) * (pair[1][0] - pair[0][0])).sum()
}

/// Stress ratio of [Liu2018], `|(s11 - s22) / (s11 + s22)|`, from `s22 / s11`.
pub(super) fn liu_ratio(stress_ratio: f64) -> f64 {
    ((stress_ratio - 1.0) / (stress_ratio + 1.0)).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_from_curves() {
        let curve = [[0.0, 0.0], [1.0, -2.0], [2.0, 2.0], [3.0, 1.0]];
        assert_eq!((peak(&curve).unwrap(), trough(&curve).unwrap()), ([2.0, 2.0], [1.0, -2.0]));
        assert_eq!((value_at(&curve, 1.5), crossing(&curve, 0.0, 0.5)), (0.0, 1.5));
        assert_eq!([median_of(vec![3.0, 1.0, 2.0]), median_of(vec![4.0, 1.0])], [2.0, 2.5]);
        assert!(median_of(Vec::new()).is_nan());
        assert!(value_at(&curve, 4.0).is_nan() && crossing(&curve, 9.0, 0.0).is_nan());
        assert_eq!(mean_between(&curve, 1.5, 3.0), 1.5);
        assert!((liu_ratio(3.0) - 0.5).abs() < 1e-15);
        assert!(peak(&[]).is_err());
    }

    #[test]
    fn a_loop_takes_its_area_as_work() {
        let square = [[0.0, 0.0], [0.0, 2.0], [3.0, 2.0], [3.0, 0.0], [0.0, 0.0]];
        assert_eq!(work(&square), 6.0);
        assert_eq!(work(&[[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]), 0.0);
    }
}
