//! Which grain pairs may touch: a sorted list of pairs closer than contact range plus a skin.
//!
//! The list is a cache. It always holds every touching pair and its order is fixed by the pair keys, so neither the
//! skin nor the moment of a rebuild can reach the result. Cells of any skew and size work, down to one grain that
//! touches its own images.

use super::periodic::Cell;
use crate::space::{Components, Discs, Space};

/// Identity of a pair: origin grain, end grain, cell shift of the end grain relative to the stored (never re-wrapped)
/// positions. Of the two ways to name a pair only `origin < end`, or the lexicographically positive shift when both are
/// one grain, is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PairKey<S: Space = Discs> {
    /// Origin grain O.
    pub origin: u32,
    /// End grain E.
    pub end: u32,
    /// Cell shifts of the end grain along the periodicity vectors.
    pub shift: S::Shift,
}

impl<S: Space> PairKey<S> {
    /// The one name of the pair that `origin`, `end`, `shift` describe.
    pub fn canonical(origin: u32, end: u32, shift: S::Shift) -> Self {
        if origin < end || (origin == end && shift > S::Shift::default()) {
            Self { origin, end, shift }
        } else {
            Self { origin: end, end: origin, shift: S::shift(|axis| -shift[axis]) }
        }
    }
}

/// Finds near pairs by sorting wrapped grains into bins of the fractional square or cube.
#[derive(Clone, Debug, Default)]
pub struct PairFinder<S: Space = Discs> {
    wrapped: Vec<(S::Vector, S::Shift)>,
    bin_of: Vec<S::Shift>,
    bin_start: Vec<u32>,
    members: Vec<u32>,
    found: Vec<PairKey<S>>,
    places: Vec<u32>,
}

impl<S: Space> PairFinder<S> {
    /// Fills `pairs` with every pair closer than the sum of its radii plus `skin`, sorted by key.
    pub fn find(
        &mut self,
        cell: &Cell<S>,
        positions: impl Iterator<Item = S::Vector>,
        radii: &[f64],
        skin: f64,
        pairs: &mut Vec<PairKey<S>>,
    ) {
        pairs.clear();
        let largest = radii.iter().fold(0.0, |largest: f64, radius| largest.max(*radius));
        let range = 2.0 * largest + skin;
        let widths = cell.widths();
        let most = share_of_bins((0..S::DIMENSION).map(|axis| bin_count(widths[axis], range)), radii.len());
        let bins = S::shift(|axis| ((f64::from(bin_count(widths[axis], range)) * most) as i32).max(1));
        // How many bins away a partner can be; more than one only in cells smaller than the range.
        let reach = S::shift(|axis| (range * f64::from(bins[axis]) / widths[axis]).ceil() as i32);
        let neighbours: i32 = (0..S::DIMENSION).map(|axis| 2 * reach[axis] + 1).product();
        self.sort_into_bins(cell, positions, bins);

        // One of each two opposite steps: a pair is met from one of its grains only.
        let steps: Vec<S::Shift> = (0..neighbours)
            .map(|neighbour| step_of::<S>(neighbour, reach))
            .filter(|step| *step >= S::Shift::default())
            .collect();
        self.found.clear();
        let mut first = 0;
        while first < self.members.len() {
            let home = self.bin_of[self.members[first] as usize];
            let next = self.bin_start[bin_number::<S>(home, bins) + 1] as usize;
            for step in &steps {
                let place = S::shift(|axis| home[axis] + step[axis]);
                let image = S::shift(|axis| image_of(place[axis], bins[axis]));
                let place = S::shift(|axis| place[axis] - image[axis] * bins[axis]);
                let translation = cell.translation(image);
                let bin = bin_number::<S>(place, bins);
                let partners = self.bin_start[bin] as usize..self.bin_start[bin + 1] as usize;
                let is_home = *step == S::Shift::default();
                for member in first..next {
                    let origin = self.members[member];
                    let (here, wraps) = self.wrapped[origin as usize];
                    let from = if is_home { member + 1 } else { partners.start };
                    for &end in &self.members[from..partners.end] {
                        let (there, end_wraps) = self.wrapped[end as usize];
                        let branch = there.plus(translation).minus(here);
                        let limit = radii[origin as usize] + radii[end as usize] + skin;
                        if branch.dot(branch) < limit * limit {
                            let shift = S::shift(|axis| image[axis] + wraps[axis] - end_wraps[axis]);
                            self.found.push(PairKey::canonical(origin, end, shift));
                        }
                    }
                }
            }
            first = next;
        }
        self.sort_by_key(radii.len(), pairs);
    }

