//! Which grain pairs may touch: a sorted list of pairs closer than contact range plus a skin.
//!
//! The list is a cache. It always holds every touching pair and its order is fixed by the pair keys, so neither the
//! skin nor the moment of a rebuild can reach the result. Cells of any skew and size work, down to one grain that
//! touches its own images.

use crate::cell::Cell;

/// Identity of a pair: origin grain, end grain, cell shift of the end grain relative to the stored (never re-wrapped)
/// positions. Of the two ways to name a pair only `origin < end`, or the lexicographically positive shift when both are
/// one grain, is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PairKey {
    /// Origin grain O.
    pub origin: u32,
    /// End grain E.
    pub end: u32,
    /// Cell shifts of the end grain along Y1 and Y2.
    pub shift: [i32; 2],
}

impl PairKey {
    /// The one name of the pair that `origin`, `end`, `shift` describe.
    pub fn canonical(origin: u32, end: u32, shift: [i32; 2]) -> Self {
        if origin < end || (origin == end && shift > [0, 0]) {
            Self { origin, end, shift }
        } else {
            Self { origin: end, end: origin, shift: [-shift[0], -shift[1]] }
        }
    }
}

/// Finds near pairs by sorting wrapped grains into bins of the fractional square.
#[derive(Clone, Debug, Default)]
pub struct PairFinder {
    wrapped: Vec<([f64; 2], [i32; 2])>,
    bin_of: Vec<[i32; 2]>,
    bin_start: Vec<u32>,
    members: Vec<u32>,
    found: Vec<PairKey>,
}

impl PairFinder {
    /// Fills `pairs` with every pair closer than the sum of its radii plus `skin`, sorted by key.
    pub fn find(
        &mut self,
        cell: &Cell,
        positions: impl Iterator<Item = [f64; 2]>,
        radii: &[f64],
        skin: f64,
        pairs: &mut Vec<PairKey>,
    ) {
        pairs.clear();
        let largest = radii.iter().fold(0.0, |largest: f64, radius| largest.max(*radius));
        let range = 2.0 * largest + skin;
        let widths = cell.widths();
        let bins = [bin_count(widths[0], range), bin_count(widths[1], range)];
        // How many bins away a partner can be; more than one only in cells smaller than the range.
        let reach = [
            (range * f64::from(bins[0]) / widths[0]).ceil() as i32,
            (range * f64::from(bins[1]) / widths[1]).ceil() as i32,
        ];
        self.sort_into_bins(cell, positions, bins);

        for origin in 0..radii.len() {
            self.found.clear();
            let (here, wraps) = self.wrapped[origin];
            let home = self.bin_of[origin];
            for step_1 in -reach[0]..=reach[0] {
                let (image_1, bin_1) = periodic(home[0] + step_1, bins[0]);
                for step_2 in -reach[1]..=reach[1] {
                    let (image_2, bin_2) = periodic(home[1] + step_2, bins[1]);
                    let translation = cell.translation([image_1, image_2]);
                    let bin = (bin_1 * bins[1] + bin_2) as usize;
                    let (from, to) = (self.bin_start[bin] as usize, self.bin_start[bin + 1] as usize);
                    for &end in &self.members[from..to] {
                        if (end as usize) < origin {
                            continue;
                        }
                        let (there, end_wraps) = self.wrapped[end as usize];
                        let branch = [there[0] + translation[0] - here[0], there[1] + translation[1] - here[1]];
                        let limit = radii[origin] + radii[end as usize] + skin;
                        if branch[0] * branch[0] + branch[1] * branch[1] >= limit * limit {
                            continue;
                        }
                        let shift = [image_1 + wraps[0] - end_wraps[0], image_2 + wraps[1] - end_wraps[1]];
                        if end as usize == origin && shift <= [0, 0] {
                            continue;
                        }
                        self.found.push(PairKey { origin: origin as u32, end, shift });
                    }
                }
            }
            self.found.sort_unstable();
            pairs.extend_from_slice(&self.found);
        }
    }

