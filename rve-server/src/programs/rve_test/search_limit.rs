//! How many trials a search for controlled stresses may take.

/// Trials of every search, and the most of one that goes on coming nearer.
const TRIALS: u32 = 10;
const MOST_TRIALS: u32 = 30;

/// Trials in which a search has to halve its distance to go on beyond [`TRIALS`].
const HALVED_WITHIN: usize = 5;

/// The limit of one search, and how near it has come.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SearchLimit {
    /// Trials whatever comes of them.
    certain: u32,
    /// Most trials.
    most: u32,
    /// Least distance from the targets after each trial, Pa.
    nearest: Vec<f64>,
}

impl SearchLimit {
    /// Of a search behind which a shorter stride may follow: where it does not come nearer, the cell snaps from trial to trial.
    pub(super) fn of_a_stride() -> Self {
        Self { certain: TRIALS, most: MOST_TRIALS, nearest: Vec::new() }
    }

    /// Of a search that nothing follows.
    pub(super) fn of_the_last_resort() -> Self {
        Self { certain: MOST_TRIALS, ..Self::of_a_stride() }
    }

    /// Of a single trial.
    pub(super) fn of_one_trial() -> Self {
        Self { certain: 1, most: 1, nearest: Vec::new() }
    }

    /// Takes in how far from its target the worst component of a trial is, Pa.
    pub(super) fn count(&mut self, distance: f64) {
        let nearest = self.nearest.last().map_or(distance, |before| before.min(distance));
        self.nearest.push(nearest);
    }

    /// Whether there is another trial.
    pub(super) fn goes_on(&self) -> bool {
        let taken = self.nearest.len();
        let has_come_nearer = || {
            self.nearest
                .get(taken.wrapping_sub(1 + HALVED_WITHIN))
                .is_some_and(|&before| 2.0 * self.nearest[taken - 1] <= before)
        };
        taken < self.certain as usize || (taken < self.most as usize && has_come_nearer())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trials(mut limit: SearchLimit, distance: impl Fn(usize) -> f64) -> usize {
        let mut taken = 0;
        while limit.goes_on() {
            limit.count(distance(taken));
            taken += 1;
        }
        taken
    }

    #[test]
    fn a_search_goes_on_while_it_comes_nearer() {
        let slowly = |trial: usize| 1e3 * 0.8_f64.powi(trial as i32);
        let until = |stop: usize| move |trial: usize| slowly(trial.min(stop));
        let about = |trial: usize| 1e3 + 1e2 * ((7 * trial) % 11) as f64;
        assert_eq!(trials(SearchLimit::of_a_stride(), slowly), 30);
        assert_eq!(
            trials(SearchLimit::of_a_stride(), until(12)),
            15,
            "three trials less far than one in five halves it"
        );
        assert_eq!(trials(SearchLimit::of_a_stride(), about), 10);
        assert_eq!(trials(SearchLimit::of_the_last_resort(), about), 30);
        assert_eq!(trials(SearchLimit::of_one_trial(), slowly), 1);
    }
}