    /// Puts what was found into `pairs`, sorted by key: first by origin in one pass, then the few pairs of each origin.
    fn sort_by_key(&mut self, grains: usize, pairs: &mut Vec<PairKey<S>>) {
        let Some(&any) = self.found.first() else { return };
        self.places.clear();
        self.places.resize(grains + 1, 0);
        for pair in &self.found {
            self.places[pair.origin as usize + 1] += 1;
        }
        for origin in 0..grains {
            self.places[origin + 1] += self.places[origin];
        }
        pairs.resize(self.found.len(), any);
        for pair in &self.found {
            let place = &mut self.places[pair.origin as usize];
            pairs[*place as usize] = *pair;
            *place += 1;
        }
        // Each entry is now the end of its origin's pairs.
        let mut begin = 0;
        for &end in &self.places[..grains] {
            pairs[begin..end as usize].sort_unstable();
            begin = end as usize;
        }
    }

    fn sort_into_bins(&mut self, cell: &Cell<S>, positions: impl Iterator<Item = S::Vector>, bins: S::Shift) {
        self.wrapped.clear();
        self.bin_of.clear();
        self.bin_start.clear();
        let count: i32 = (0..S::DIMENSION).map(|axis| bins[axis]).product();
        self.bin_start.resize(count as usize + 1, 0);
        for position in positions {
            let (inside, shift) = cell.wrapped(position);
            let fraction = cell.fractional(inside);
            let home =
                S::shift(|axis| ((fraction[axis] * f64::from(bins[axis])).floor() as i32).clamp(0, bins[axis] - 1));
            self.bin_start[bin_number::<S>(home, bins) + 1] += 1;
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
            let bin = bin_number::<S>(self.bin_of[grain], bins) + 1;
            self.bin_start[bin] -= 1;
            self.members[self.bin_start[bin] as usize] = grain as u32;
        }
        // Now entry `bin + 1` holds the first member of `bin`: shift down and close the last bin.
        self.bin_start.rotate_left(1);
        *self.bin_start.last_mut().expect("at least one bin") = self.wrapped.len() as u32;
    }
}

/// Most bins along one side: a cell that is huge against its grains must not need a huge table.
const MOST_BINS: f64 = 1024.0;

/// Bins along one side, each at least one range wide. The tiny margin keeps rounding at a bin's edge harmless.
fn bin_count(width: f64, range: f64) -> i32 {
    ((width / (range * (1.0 + 1e-9))).floor().min(MOST_BINS) as i32).max(1)
}

/// Bins of all sides together that a grain may have, and those of few grains.
const BINS_PER_GRAIN: f64 = 8.0;
const FEWEST_BINS: f64 = 4096.0;

/// Share of the bins along each side that keeps their table in proportion to the grains: wider bins find the same pairs.
fn share_of_bins(counts: impl ExactSizeIterator<Item = i32>, grains: usize) -> f64 {
    let sides = counts.len() as f64;
    let all: f64 = counts.map(f64::from).product();
    let most = FEWEST_BINS.max(BINS_PER_GRAIN * grains as f64);
    if all > most { (most / all).powf(1.0 / sides) } else { 1.0 }
}

/// In which image of the cell a bin lies. Nearly always in the cell itself: a division less.
fn image_of(place: i32, bins: i32) -> i32 {
    if (0..bins).contains(&place) { 0 } else { place.div_euclid(bins) }
}

/// Number of a bin in the table.
fn bin_number<S: Space>(place: S::Shift, bins: S::Shift) -> usize {
    let mut number = place[0];
    for axis in 1..S::DIMENSION {
        number = number * bins[axis] + place[axis];
    }
    number as usize
}

