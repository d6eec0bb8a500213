//! Statistics of samples, and the power of the number of grains with which their scatter falls.

/// Quantile of the normal distribution that 95 % of it lie within, in standard deviations.
const QUANTILE_95: f64 = 1.959_963_984_540_054;

/// Statistics of the values of an ensemble.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Statistics {
    /// Number of values.
    pub(super) count: usize,
    /// Their mean.
    pub(super) mean: f64,
    /// Standard deviation of a sample, with `count - 1`; NaN for one value.
    pub(super) deviation: f64,
    /// The smallest value.
    pub(super) smallest: f64,
    /// The largest value.
    pub(super) largest: f64,
}

impl Statistics {
    /// Of some values; `None` without any.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let deviation = if count > 1 { (squares / (count - 1) as f64).sqrt() } else { f64::NAN };
        let extreme = |choose: fn(f64, f64) -> f64, start: f64| values.iter().copied().fold(start, choose);
        Some(Self {
            count,
            mean,
            deviation,
            smallest: extreme(f64::min, f64::INFINITY),
            largest: extreme(f64::max, f64::NEG_INFINITY),
        })
    }

    /// Standard error of the mean; NaN for one value.
    pub(super) fn standard_error(&self) -> f64 {
        self.deviation / (self.count as f64).sqrt()
    }
}

/// The standard deviation as `factor * grains ^ power`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PowerFit {
    /// The power; -1/2 where the grains are independent.
    pub(super) power: f64,
    /// Half the interval of 95 % confidence of the power.
    pub(super) half_width: f64,
    /// The deviation extrapolated to one grain.
    pub(super) factor: f64,
    /// Number of sizes that took part.
    pub(super) sizes: usize,
}

impl PowerFit {
    /// A weighted straight line through the logarithms of deviation and number of grains; `None` with less than two sizes that have a
    /// deviation.
    ///
    /// The deviation `s` of `n` normal values has the logarithm `ln sigma + (psi(v) - ln v) / 2` on average and `psi'(v) / 4` as its
    /// variance, `v = (n - 1) / 2` (logarithm of a chi-squared variable). The first is taken off, the second weights the sizes and
    /// gives the interval: also two sizes then have one.
    pub(super) fn of(sizes: &[(usize, Statistics)]) -> Option<Self> {
        let points: Vec<[f64; 3]> = sizes
            .iter()
            .filter(|(grains, one)| *grains > 0 && one.count > 1 && one.deviation > 0.0)
            .map(|(grains, one)| {
                let half = 0.5 * (one.count - 1) as f64;
                let mean = one.deviation.ln() - 0.5 * (digamma(half) - half.ln());
                [(*grains as f64).ln(), mean, 4.0 / trigamma(half)]
            })
            .collect();
        if points.len() < 2 {
            return None;
        }
        let weight: f64 = points.iter().map(|point| point[2]).sum();
        let centre = |axis: usize| points.iter().map(|point| point[2] * point[axis]).sum::<f64>() / weight;
        let (x, y) = (centre(0), centre(1));
        let spread: f64 = points.iter().map(|point| point[2] * (point[0] - x).powi(2)).sum();
        if spread <= 0.0 {
            return None;
        }
        let power = points.iter().map(|point| point[2] * (point[0] - x) * (point[1] - y)).sum::<f64>() / spread;
        Some(Self {
            power,
            half_width: QUANTILE_95 / spread.sqrt(),
            factor: (y - power * x).exp(),
            sizes: points.len(),
        })
    }

    /// The deviation that the fit gives a number of grains.
    pub(super) fn deviation(&self, grains: f64) -> f64 {
        self.factor * grains.powf(self.power)
    }
}

/// From here on the asymptotic series of the two functions below have an error below 1e-12.
const ASYMPTOTIC: f64 = 12.0;