    fn sort_into_bins(&mut self, cell: &Cell, positions: impl Iterator<Item = [f64; 2]>, bins: [i32; 2]) {
        self.wrapped.clear();
        self.bin_of.clear();
        self.bin_start.clear();
        self.bin_start.resize((bins[0] * bins[1] + 1) as usize, 0);
        for position in positions {
            let (inside, shift) = cell.wrapped(position);
            let fraction = cell.fractional(inside);
            let bin =
                |axis: usize| ((fraction[axis] * f64::from(bins[axis])).floor() as i32).clamp(0, bins[axis] - 1);
            let home = [bin(0), bin(1)];
            self.bin_start[(home[0] * bins[1] + home[1] + 1) as usize] += 1;
            self.wrapped.push((inside, shift));
            self.bin_of.push(home);
        }
        for bin in 1..self.bin_start.len() {
            self.bin_start[bin] += self.bin_start[bin - 1];
        }
        // Filling from the back leaves `bin_start` at the first member of each bin.
        self.members.clear();
        self.members.resize(self.wrapped.len(), 0);
        for grain in (0..self.wrapped.len()).rev() {
            let home = self.bin_of[grain];
            let bin = (home[0] * bins[1] + home[1] + 1) as usize;
            self.bin_start[bin] -= 1;
            self.members[self.bin_start[bin] as usize] = grain as u32;
        }
        // Now entry `bin + 1` holds the first member of `bin`: shift down and close the last bin.
        self.bin_start.rotate_left(1);
        *self.bin_start.last_mut().expect("at least one bin") = self.wrapped.len() as u32;
    }
}

/// Bins along one side, each at least one range wide. The tiny margin keeps rounding at a bin's edge harmless.
fn bin_count(width: f64, range: f64) -> i32 {
    ((width / (range * (1.0 + 1e-9))).floor() as i32).max(1)
}

/// Periodic image and bin of a bin number that may lie outside the cell.
fn periodic(bin: i32, count: i32) -> (i32, i32) {
    (bin.div_euclid(count), bin.rem_euclid(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(cell: &Cell, positions: &[[f64; 2]], radii: &[f64], skin: f64) -> Vec<PairKey> {
        let mut pairs = Vec::new();
        for i in 0..positions.len() {
            for j in i..positions.len() {
                for first in -40..=40 {
                    for second in -40..=40 {
                        if i == j && [first, second] <= [0, 0] {
                            continue;
                        }
                        let shift = cell.translation([first, second]);
                        let branch = [
                            positions[j][0] + shift[0] - positions[i][0],
                            positions[j][1] + shift[1] - positions[i][1],
                        ];
                        if branch[0].hypot(branch[1]) < radii[i] + radii[j] + skin {
                            pairs.push(PairKey { origin: i as u32, end: j as u32, shift: [first, second] });
                        }
                    }
                }
            }
        }
        pairs.sort_unstable();
        pairs
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn bins_find_what_brute_force_finds(
            side in 0.5..9.0f64, height in 0.5..9.0f64, skew in -2.0..2.0f64,
            points in proptest::collection::vec((-2.0..3.0f64, -2.0..3.0f64, 0.2..0.6f64), 1..12),
        ) {
            let cell = Cell { rows: [[side, 0.1], [skew, height]] };
            prop_assume!(cell.area() > 0.3);
            let positions: Vec<[f64; 2]> = points
                .iter()
                .map(|p| [p.0 * side + p.1 * skew, p.1 * height])
                .collect();
            let radii: Vec<f64> = points.iter().map(|p| p.2).collect();
            let mut pairs = Vec::new();
            PairFinder::default().find(&cell, positions.iter().copied(), &radii, 0.07, &mut pairs);
            prop_assert_eq!(pairs, brute_force(&cell, &positions, &radii, 0.07));
        }
    }

    #[test]
    fn one_grain_of_a_triangular_lattice_has_three_pairs_with_itself() {
        let cell = Cell { rows: [[1.0, 0.0], [0.5, 0.75f64.sqrt()]] };
        let mut pairs = Vec::new();
        PairFinder::default().find(&cell, std::iter::once([0.3, 0.2]), &[0.51], 0.01, &mut pairs);
        let shifts: Vec<[i32; 2]> = pairs.iter().map(|pair| pair.shift).collect();
        assert_eq!(shifts, [[0, 1], [1, -1], [1, 0]]);
    }
}
