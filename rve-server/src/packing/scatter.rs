//! Random places without overlap: what a preparation starts from.

use crate::packing::recipe::PackingRecipe;
use crate::packing::{PackingError, PackingFile};
use crate::space::Discs;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Solid fraction of the random places: sparse enough that sequential insertion never jams.
const START_SOLID_FRACTION: f64 = 0.45;

/// Places tried for one grain before giving up.
const PLACES_PER_GRAIN: u32 = 100_000;

/// Grains at random places in a box of the recipe's aspect, largest grains first.
///
/// # Errors
/// [`PackingError::Content`] if the grains do not fit.
pub(crate) fn scattered(recipe: &PackingRecipe) -> Result<PackingFile, PackingError> {
    let radii = recipe.radii();
    let solid: f64 = radii.iter().map(|radius| std::f64::consts::PI * radius * radius).sum();
    let side = (solid / START_SOLID_FRACTION).sqrt();
    let sides = match recipe.aspect.as_deref() {
        Some([first, second]) => [side * (first / second).sqrt(), side * (second / first).sqrt()],
        _ => [side, side],
    };
    let mut order: Vec<usize> = (0..radii.len()).collect();
    order.sort_by(|a, b| radii[*b].total_cmp(&radii[*a]));
    let mut random = ChaCha8Rng::seed_from_u64(recipe.seed);
    let mut placed: Vec<[f64; 3]> = Vec::with_capacity(radii.len());
    for grain in order {
        let radius = radii[grain];
        let place = (0..PLACES_PER_GRAIN)
            .map(|_| [sides[0] * unit_interval(&mut random), sides[1] * unit_interval(&mut random)])
            .find(|place| placed.iter().all(|other| !overlap(sides, *place, radius, other)))
            .ok_or_else(|| {
                PackingError::Content("the grains do not fit at random; the grading is too wide".into())
            })?;
        placed.push([place[0], place[1], radius]);
    }
    Ok(PackingFile::<Discs> {
        format: PackingFile::FORMAT.into(),
        version: PackingFile::VERSION,
        dimension: 2,
        thickness: recipe.thickness,
        periodicity: [[sides[0], 0.0], [0.0, sides[1]]],
        grains: placed,
        contacts: Vec::new(),
        provenance: serde_json::Value::Null,
    })
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

fn overlap(sides: [f64; 2], place: [f64; 2], radius: f64, other: &[f64; 3]) -> bool {
    let nearest = |difference: f64, side: f64| difference - side * (difference / side).round();
    let (dx, dy) = (nearest(place[0] - other[0], sides[0]), nearest(place[1] - other[1], sides[1]));
    dx * dx + dy * dy < (radius + other[2]).powi(2)
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
