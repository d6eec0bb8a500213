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
    let mut placed: Vec<S::Grain> = Vec::with_capacity(radii.len());
    for grain in order {
        let radius = radii[grain];
        let place = (0..PLACES_PER_GRAIN)
            .map(|_| S::Vector::from_fn(|axis| sides[axis] * unit_interval(&mut random)))
            .find(|place| placed.iter().all(|other| !overlap::<S>(sides, *place, radius, other)))
            .ok_or_else(|| {
                PackingError::Content("the grains do not fit at random; the grading is too wide".into())
            })?;
        placed.push(S::grain(place, radius));
    }
    let periodicity = S::Tensor::from_fn(|i, j| if i == j { sides[i] } else { 0.0 });
    Ok(PackingFile { thickness: recipe.thickness, ..PackingFile::<S>::new(periodicity, placed) })
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

    #[test]
    fn chosen_numbers_differ_and_repeat_with_their_seed() {
        let taken = chosen(100, 25, 7);
        assert!(taken.len() == 25 && taken.windows(2).all(|pair| pair[0] < pair[1]) && taken[24] < 100);
        assert_eq!(chosen(100, 25, 7), taken);
        assert_ne!(chosen(100, 25, 8), taken);
        assert_eq!(chosen(3, 3, 1), [0, 1, 2]);
    }
}
