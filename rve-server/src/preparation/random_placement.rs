//! Random places without overlap: what a preparation starts from.

use super::recipe::PackingRecipe;
use crate::definition::{PackingError, PackingFile};
use crate::space::{Components, Space, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Solid fraction of the random places in the plane and in space: sparse enough that sequential insertion never jams.
const START_SOLID_FRACTION: [f64; 2] = [0.45, 0.28];

/// Places tried for one grain before giving up.
const PLACES_PER_GRAIN: u32 = 100_000;

/// Grains at random places in a box of the recipe's aspect, largest grains first.
///
/// # Errors
/// [`PackingError::Content`] if the grains do not fit.
pub(crate) fn scattered<S: Space>(recipe: &PackingRecipe) -> Result<PackingFile<S>, PackingError> {
    let radii = recipe.radii();
    let solid: f64 = radii.iter().map(|radius| S::grain_measure(*radius)).sum();
    let volume = solid / START_SOLID_FRACTION[S::DIMENSION - 2];
    let side = if S::DIMENSION == 2 { volume.sqrt() } else { volume.cbrt() };
    let shape = recipe.aspect.clone().unwrap_or_else(|| vec![1.0; S::DIMENSION]);
    let mean = shape.iter().product::<f64>().powf(1.0 / S::DIMENSION as f64);
    let sides = S::Vector::from_fn(|axis| if recipe.aspect.is_some() { side * shape[axis] / mean } else { side });
    let mut order: Vec<usize> = (0..radii.len()).collect();
    order.sort_by(|a, b| radii[*b].total_cmp(&radii[*a]));
    let mut random = ChaCha8Rng::seed_from_u64(recipe.seed);
    let mut placed = PlacedGrains::<S>::new(sides, radii.iter().copied().fold(0.0, f64::max));
    for grain in order {
        let radius = radii[grain];
        let place = (0..PLACES_PER_GRAIN)
            .map(|_| S::Vector::from_fn(|axis| sides[axis] * unit_interval(&mut random)))
            .find(|place| placed.leaves_room(*place, radius))
            .ok_or_else(|| {
                PackingError::Content("the grains do not fit at random; the grading is too wide".into())
            })?;
        placed.add(S::grain(place, radius));
    }
    let periodicity = S::Tensor::from_fn(|i, j| if i == j { sides[i] } else { 0.0 });
    Ok(PackingFile { thickness: recipe.thickness, ..PackingFile::<S>::new(periodicity, placed.grains) })
}

/// Grains in a periodic box, sorted into bins at least as wide as the largest of them.
struct PlacedGrains<S: Space> {
    sides: S::Vector,
    grains: Vec<S::Grain>,
    /// Bins along each axis; a third one stands for the axis that the plane lacks.
    counts: [usize; 3],
    /// Numbers of the grains of each bin.
    bins: Vec<Vec<usize>>,
}

impl<S: Space> PlacedGrains<S> {
    /// Most bins along an axis: more would take memory and find no pair sooner.
    const MOST_BINS: f64 = 128.0;

    fn new(sides: S::Vector, largest_radius: f64) -> Self {
        let along = |axis: usize| (sides[axis] / (2.0 * largest_radius)).floor().clamp(1.0, Self::MOST_BINS) as usize;
        let counts = std::array::from_fn(|axis| if axis < S::DIMENSION { along(axis) } else { 1 });
        Self { sides, grains: Vec::new(), counts, bins: vec![Vec::new(); counts.iter().product()] }
    }

    /// Bin along each axis of a place in the box.
    fn bin(&self, place: S::Vector) -> [usize; 3] {
        std::array::from_fn(|axis| {
            if axis >= S::DIMENSION {
                return 0;
            }
            let count = self.counts[axis];
            ((place[axis] / self.sides[axis] * count as f64) as usize).min(count - 1)
        })
    }

    /// Whether a grain overlaps none that has been placed.
    fn leaves_room(&self, place: S::Vector, radius: f64) -> bool {
        let bin = self.bin(place);
        let near = |axis: usize| {
            let (count, own) = (self.counts[axis], bin[axis]);
            // With up to three bins all of them are near, each once.
            if count <= 3 { (0, count) } else { (own + count - 1, 3) }
        };
        let [(x, along_x), (y, along_y), (z, along_z)] = [near(0), near(1), near(2)];
        let [count_x, count_y, count_z] = self.counts;
        (0..along_x).all(|i| {
            (0..along_y).all(|j| {
                (0..along_z).all(|k| {
                    let bin = ((x + i) % count_x * count_y + (y + j) % count_y) * count_z + (z + k) % count_z;
                    self.bins[bin].iter().all(|&other| !overlap::<S>(self.sides, place, radius, &self.grains[other]))
                })
            })
        })
    }

    fn add(&mut self, grain: S::Grain) {
        let [x, y, z] = self.bin(S::Vector::from_fn(|axis| grain[axis]));
        let [_, count_y, count_z] = self.counts;
        self.bins[(x * count_y + y) * count_z + z].push(self.grains.len());
        self.grains.push(grain);
    }
}

/// `count` different numbers below `number`, ascending.
pub(crate) fn chosen(number: usize, count: usize, seed: u64) -> Vec<usize> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut left: Vec<usize> = (0..number).collect();
    let mut taken: Vec<usize> = (0..count.min(number))
        .map(|_| {
            let place = (unit_interval(&mut random) * left.len() as f64) as usize;
            left.swap_remove(place)
        })
        .collect();
    taken.sort_unstable();
    taken
}

fn overlap<S: Space>(sides: S::Vector, place: S::Vector, radius: f64, other: &S::Grain) -> bool {
    let between = S::Vector::from_fn(|axis| {
        let difference = place[axis] - other[axis];
        difference - sides[axis] * (difference / sides[axis]).round()
    });
    between.dot(between) < (radius + S::radius(other)).powi(2)
}

/// 53 random bits as a number in [0, 1).
fn unit_interval(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Discs, Spheres};

    /// Bins find what a look at all grains finds, whatever their number along an axis.
    fn bins_find_all_overlaps<S: Space>() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut refused = 0;
        for widths in [[0.9, 0.9, 0.9], [2.5, 1.0, 4.1], [7.3, 3.4, 2.2]] {
            let sides = S::Vector::from_fn(|axis| widths[axis]);
            let mut placed = PlacedGrains::<S>::new(sides, 0.2);
            for _ in 0..400 {
                let place = S::Vector::from_fn(|axis| sides[axis] * unit_interval(&mut random));
                let radius = 0.02 + 0.18 * unit_interval(&mut random);
                let has_room = placed.grains.iter().all(|other| !overlap::<S>(sides, place, radius, other));
                assert_eq!(placed.leaves_room(place, radius), has_room, "{place:?}");
                refused += usize::from(!has_room);
                if has_room {
                    placed.add(S::grain(place, radius));
                }
            }
        }
        assert!(refused > 100, "{refused}");
    }

    #[test]
    fn bins_find_all_overlaps_of_discs_and_spheres() {
        bins_find_all_overlaps::<Discs>();
        bins_find_all_overlaps::<Spheres>();
    }

    #[test]
    fn chosen_numbers_differ_and_repeat_with_their_seed() {
        let taken = chosen(100, 25, 7);
        assert!(taken.len() == 25 && taken.windows(2).all(|pair| pair[0] < pair[1]) && taken[24] < 100);
        assert_eq!(chosen(100, 25, 7), taken);
        assert_ne!(chosen(100, 25, 8), taken);
        assert_eq!(chosen(3, 3, 1), [0, 1, 2]);
    }
}
