//! What elastic grains keep: energy, momentum and angular momentum.

use super::SpecimenSpace;
use super::body::Body;
use super::contact::Grain;
use super::dynamics::Dynamics;
use super::gas::drift;
use super::tests::{MASS, RADIUS, floor, law, still, vector};
use super::wall::{Wall, WallDrive};
use crate::contact::PlainLinear;
use crate::simd::Tuple;
use crate::space::{Discs, Spheres};
use claims::Claim;
use nalgebra::Vector3;

const FRICTION: f64 = 0.4;
const SPEED: f64 = 1.0;

/// A coordinate vector in space.
fn wide<S: SpecimenSpace>(coordinates: S::Coordinates<f64>) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| coordinates.as_ref().get(axis).copied().unwrap_or(0.0))
}

/// An axial vector in space; that of a plane stands upright on it.
fn upright<S: SpecimenSpace>(axial: S::Axial<f64>) -> Vector3<f64> {
    match axial.as_ref() {
        [only] => Vector3::new(0.0, 0.0, *only),
        all => Vector3::from_column_slice(all),
    }
}

/// Momentum, kg m/s, angular momentum about the origin, kg m2/s, and the sums of the sizes of both.
fn momenta<S: SpecimenSpace>(dynamics: &Dynamics<S, PlainLinear>) -> ([Vector3<f64>; 2], [f64; 2]) {
    let (mut sums, mut sizes) = ([Vector3::zeros(); 2], [0.0; 2]);
    for (number, grain) in dynamics.body.grains.iter().enumerate() {
        let mass = dynamics.mass(number);
        let inertia = S::INERTIA_FACTOR * mass * grain.radius * grain.radius;
        let momentum = mass * wide::<S>(grain.velocity);
        let orbit = wide::<S>(grain.position).cross(&momentum);
        let own = inertia * upright::<S>(grain.spin);
        sums = [sums[0] + momentum, sums[1] + orbit + own];
        sizes = [sizes[0] + momentum.norm(), sizes[1] + orbit.norm() + own.norm()];
    }
    (sums, sizes)
}

/// Grains of three sizes on a grid around the origin, flying at each other while they spin.
fn swarm<S: SpecimenSpace>(side: usize, centre: [f64; 3]) -> Body<S, PlainLinear> {
    let count = side.pow(S::DIMENSION as u32);
    let place = |number: usize, axis: usize| {
        let step = number / side.pow(axis as u32) % side;
        (step as f64 - 0.5 * (side - 1) as f64) * 2.35 * RADIUS
    };
    let grains: Vec<Grain<S>> = (0..count)
        .map(|number| {
            let lead = Vector3::from_fn(|axis, _| if axis < S::DIMENSION { place(number, axis) } else { 0.0 });
            let inwards = -SPEED / (2.0 * RADIUS) * lead;
            let sideways = Vector3::new(0.3 * inwards.y, -0.2 * inwards.x, 0.1 * inwards.x);
            Grain {
                position: vector::<S>((lead + Vector3::from(centre)).into()),
                velocity: vector::<S>((inwards + sideways).into()),
                spin: <S::Axial<f64>>::build(|axis| 40.0 * ((3 * number + axis) % 5) as f64 - 60.0),
                radius: RADIUS * [0.9, 1.0, 1.1][number % 3],
            }
        })
        .collect();
    let masses = (0..count).map(|number| MASS * [0.8, 1.0, 1.3][number % 3]).collect();
    Body::new(law(FRICTION), grains, masses, 0.0, [None; 3])
}