/// Derivative of the logarithm of the gamma function, for positive arguments.
fn digamma(argument: f64) -> f64 {
    let (mut x, mut sum) = (argument, 0.0);
    while x < ASYMPTOTIC {
        sum -= 1.0 / x;
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    sum + x.ln()
        - 0.5 / x
        - square
            * (1.0 / 12.0 - square * (1.0 / 120.0 - square * (1.0 / 252.0 - square * (1.0 / 240.0 - square / 132.0))))
}

/// Derivative of [`digamma`], for positive arguments.
fn trigamma(argument: f64) -> f64 {
    let (mut x, mut sum) = (argument, 0.0);
    while x < ASYMPTOTIC {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    let series =
        1.0 / 6.0 - square * (1.0 / 30.0 - square * (1.0 / 42.0 - square * (1.0 / 30.0 - square * 5.0 / 66.0)));
    sum + 1.0 / x + 0.5 * square + square / x * series
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{LN_2, PI};

    #[test]
    fn statistics_have_their_closed_forms() {
        let four = Statistics::of(&[1.0, 2.0, 3.0, 6.0]).unwrap();
        assert_eq!((four.count, four.mean, four.smallest, four.largest), (4, 3.0, 1.0, 6.0));
        assert!((four.deviation - (14.0f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((four.standard_error() - 0.5 * four.deviation).abs() < 1e-15);
        assert!(Statistics::of(&[2.0]).unwrap().deviation.is_nan());
        assert_eq!(Statistics::of(&[]), None);
    }

    #[test]
    fn digamma_and_trigamma_have_their_closed_forms() {
        let euler = 0.577_215_664_901_532_9;
        for (argument, expected) in
            [(1.0, -euler), (0.5, -euler - 2.0 * LN_2), (3.5, -euler - 2.0 * LN_2 + 46.0 / 15.0)]
        {
            assert!((digamma(argument) - expected).abs() < 1e-11, "{argument}: {}", digamma(argument));
        }
        for (argument, expected) in [(1.0, PI * PI / 6.0), (0.5, PI * PI / 2.0), (2.0, PI * PI / 6.0 - 1.0)] {
            assert!((trigamma(argument) - expected).abs() < 1e-11, "{argument}: {}", trigamma(argument));
        }
    }

    fn with_deviation(count: usize, deviation: f64) -> Statistics {
        Statistics { count, mean: 1.0, deviation, smallest: 0.0, largest: 2.0 }
    }

    #[test]
    fn an_exact_power_law_is_found_with_the_interval_of_its_samples() {
        let sizes: Vec<(usize, Statistics)> =
            [50, 100, 200, 400].map(|grains| (grains, with_deviation(9, 3.0 / (grains as f64).sqrt()))).into();
        let fit = PowerFit::of(&sizes).unwrap();
        assert!((fit.power + 0.5).abs() < 1e-12 && fit.sizes == 4);
        // Nine values each: v = 4, psi(4) = 11/6 - euler, psi'(4) = pi^2/6 - 49/36; logarithms of sizes are spread by 5 (ln 2)^2.
        let bias = 0.5 * (11.0 / 6.0 - 0.577_215_664_901_532_9 - 4.0f64.ln());
        assert!((fit.factor - 3.0 * (-bias).exp()).abs() < 1e-10);
        let variance = 0.25 * (PI * PI / 6.0 - 49.0 / 36.0) / (5.0 * LN_2 * LN_2);
        assert!((fit.half_width - QUANTILE_95 * variance.sqrt()).abs() < 1e-10);
        assert!((fit.deviation(100.0) - 0.3 * (-bias).exp()).abs() < 1e-10);
    }

    #[test]
    fn a_power_needs_two_sizes_with_a_deviation() {
        let one = (50, with_deviation(8, 0.1));
        assert_eq!(PowerFit::of(&[one]), None);
        assert_eq!(PowerFit::of(&[one, (100, with_deviation(1, f64::NAN)), (200, with_deviation(8, 0.0))]), None);
        assert!(PowerFit::of(&[one, (100, with_deviation(8, 0.1))]).unwrap().power.abs() < 1e-12);
    }

    /// Normal samples from a fixed sequence: the interval holds the true power about as often as it says.
    #[test]
    fn the_interval_of_confidence_holds_the_true_power_in_19_of_20_ensembles() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
        };
        let mut normal = move || (-2.0 * uniform().ln()).sqrt() * (2.0 * PI * uniform()).cos();
        let mut held = 0;
        for _ in 0..1000 {
            let sizes: Vec<(usize, Statistics)> = [50usize, 100, 200, 400]
                .into_iter()
                .map(|grains| {
                    let values: Vec<f64> = (0..8).map(|_| normal() / (grains as f64).sqrt()).collect();
                    (grains, Statistics::of(&values).unwrap())
                })
                .collect();
            let fit = PowerFit::of(&sizes).unwrap();
            held += usize::from((fit.power + 0.5).abs() <= fit.half_width);
        }
        assert!((930..=970).contains(&held), "{held} of 1000");
    }
}
