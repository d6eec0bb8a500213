//! Globalisation of Newton's method for materials that are not smooth: a cap on corrections, backtracking, and an early end of
//! attempts that make no progress.
//!
//! Sizes of corrections are measured by the largest component of any point's displacement gradient. An iterate is
//! rejected when a point refuses it, an element inverts, or the out-of-balance force grows more than
//! [`LARGEST_GROWTH`]-fold; the next one then lies half way back. Smaller growth is accepted, because a frictional
//! material is not smooth enough to insist on descent, but lowers the cap on further corrections of the attempt. A
//! radius that shrinks at every growth was measured against this and needed a third more evaluations past the peak.

/// Growth of the out-of-balance force, relative to the last accepted iterate, at which an iterate is rejected.
const LARGEST_GROWTH: f64 = 3.0;

/// Consecutive iterates that may be rejected before the attempt fails.
const MAX_BACKTRACKS: usize = 3;

/// An attempt is abandoned when its distance from convergence has not fallen below [`PROGRESS`] times its least value
/// for this many evaluations: a smaller step costs less.
const LONGEST_STAGNATION: usize = 5;

/// See [`LONGEST_STAGNATION`].
const PROGRESS: f64 = 0.9;

/// Evaluations without halving the distance from convergence, or the out-of-balance force, after which iterations make no progress worth their cost:
/// an iterate that may be accepted as it is ends the step, and one that may be committed is. A smooth material halves both in each.
const LONGEST_CRAWL: usize = 2;

/// The same for a single evaluation that leaves more than this share of the distance of the one before.
const LEAST_GAIN: f64 = 0.8;

/// Globalisation of one attempt.
#[derive(Clone, Debug)]
pub(in crate::solve) struct Globalisation {
    base: Option<Base>,
    backtracks: usize,
    cap: f64,
    lowered_cap: f64,
    least: [f64; 2],
    idle: usize,
    /// Distances from convergence, as multiples of the tolerances.
    distances: Pace,
    /// Out-of-balance forces.
    forces: Pace,
}

/// How fast a measure falls from iterate to iterate.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// Its value when it was last halved.
    halved: f64,
    crawling: usize,
    /// Of the last accepted iterate.
    last: f64,
}

impl Pace {
    const NONE: Self = Self { halved: f64::INFINITY, crawling: 0, last: f64::INFINITY };

    /// Takes the measure of an accepted iterate and returns whether it falls so slowly that further iterations are not worth their cost.
    fn crawls(&mut self, value: f64) -> bool {
        if value <= 0.5 * self.halved {
            self.halved = value;
            self.crawling = 0;
        } else {
            self.crawling += 1;
        }
        let before = std::mem::replace(&mut self.last, value);
        self.crawling >= LONGEST_CRAWL || value > LEAST_GAIN * before
    }
}

/// The last accepted iterate.
#[derive(Clone, Debug)]
struct Base {
    increment: Vec<f64>,
    residual: f64,
}

impl Globalisation {
    /// Lets corrections change displacement gradients by up to `cap`, and by up to `lowered_cap` once the residual
    /// has grown.
    pub(in crate::solve) fn new(cap: f64, lowered_cap: f64) -> Self {
        Self {
            base: None,
            backtracks: 0,
            cap,
            lowered_cap,
            least: [f64::INFINITY; 2],
            idle: 0,
            distances: Pace::NONE,
            forces: Pace::NONE,
        }
    }

    /// Whether an evaluated iterate is accepted, by its out-of-balance force; growth below `settled` does not matter. After
    /// `false` comes [`Globalisation::backtrack`].
    pub(in crate::solve) fn accepts(&mut self, iterate: &[f64], residual: f64, settled: f64) -> bool {
        if let Some(base) = &self.base {
            let before = base.residual.max(settled);
            if residual > LARGEST_GROWTH * before {
                return false;
            }
            if residual > before {
                self.lower_cap();
            }
        }
        self.backtracks = 0;
        self.base = Some(Base { increment: iterate.to_vec(), residual });
        true
    }

    /// Half way back from a rejected iterate; `None` without an accepted iterate or after too many rejections in a row.
    pub(in crate::solve) fn backtrack(&mut self, iterate: &[f64]) -> Option<Vec<f64>> {
        self.backtracks += 1;
        self.lower_cap();
        let base = self.base.as_ref().filter(|_| self.backtracks <= MAX_BACKTRACKS)?;
        Some(base.increment.iter().zip(iterate).map(|(from, to)| from + 0.5 * (to - from)).collect())
    }

    /// Takes an accepted iterate's force and displacement criteria, each over its tolerance, and returns whether the
    /// attempt makes no progress. The displacement counts only while the force criterion holds: capped
    /// corrections can fall while the balance does not improve.
    pub(in crate::solve) fn stagnates(&mut self, criteria: [f64; 2]) -> bool {
        let watched = usize::from(criteria[0] <= 1.0);
        if criteria[watched] < PROGRESS * self.least[watched] {
            self.least[watched] = criteria[watched];
            self.idle = 0;
        } else {
            self.idle += 1;
        }
        self.idle >= LONGEST_STAGNATION
    }