/// B-3: grains that rub against each other keep their momentum and, because the two arms of a contact add up to its
/// branch, their angular momentum.
#[test]
fn collisions_with_friction_keep_both_momenta() {
    fn check<S: SpecimenSpace>(side: usize, grains: &str) {
        let mut dynamics = Dynamics::new(swarm::<S>(side, [0.02, -0.03, 0.01]), Vec::new(), still());
        let (before, _) = momenta(&dynamics);
        let mut busiest = 0;
        for _ in 0..3000 {
            dynamics.advance();
            busiest = busiest.max(dynamics.contacts.contacts);
        }
        assert!(busiest > 8 && dynamics.contacts.contacts < busiest, "{busiest} contacts at most");
        assert!(dynamics.works[0] > 0.0, "friction has worked");
        let (missing, turnover) = (dynamics.missing_energy(), dynamics.energy_turnover());
        assert!(missing.abs() < 1e-2 * turnover, "{missing:e} J of {turnover:e} J are missing");
        let (after, [linear, angular]) = momenta(&dynamics);
        let change = [0, 1].map(|kind: usize| (after[kind] - before[kind]).norm());
        let quantity = format!("momentum that {grains} with friction gain, over the sum of its sizes");
        Claim::of("B-3", &quantity).error(change[0] / linear).within(1e-12);
        let quantity = format!("angular momentum that {grains} with friction gain, over the sum of its sizes");
        Claim::of("B-3", &quantity).error(change[1] / angular).within(1e-10);
    }
    check::<Discs>(5, "25 discs");
    check::<Spheres>(3, "27 spheres");
}

/// B-3: in a closed box the momentum changes by what the walls give and by nothing else.
#[test]
fn in_a_closed_box_the_walls_alone_change_the_momentum() {
    let room = 0.16;
    let body = swarm::<Discs>(5, [0.5 * room, 0.5 * room, 0.0]);
    let wall = |point: [f64; 2], normal: [f64; 2]| {
        Wall::new("side", point, normal, law(FRICTION), WallDrive::Velocity(0.0), 0.0)
    };
    let walls = vec![
        floor::<Discs>(FRICTION, 0.0),
        wall([0.0, room], [0.0, -1.0]),
        wall([0.0, 0.0], [1.0, 0.0]),
        wall([room, 0.0], [-1.0, 0.0]),
    ];
    let mut dynamics = Dynamics::new(body, walls, still());
    let (before, _) = momenta(&dynamics);
    let (mut impulse, mut size) = (Vector3::zeros(), 0.0);
    for _ in 0..16_000 {
        for wall in &dynamics.walls {
            let given = -dynamics.step * wide::<Discs>(wall.force);
            (impulse, size) = (impulse + given, size + given.norm());
        }
        dynamics.advance();
    }
    let (after, [linear, _]) = momenta(&dynamics);
    assert!(size > linear, "impulses of {size} against a momentum of {linear}");
    let open = (after[0] - before[0] - impulse).norm();
    let quantity = "momentum in a closed box that the impulses of its walls leave open, over both sizes";
    Claim::of("B-3", quantity).error(open / (linear + size)).within(1e-12);
}

/// B-2, the first 60 000 steps; a million are in the release suite.
#[test]
fn energy_of_a_smooth_elastic_gas_stays() {
    let drift = drift(60_000);
    assert!(drift.busy > 0.2, "{drift:?}");
    Claim::of("B-2", "largest change of the energy of a gas, 60 000 steps").error(drift.largest).within(5e-5);
    let quantity = "energy of a gas, mean of the last tenth less that of the first, 60 000 steps";
    Claim::of("B-2", quantity).error(drift.secular).within(2e-5);
}

/// Cohesive discs store less than nothing between held walls: what is missing is measured by the sizes of the energies.
#[test]
fn energy_of_cohesive_discs_out_of_balance_is_accounted_for() {
    let cohesion = 1e-5;
    let (overlap, press) = (1.5 * cohesion, 0.55 * cohesion);
    let branch = 2.0 * RADIUS - overlap;
    let places = [RADIUS - press, RADIUS - press + branch];
    let disc = |y: f64| Grain::<Discs> { position: [0.0, y], velocity: [0.0; 2], spin: [0.0], radius: RADIUS };
    let sticky = PlainLinear { cohesion, ..law(FRICTION) };
    let body = Body::new(sticky, places.map(disc).to_vec(), vec![MASS; 2], 0.0, [None; 3]);
    let height = places[1] + RADIUS - press;
    let top = Wall::new("top", [0.0, height], [0.0, -1.0], law(FRICTION), WallDrive::Velocity(0.0), 0.0);
    let mut dynamics = Dynamics::new(body, vec![floor(FRICTION, 0.0), top], still());
    assert!(dynamics.first_energy < 0.0);
    for _ in 0..1000 {
        dynamics.advance();
        let (missing, turnover) = (dynamics.missing_energy(), dynamics.energy_turnover());
        assert!(missing.abs() < 1e-3 * turnover, "{missing:e} of {turnover:e} J are missing");
    }
}
