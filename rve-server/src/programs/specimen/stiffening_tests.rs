//! Hertz contacts become stiffer as they are pressed: masses and steps follow them, from contacts that only just touch on.

use super::body::Body;
use super::contact::Grain;
use super::dynamics::{Dynamics, Motion};
use super::tests::still;
use super::wall::{Wall, WallDrive};
use crate::contact::{HertzSprings, PlainHertzMindlin, RollingSpring, TangentialUnloading};
use crate::space::Spheres;

const RADIUS: f64 = 0.01;
const COUNT: usize = 6;
const STEPS: u64 = 2000;
const STRAIN: f64 = 4e-3;

/// A row of spheres between two walls, pressed together by [`STRAIN`] from relative overlaps of `overlap`: energy that is missing over all
/// that was turned over.
fn missing_after_compression(overlap: f64, scaled_masses: bool) -> f64 {
    let law = PlainHertzMindlin {
        springs: HertzSprings { shear_modulus: 2.9e10, poisson_ratio: 0.15 },
        friction: 0.5,
        cohesion: 0.0,
        unloading: TangentialUnloading::Rescaled,
        rolling: RollingSpring::default(),
        viscosity: 0.0,
    };
    let distance = 2.0 * RADIUS * (1.0 - overlap);
    let grains = (0..COUNT).map(|number| Grain::<Spheres> {
        position: [distance * (number as f64 + 0.5), 0.0, 0.0],
        velocity: [0.0; 3],
        spin: [0.0; 3],
        radius: RADIUS,
    });
    let length = COUNT as f64 * distance;
    let wall = |name: &str, place: f64, normal: f64| {
        Wall::new(name, [place, 0.0, 0.0], [normal, 0.0, 0.0], law, WallDrive::Velocity(0.0), 0.0)
    };
    let body = Body::new(law, grains.collect(), vec![0.011; COUNT], 0.0, [None; 3]);
    let walls = vec![wall("left", 0.0, 1.0), wall("right", length, -1.0)];
    let motion = Motion { safety: 0.3, scaled_masses, local_damping: 0.2, ..still() };
    let mut dynamics = Dynamics::new(body, walls, motion);
    dynamics.expect_strain(STRAIN / STEPS as f64);
    for _ in 0..STEPS {
        let speed = 0.5 * STRAIN * length / STEPS as f64 / dynamics.step;
        dynamics.walls.iter_mut().for_each(|wall| wall.drive = WallDrive::Velocity(speed));
        dynamics.advance();
    }
    assert!(dynamics.contacts.largest_overlap > 1e-3, "{}", dynamics.contacts.largest_overlap);
    dynamics.missing_energy().abs() / dynamics.energy_turnover()
}

#[test]
fn spheres_that_hardly_touch_are_pressed_together_without_losing_energy() {
    for scaled_masses in [true, false] {
        for overlap in [0.0, 1e-7, 1e-5, 1e-3] {
            let missing = missing_after_compression(overlap, scaled_masses);
            assert!(missing < 5e-3, "overlap {overlap:e}, scaled masses {scaled_masses}: {missing}");
        }
    }
}
