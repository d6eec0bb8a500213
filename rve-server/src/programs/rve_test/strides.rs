//! How large a part of an increment under stress control is taken at once.
//!
//! Where a cell rearranges often, no strain meets the controlled stresses at the end of a whole increment, and the search that finds this out
//! costs many trials. So an increment begins with a stride of little strain, a stride that fails is halved, strides grow again only after
//! several of them have met their stresses, and the next increment begins with twice the stride that the last one ended with.

/// Parts of an increment; the shortest stride is one.
const PARTS: u32 = 32;

/// Largest component of the strain of a stride, dimensionless: longer ones take many searches that fail before they are halved.
const LARGEST_STRAIN: f64 = 2.5e-3;

/// Strides that meet their stresses one after the other before the next one may be twice as long.
const MET_BEFORE_DOUBLING: u32 = 4;

/// The strides of an increment, each a whole number of parts and beginning at a multiple of itself, so that the last one ends with the
/// increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Strides {
    /// Parts that have been taken.
    taken: u32,
    /// Parts of the next stride.
    length: u32,
    /// Most parts of a stride.
    longest: u32,
    /// Strides of this length that have met their stresses since it was chosen.
    met: u32,
    /// Whether the increment has had a stride that was too long.
    is_cut: bool,
}

impl Strides {
    /// Of an increment in which the largest component of the prescribed strain changes by `strain` while stresses are controlled: it is taken at
    /// once if that is little.
    pub(super) fn of(strain: f64) -> Self {
        let mut longest = PARTS;
        while longest > 1 && strain * f64::from(longest) > LARGEST_STRAIN * f64::from(PARTS) {
            longest /= 2;
        }
        Self { taken: 0, length: longest, longest, met: 0, is_cut: false }
    }

    /// Of the next increment.
    pub(super) fn next_increment(self) -> Self {
        let length = (2 * self.length).min(self.longest);
        Self { taken: 0, length, met: 0, is_cut: length < self.longest, ..self }
    }

    /// Share of the increment at the end of the next stride, and whether that is the end of the increment.
    pub(super) fn aim(&self) -> (f64, bool) {
        let end = self.taken + self.length;
        (f64::from(end) / f64::from(PARTS), end == PARTS)
    }

    /// Whether no shorter stride is allowed.
    pub(super) fn is_shortest(&self) -> bool {
        self.length == 1
    }

    /// The stresses were not met.
    pub(super) fn halve(&mut self) {
        self.length /= 2;
        self.met = 0;
        self.is_cut = true;
    }

    /// The stride has been taken; whether its stresses were met in the end.
    pub(super) fn advance(&mut self, is_met: bool) {
        self.taken += self.length;
        self.met = if is_met { self.met + 1 } else { 0 };
        let longer = 2 * self.length;
        let fits = longer <= self.longest && self.taken.is_multiple_of(longer) && self.taken + longer <= PARTS;
        if self.met >= MET_BEFORE_DOUBLING && fits {
            self.length = longer;
            self.met = 0;
        }
    }

    /// Whether a stride of the increment was too long.
    pub(super) fn is_cut(&self) -> bool {
        self.is_cut
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever fails, every stride begins at a multiple of itself and the last one ends with the increment.
    #[test]
    fn strides_end_with_the_increment_whatever_fails() {
        for seed in 0_u32..500 {
            let mut random = seed.wrapping_mul(2_654_435_761) | 1;
            let mut strides = Strides::of(0.0);
            for _ in 0..4 {
                let mut reached = 0.0;
                loop {
                    random ^= random << 13;
                    random ^= random >> 17;
                    random ^= random << 5;
                    if random % 3 == 0 && !strides.is_shortest() {
                        strides.halve();
                        continue;
                    }
                    let (aim, is_last) = strides.aim();
                    assert!(aim > reached && aim <= 1.0, "seed {seed}: from {reached} to {aim}");
                    assert_eq!(is_last, aim == 1.0);
                    let start = reached / (aim - reached);
                    assert_eq!(start, start.round(), "seed {seed}: from {reached} to {aim}");
                    reached = aim;
                    if is_last {
                        break;
                    }
                    strides.advance(random % 5 != 0);
                }
                strides = strides.next_increment();
            }
        }
    }

    #[test]
    fn the_next_increment_begins_with_twice_the_last_stride_and_grows_where_stresses_are_met() {
        let mut strides = Strides::of(0.0);
        assert_eq!(strides.aim(), (1.0, true));
        strides.halve();
        strides.halve();
        strides.halve();
        assert_eq!((strides.aim(), strides.is_cut()), ((0.125, false), true));
        let mut strides = strides.next_increment();
        assert_eq!((strides.aim(), strides.is_cut()), ((0.25, false), true));
        for _ in 0..2 {
            strides.advance(true);
        }
        assert_eq!(strides.aim().0, 0.75, "two of them are too few");
        let mut ends = Vec::new();
        strides = Strides::of(0.0);
        strides.halve();
        strides.halve();
        strides.halve();
        while !strides.aim().1 {
            ends.push(strides.aim().0);
            strides.advance(true);
        }
        assert_eq!(ends, [0.125, 0.25, 0.375, 0.5, 0.75], "after four of them the next one is twice as long");
        strides = Strides::of(0.0);
        (0..3).for_each(|_| strides.halve());
        (0..4).for_each(|number| strides.advance(number != 2));
        assert_eq!(strides.aim().0, 0.625, "one of them was kept across a snap");
    }

    /// 1 % is taken in quarters, and no stride becomes longer, however often its stress is met. 100 % is taken in the shortest ones.
    #[test]
    fn large_increments_begin_with_shorter_strides() {
        let mut strides = Strides::of(0.01);
        let mut ends = Vec::new();
        while !strides.aim().1 {
            ends.push(strides.aim().0);
            strides.advance(true);
        }
        assert_eq!((ends, strides.is_cut()), (vec![0.25, 0.5, 0.75], false));
        assert_eq!(strides.next_increment().aim().0, 0.25);
        assert_eq!(Strides::of(0.002).aim(), (1.0, true));
        let shortest = Strides::of(1.0);
        assert_eq!((shortest.aim().0, shortest.is_shortest()), (1.0 / 32.0, true));
    }

    #[test]
    fn increments_that_need_no_strides_are_not_cut() {
        let strides = Strides::of(0.0).next_increment();
        assert_eq!((strides.aim(), strides.is_cut(), strides.is_shortest()), ((1.0, true), false, false));
    }
}
