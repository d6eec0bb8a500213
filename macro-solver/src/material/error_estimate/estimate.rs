//! From the differences between points and replicas to the error of the body: sums over a sample, scaled to all points.

use serde::{Deserialize, Serialize};

/// True error over the difference between a point and its replica: between the 1 of errors that are independent of each other and the
/// 2 of errors in proportion to the strain per step. Measured in docs/lab-book/error-estimate.md.
pub(super) const ERROR_OF_DIFFERENCE: f64 = 1.5;

/// Estimated error over all replicas, after a commit. Relative to the mean pressure of a point (the level of its stress):
/// the largest it has had so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// Points compared with their replicas; 0 before anything has been committed.
    pub points: u64,
    /// Root mean square over the body of the estimated stress errors (Frobenius norm) over the pressure. Replicas of the eighth of the
    /// points that has strained most stand for that part, the others for the rest.
    pub rms: f64,
    /// Largest of them.
    pub largest: f64,
    /// Norm of their mean over the mean pressure: what is left in averages over the body. Without what the mean of a sample has by chance, but
    /// at least what independent errors of all points would leave.
    pub of_mean: f64,
}

/// What a replica tells about its point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Finding {
    /// Estimated error over the pressure.
    pub(super) relative: f64,
    /// Largest level of the point's stress so far, Pa.
    pub(super) pressure: f64,
    /// Stress of the point minus that of the replica, Pa; none before they have been compared.
    pub(super) difference: Option<[f64; 9]>,
}

/// Sums over replicas of points under stress.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// Replicas whose error is known: that have been compared with their point, or have just joined it.
    known: u64,
    /// Of the squares of their estimated errors over the pressure.
    squares: f64,
    largest: f64,
    /// Replicas that have been compared with their point.
    points: u64,
    pressures: f64,
    differences: [f64; 9],
    /// Of the squares of the differences, Pa^2.
    squared_differences: f64,
}

impl Sums {
    pub(super) fn over(findings: impl IntoIterator<Item = Finding>) -> Self {
        let mut sums = Self::default();
        for Finding { relative, pressure, difference } in findings {
            sums.known += 1;
            sums.squares += relative * relative;
            sums.largest = sums.largest.max(relative);
            let Some(difference) = difference else { continue };
            sums.points += 1;
            sums.pressures += pressure;
            sums.squared_differences += norm(&difference).powi(2);
            sums.differences.iter_mut().zip(difference).for_each(|(sum, component)| *sum += component);
        }
        sums
    }

    /// Variance of the sum of the differences over `points` points that these stand for, by the scatter of the sample, Pa^2: none where it has
    /// all points, and none is known of a single one.
    fn variance_of_sum(&self, points: f64) -> f64 {
        let sample = self.points as f64;
        if sample < 2.0 || points <= sample {
            return 0.0;
        }
        let scatter = (self.squared_differences - norm(&self.differences).powi(2) / sample) / (sample - 1.0);
        points * points * (1.0 - sample / points) * scatter.max(0.0) / sample
    }

    /// Mean of the squares; `None` over nothing.
    pub(super) fn mean_square(&self) -> Option<f64> {
        (self.known > 0).then(|| self.squares / self.known as f64)
    }

    /// Over the points that these stand for the sum of the squares is at least `squares`.
    pub(super) fn contains_at_least(&mut self, squares: f64, points: usize) {
        self.squares = self.squares.max(squares * self.known as f64 / points.max(1) as f64);
    }
}

/// The estimate for a body of parts, each with what its replicas have found and its number of points; `None` without any replica that has been
/// compared with a point under stress. Replicas stand for all points of their part; a part without any is left out.
pub(super) fn estimate(parts: [(Sums, usize); 2]) -> Option<ErrorEstimate> {
    let known = || parts.iter().filter(|(sums, _)| sums.known > 0);
    let points: f64 = known().map(|(_, points)| *points as f64).sum();
    let squares: f64 = known().map(|(sums, points)| *points as f64 / sums.known as f64 * sums.squares).sum();
    let compared = || parts.iter().filter(|(sums, _)| sums.points > 0);
    // Over the parts, each replica times the number of points that it stands for.
    let of_all = |of: &dyn Fn(&Sums) -> f64| -> f64 {
        compared().map(|(sums, points)| *points as f64 / sums.points as f64 * of(sums)).sum()
    };
    let differences: [f64; 9] = std::array::from_fn(|k| of_all(&|sums| sums.differences[k]));
    let by_chance: f64 = compared().map(|(sums, points)| sums.variance_of_sum(*points as f64)).sum();
    let sum = (norm(&differences).powi(2) - by_chance).max(0.0).sqrt();
    (compared().count() > 0).then(|| {
        let rms = (squares / points).sqrt();
        ErrorEstimate {
            points: compared().map(|(sums, _)| sums.points).sum(),
            rms,
            largest: known().map(|(sums, _)| sums.largest).fold(0.0, f64::max),
            of_mean: (ERROR_OF_DIFFERENCE * sum / of_all(&|sums| sums.pressures)).max(rms / points.sqrt()),
        }
    })
}

/// Frobenius norm of a tensor by its components.
pub(super) fn norm(components: &[f64; 9]) -> f64 {
    components.iter().map(|component| component * component).sum::<f64>().sqrt()
}