/// Steps along each axis from a bin to one of its neighbours, which are numbered from 0.
fn step_of<S: Space>(neighbour: i32, reach: S::Shift) -> S::Shift {
    let mut rest = neighbour;
    S::shift(|axis| {
        let sides = 2 * reach[axis] + 1;
        let step = rest % sides - reach[axis];
        rest /= sides;
        step
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Spheres;
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
            let cell = Cell::<Discs> { rows: [[side, 0.1], [skew, height]] };
            prop_assume!(cell.measure() > 0.3);
            let positions: Vec<[f64; 2]> = points
                .iter()
                .map(|p| [p.0 * side + p.1 * skew, p.1 * height])
                .collect();
            let radii: Vec<f64> = points.iter().map(|p| p.2).collect();
            let mut pairs = Vec::new();
            PairFinder::<Discs>::default().find(&cell, positions.iter().copied(), &radii, 0.07, &mut pairs);
            prop_assert_eq!(pairs, brute_force(&cell, &positions, &radii, 0.07));
        }
    }

    #[test]
    fn one_grain_of_a_triangular_lattice_has_three_pairs_with_itself() {
        let cell = Cell::<Discs> { rows: [[1.0, 0.0], [0.5, 0.75f64.sqrt()]] };
        let mut pairs = Vec::new();
        PairFinder::<Discs>::default().find(&cell, std::iter::once([0.3, 0.2]), &[0.51], 0.01, &mut pairs);
        let shifts: Vec<[i32; 2]> = pairs.iter().map(|pair| pair.shift).collect();
        assert_eq!(shifts, [[0, 1], [1, -1], [1, 0]]);
    }

    /// The table is in proportion to the grains, not to the cell.
    #[test]
    fn a_cell_that_is_huge_against_its_grains_has_a_small_table() {
        let cell = Cell::<Spheres> { rows: [[900.0, 0.0, 0.0], [0.0, 900.0, 0.0], [0.0, 0.0, 900.0]] };
        let (mut finder, mut pairs) = (PairFinder::<Spheres>::default(), Vec::new());
        let positions = [[0.2, 0.2, 899.9], [0.2, 0.2, 0.5]];
        finder.find(&cell, positions.into_iter(), &[0.5, 0.5], 0.01, &mut pairs);
        assert_eq!(pairs, [PairKey { origin: 0, end: 1, shift: [0, 0, 1] }]);
        assert!(finder.bin_start.len() < 10_000, "{} bins", finder.bin_start.len());
    }

    fn brute_force_in_space(
        cell: &Cell<Spheres>,
        positions: &[[f64; 3]],
        radii: &[f64],
        skin: f64,
    ) -> Vec<PairKey<Spheres>> {
        let mut pairs = Vec::new();
        for i in 0..positions.len() {
            for j in i..positions.len() {
                for number in 0..15 * 15 * 15 {
                    let shift = [number / 225 - 7, number / 15 % 15 - 7, number % 15 - 7];
                    if i == j && shift <= [0; 3] {
                        continue;
                    }
                    let branch = positions[j].plus(cell.translation(shift)).minus(positions[i]);
                    if branch.norm() < radii[i] + radii[j] + skin {
                        pairs.push(PairKey { origin: i as u32, end: j as u32, shift });
                    }
                }
            }
        }
        pairs.sort_unstable();
        pairs
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn bins_find_what_brute_force_finds_in_space(
            sides in proptest::array::uniform3(0.9..5.0f64), skews in proptest::array::uniform3(-1.0..1.0f64),
            points in proptest::collection::vec((proptest::array::uniform3(-1.0..2.0f64), 0.2..0.6f64), 1..6),
        ) {
            let cell =
                Cell::<Spheres> { rows: [[sides[0], 0.1, 0.0], [skews[0], sides[1], -0.1], [skews[1], skews[2], sides[2]]] };
            prop_assume!(cell.widths().iter().all(|width| *width > 0.6));
            let positions: Vec<[f64; 3]> = points
                .iter()
                .map(|(p, _)| (0..3).fold([0.0; 3], |sum, row| sum.plus(cell.rows[row].times(p[row]))))
                .collect();
            let radii: Vec<f64> = points.iter().map(|(_, radius)| *radius).collect();
            let mut pairs = Vec::new();
            PairFinder::default().find(&cell, positions.iter().copied(), &radii, 0.07, &mut pairs);
            prop_assert_eq!(pairs, brute_force_in_space(&cell, &positions, &radii, 0.07));
        }
    }

    #[test]
    fn one_sphere_of_a_face_centred_lattice_has_six_pairs_with_itself() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let cell = Cell::<Spheres> { rows: [[0.0, half, half], [half, 0.0, half], [half, half, 0.0]] };
        let mut pairs = Vec::new();
        PairFinder::default().find(&cell, std::iter::once([0.3, 0.2, 0.1]), &[0.51], 0.01, &mut pairs);
        assert_eq!(pairs.len(), 6);
    }
}