    /// Takes an accepted iterate's criteria, each over its tolerance, and returns whether the iterations crawl: at this rate the
    /// tolerances are not worth reaching, or cannot be reached.
    pub(in crate::solve) fn crawls(&mut self, criteria: [f64; 2]) -> bool {
        self.distances.crawls(criteria[0].max(criteria[1]))
    }

    /// Takes an accepted iterate's out-of-balance force over reactions and loads, and returns whether it crawls.
    pub(in crate::solve) fn forces_crawl(&mut self, force_ratio: f64) -> bool {
        self.forces.crawls(force_ratio)
    }

    /// Share of a correction of size `largest` that may be applied.
    pub(in crate::solve) fn share(&self, largest: f64) -> f64 {
        if largest > self.cap { self.cap / largest } else { 1.0 }
    }

    fn lower_cap(&mut self) {
        self.cap = self.cap.min(self.lowered_cap);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_lowers_the_cap_for_good() {
        let mut guard = Globalisation::new(4e-3, 1e-3);
        assert!(guard.accepts(&[0.0], 1.0, 0.01));
        assert_eq!((guard.share(2e-3), guard.share(8e-3)), (1.0, 0.5));
        assert!(guard.accepts(&[1.0], 1.2, 0.01));
        assert_eq!((guard.share(5e-4), guard.share(2e-3)), (1.0, 0.5));
        assert!(guard.accepts(&[2.0], 0.1, 0.01));
        assert_eq!(guard.share(2e-3), 0.5);
    }

    #[test]
    fn growth_below_the_tolerance_does_not_matter() {
        let mut guard = Globalisation::new(4e-3, 1e-3);
        assert!(guard.accepts(&[0.0], 1e-4, 0.01) && guard.accepts(&[1.0], 9e-3, 0.01));
        assert_eq!(guard.share(4e-3), 1.0);
    }

    #[test]
    fn backtracking_halves_the_step_and_ends() {
        let mut guard = Globalisation::new(1e-3, 1e-3);
        assert_eq!(guard.backtrack(&[1.0]), None);
        let mut guard = Globalisation::new(1e-3, 1e-3);
        assert!(guard.accepts(&[1.0], 1.0, 0.01));
        assert!(!guard.accepts(&[2.0], 4.0, 0.01));
        assert_eq!(guard.backtrack(&[2.0]), Some(vec![1.5]));
        assert_eq!(guard.backtrack(&[1.5]), Some(vec![1.25]));
        assert_eq!(guard.backtrack(&[1.25]), Some(vec![1.125]));
        assert_eq!(guard.backtrack(&[1.125]), None);
    }

    #[test]
    fn iterations_crawl_that_do_not_halve_the_distance_in_two_evaluations_or_hardly_lower_it_in_one() {
        let crawls = |distances: &[f64]| {
            let mut guard = Globalisation::new(1e-3, 1e-3);
            distances.iter().map(|distance| guard.crawls([*distance, 0.0])).collect::<Vec<_>>()
        };
        assert_eq!(crawls(&[8.0, 5.0, 3.0, 2.0, 1.2]), [false; 5]);
        assert_eq!(crawls(&[8.0, 6.0, 4.5, 2.0]), [false, false, true, false]);
        assert_eq!(crawls(&[8.0, 3.0, 2.9, 1.0]), [false, false, true, false], "a single one that gains nothing");
    }

    /// A quasi-Newton update that finds the body softer makes the corrections grow, while the forces are halved.
    #[test]
    fn corrections_that_grow_say_nothing_about_the_forces() {
        let mut guard = Globalisation::new(1e-3, 1e-3);
        let steps = [(8.0, 1.0), (4.0, 3.0), (2.0, 4.0), (1.0, 4.0)];
        let found =
            steps.map(|(force, displacement)| (guard.crawls([force, displacement]), guard.forces_crawl(force)));
        assert!(found.iter().all(|(_, forces)| !forces) && found[3].0, "{found:?}");
        assert!(guard.forces_crawl(0.9));
    }

    #[test]
    fn stagnant_attempt_is_abandoned_but_not_a_slow_one() {
        let given_up = |factor: f64| {
            let mut guard = Globalisation::new(1e-3, 1e-3);
            (0..8).any(|turn| guard.stagnates([9.0 * factor.powi(turn), 9.0 * 0.5f64.powi(turn)]))
        };
        assert!(given_up(1.0) && given_up(0.99));
        assert!(!given_up(0.85));
        let mut guard = Globalisation::new(1e-3, 1e-3);
        assert!((0..8).any(|_| guard.stagnates([0.5, 3.0])), "noise beyond the displacement tolerance");
    }
}
