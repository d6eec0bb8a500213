//! Points sorted into cubes, to find those within a radius without looking at all of them.

use std::collections::BTreeMap;

/// Points in cubes of one radius side: whatever lies within the radius of a place is in the cube of the place or in one
/// of the 26 around it.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    side: f64,
    cubes: BTreeMap<[i64; 3], Vec<usize>>,
    positions: Vec<[f64; 3]>,
}

impl Bins {
    /// Sorts points into cubes of side `radius`, m.
    pub(super) fn new(positions: Vec<[f64; 3]>, radius: f64) -> Self {
        let mut cubes: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for (number, position) in positions.iter().enumerate() {
            cubes.entry(cube(position, radius)).or_default().push(number);
        }
        Self { side: radius, cubes, positions }
    }

    /// Numbers of the points in and around the cube of `place`, each once: a superset of those within the radius.
    pub(super) fn around(&self, place: &[f64; 3]) -> impl Iterator<Item = usize> {
        let home = cube(place, self.side);
        let steps = -1..=1;
        let near = steps.clone().flat_map(move |x| {
            let steps = -1..=1;
            steps.flat_map(move |y| (-1..=1).map(move |z| [home[0] + x, home[1] + y, home[2] + z]))
        });
        near.filter_map(|cube| self.cubes.get(&cube)).flatten().copied()
    }

    /// Position of a point, m.
    pub(super) fn position(&self, number: usize) -> &[f64; 3] {
        &self.positions[number]
    }
}

fn cube(position: &[f64; 3], side: f64) -> [i64; 3] {
    position.map(|value| (value / side).floor() as i64)
}
