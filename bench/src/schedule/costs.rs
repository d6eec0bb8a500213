//! Costs of jobs as grains have them: most alike, a few many times longer.

/// A generator of uniform numbers that is fixed by its few lines (splitmix64), so that studies repeat.
#[derive(Clone, Debug)]
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in (0, 1).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Normal with mean 0 and deviation 1.
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A distribution of costs with mean 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tail {
    /// All alike.
    Even,
    /// Logarithm normal with deviation 1: one job in a hundred takes ten times the median.
    LogNormal,
    /// Power law of exponent 1.2 cut at 50 times the smallest: a shear band in a quiet specimen.
    Power,
}

impl Tail {
    pub(super) const ALL: [Self; 3] = [Self::Even, Self::LogNormal, Self::Power];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Even => "even",
            Self::LogNormal => "log-normal",
            Self::Power => "power law",
        }
    }

    /// Costs of `count` jobs whose mean is exactly `mean`.
    pub(super) fn draw(self, count: usize, mean: f64, dice: &mut Dice) -> Vec<f64> {
        let mut costs: Vec<f64> = (0..count)
            .map(|_| match self {
                Self::Even => 1.0,
                Self::LogNormal => dice.normal().exp(),
                Self::Power => dice.uniform().powf(-1.0 / 1.2).min(50.0),
            })
            .collect();
        let scale = mean * count as f64 / costs.iter().sum::<f64>();
        costs.iter_mut().for_each(|cost| *cost *= scale);
        costs
    }
}

/// The same costs after the next increment: each times a log-normal factor of this deviation.
pub(super) fn drifted(costs: &[f64], deviation: f64, dice: &mut Dice) -> Vec<f64> {
    costs.iter().map(|cost| cost * (deviation * dice.normal()).exp()).collect()
}

/// No schedule can end earlier: neither before the longest job nor before the mean load of the workers.
pub(super) fn ideal(costs: &[f64], workers: usize) -> f64 {
    let longest = costs.iter().copied().fold(0.0, f64::max);
    longest.max(costs.iter().sum::<f64>() / workers as f64)
}

/// Makespan when each worker owns an equal number of neighbouring points: what a decomposition of the mesh gives.
pub(super) fn static_split(costs: &[f64], workers: usize) -> f64 {
    let bound = |worker: usize| worker * costs.len() / workers;
    (0..workers).map(|worker| costs[bound(worker)..bound(worker + 1)].iter().sum()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_have_their_mean_and_their_tail() {
        let costs = Tail::LogNormal.draw(20_000, 0.01, &mut Dice::new(1));
        assert!((costs.iter().sum::<f64>() / 20_000.0 - 0.01).abs() < 1e-12);
        let mut sorted = costs;
        sorted.sort_by(f64::total_cmp);
        let tail = sorted[19_800] / sorted[10_000];
        assert!((9.0..12.0).contains(&tail), "{tail}");
    }

    #[test]
    fn no_split_beats_the_ideal_and_equal_jobs_reach_it() {
        let costs = Tail::Power.draw(64, 1.0, &mut Dice::new(2));
        assert!(static_split(&costs, 8) >= ideal(&costs, 8));
        assert_eq!(static_split(&[1.0; 16], 4), ideal(&[1.0; 16], 4));
        assert_eq!(ideal(&[5.0, 1.0], 2), 5.0);
    }
}
