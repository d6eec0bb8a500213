//! When a stabilised path is given up: increments at fixed loads, those of them without a gain, and the strain of a body that collapses.

/// Share of the least out-of-balance force so far that one below it counts as a gain.
const GAIN: f64 = 0.9;

/// Increments at fixed loads in a row without a gain after which a path is given up: nothing comes of it, and a smaller step may do better. Of
/// 169 paths that have come to an equilibrium none went longer than 97 without one. The smallest step is the last resort, and has no such limit.
pub(super) const MOST_WITHOUT_GAIN: usize = 120;

/// The same for a step that goes on from a committed iterate where a larger one has been stabilised in vain: 149 of these paths have done with it.
pub(super) const FEW_WITHOUT_GAIN: usize = 20;

/// Mean displacement gradient of a path with all supports at rest, beyond which the body has collapsed: a specimen that fails under its load
/// flows on until it is flat or some other state happens to bear the load, while loose cells that settle have done with it before.
const COLLAPSE: f64 = 0.1;

/// The limits of a path, and what it has used of them.
#[derive(Debug)]
pub(super) struct PathLimits {
    /// Most increments at fixed loads.
    most_increments: usize,
    /// Most of them in a row without a gain; `None`: any number.
    most_without_gain: Option<usize>,
    /// Whether all supports are at rest, so that strain is that of a collapse.
    supports_rest: bool,
    at_fixed_loads: usize,
    /// Least out-of-balance force at fixed loads, over reactions and loads.
    least: f64,
    without_gain: usize,
}

impl PathLimits {
    /// Those of a path that begins.
    pub(super) fn new(most_increments: usize, most_without_gain: Option<usize>, supports_rest: bool) -> Self {
        Self {
            most_increments,
            most_without_gain,
            supports_rest,
            at_fixed_loads: 0,
            least: f64::INFINITY,
            without_gain: 0,
        }
    }

    /// Takes an increment, with supports and loads fixed or not, that left this out-of-balance force over reactions and loads.
    pub(super) fn add(&mut self, is_at_fixed_loads: bool, force_ratio: f64) {
        if !is_at_fixed_loads {
            // Loads that move bring force of their own.
            (self.least, self.without_gain) = (f64::INFINITY, 0);
            return;
        }
        self.at_fixed_loads += 1;
        if force_ratio >= GAIN * self.least {
            self.without_gain += 1;
        } else {
            (self.least, self.without_gain) = (force_ratio, 0);
        }
    }

    /// Why a path that has strained the body by a displacement gradient of this norm, averaged over its points, is given up; `None` while it
    /// may go on.
    pub(super) fn reached(&self, mean_gradient: f64) -> Option<String> {
        let Self { at_fixed_loads, without_gain, .. } = self;
        if self.supports_rest && mean_gradient > COLLAPSE {
            return Some(format!(
                "collapse: {at_fixed_loads} increments of viscous stabilisation at fixed loads have strained the body by {:.1} % on average",
                100.0 * mean_gradient
            ));
        }
        if self.most_without_gain.is_some_and(|most| *without_gain >= most) {
            return Some(format!(
                "no equilibrium by viscous stabilisation: {at_fixed_loads} increments at fixed loads, the last {without_gain} of them without \
                 gain"
            ));
        }
        (*at_fixed_loads >= self.most_increments)
            .then(|| format!("no equilibrium after {at_fixed_loads} increments of viscous stabilisation"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn increments_at_fixed_loads_are_limited() {
        let mut limits = PathLimits::new(3, None, true);
        for force in [0.5, 0.4] {
            limits.add(true, force);
            limits.add(false, 0.6);
        }
        assert_eq!(limits.reached(0.0), None);
        limits.add(true, 0.1);
        assert!(limits.reached(0.0).unwrap().contains("after 3 increments"));
    }

    /// Forces that fall a little at a time gain nothing; loads that move begin anew.
    #[test]
    fn increments_without_a_gain_are_limited() {
        let mut limits = PathLimits::new(100, Some(2), true);
        limits.add(true, 0.5);
        limits.add(true, 0.49);
        limits.add(false, 0.49);
        limits.add(true, 0.48);
        limits.add(true, 0.47);
        assert_eq!(limits.reached(0.0), None);
        limits.add(true, 0.46);
        assert!(limits.reached(0.0).unwrap().contains("the last 2 of them without gain"));
        limits.add(true, 0.3);
        assert_eq!(limits.reached(0.0), None);
    }

    #[test]
    fn strain_is_that_of_a_collapse_where_no_support_moves() {
        let reached = |supports_rest| PathLimits::new(100, None, supports_rest).reached(0.11);
        assert!(reached(true).unwrap().contains("collapse") && reached(false).is_none());
    }
}
