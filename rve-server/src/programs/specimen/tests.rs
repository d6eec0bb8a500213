//! Grains on walls against closed forms: rolling, inclines, bouncing, a stack under its weight; and equal bits for any
//! number of threads.

use super::SpecimenSpace;
use super::body::Body;
use super::contact::Grain;
use super::dynamics::{Dynamics, Motion};
use super::wall::{Wall, WallDrive};
use crate::contact::{LinearSprings, NormalStiffness, PlainLinear};
use crate::simd::Tuple;
use crate::space::{Discs, Spheres};
use claims::Claim;

pub(super) const RADIUS: f64 = 0.01;
pub(super) const MASS: f64 = 0.02;
pub(super) const STIFFNESS: f64 = 1e6;
const GRAVITY: f64 = 9.81;

pub(super) fn law(friction: f64) -> PlainLinear {
    spring_law(STIFFNESS, friction)
}

pub(super) fn spring_law(stiffness: f64, friction: f64) -> PlainLinear {
    PlainLinear::plain(LinearSprings { normal: NormalStiffness::Constant(stiffness), stiffness_ratio: 0.8 }, friction)
}

pub(super) fn still() -> Motion {
    Motion {
        gravity: [0.0; 3],
        local_damping: 0.0,
        safety: 0.1,
        step: None,
        rotations_free: true,
        scaled_masses: false,
    }
}

pub(super) fn vector<S: SpecimenSpace>(components: [f64; 3]) -> S::Coordinates<f64> {
    Tuple::build(|axis| components[axis])
}

fn grain<S: SpecimenSpace>(position: [f64; 3], velocity: [f64; 3]) -> Grain<S> {
    Grain { position: vector::<S>(position), velocity: vector::<S>(velocity), spin: Tuple::zero(), radius: RADIUS }
}

pub(super) fn floor<S: SpecimenSpace>(friction: f64, damping_ratio: f64) -> Wall<S, PlainLinear> {
    let normal = vector::<S>([0.0, 1.0, 0.0]);
    Wall::new("floor", Tuple::zero(), normal, law(friction), WallDrive::Velocity(0.0), damping_ratio)
}

/// One grain that lies on the floor at rest under gravity turned by `angle` (down the slope along x).
fn on_incline<S: SpecimenSpace>(angle: f64, friction: f64, speed: f64) -> Dynamics<S, PlainLinear> {
    let sunk = MASS * GRAVITY * angle.cos() / STIFFNESS;
    let lying = grain::<S>([0.0, RADIUS - sunk, 0.0], [speed, 0.0, 0.0]);
    let body = Body::new(law(friction), vec![lying], vec![MASS], 0.0, [None; 3]);
    let gravity = [GRAVITY * angle.sin(), -GRAVITY * angle.cos(), 0.0];
    Dynamics::new(body, vec![floor(friction, 0.0)], Motion { gravity, ..still() })
}

fn run_until<S: SpecimenSpace>(dynamics: &mut Dynamics<S, PlainLinear>, time: f64) {
    while dynamics.time < time {
        dynamics.advance();
    }
}

/// A wall that is drawn off by more than the reach of its list within one step kept its contacts for ever.
#[test]
fn a_wall_that_leaves_at_once_has_no_contacts() {
    let mut lying = on_incline::<Discs>(0.0, 0.3, 0.0);
    lying.advance();
    assert_eq!(lying.walls[0].contacts(), 1);
    lying.walls[0].drive = WallDrive::Velocity(-1e6);
    for _ in 0..2 {
        lying.advance();
    }
    assert_eq!(lying.walls[0].contacts(), 0);
    assert_eq!(lying.contacts.contacts, 0);
}

/// A wall that renews its list while a grain is on its way out, and then goes on while the grain comes back: neither goes as far as half a skin
/// after its own list, and the grain went through the wall.
#[test]
fn a_grain_that_comes_back_touches_a_wall_that_has_renewed_its_list() {
    let skin = 0.1 * RADIUS;
    let above = grain::<Discs>([0.0, RADIUS + 1.1 * skin, 0.0], [0.0; 3]);
    let body = Body::new(law(0.3), vec![above], vec![MASS], 0.0, [None; 3]);
    let mut dynamics = Dynamics::new(body, vec![floor(0.3, 0.0)], still());
    let mut has_touched = false;
    // Ways of the grain and of the wall, in skins.
    for [of_grain, of_wall] in [[0.45, 0.0], [0.0, 0.505], [-0.9, 0.0], [0.0, 0.3]] {
        let speed = |way: f64| way * skin / 100.0 / dynamics.step;
        let velocity = speed(of_grain);
        dynamics.walls[0].drive = WallDrive::Velocity(speed(of_wall));
        dynamics.body.grains[0].velocity = [0.0, velocity];
        for _ in 0..100 {
            dynamics.advance();
            has_touched |= dynamics.walls[0].contacts() == 1;
        }
    }
    assert!(has_touched);
}

/// Steps of more than 0.98 of the stable one were counted as shortened where they were what the test asks for.
#[test]
fn a_step_close_to_the_stable_one_is_no_shortened_step() {
    let lying = grain::<Discs>([0.0, 0.999 * RADIUS, 0.0], [0.0; 3]);
    let body = Body::new(law(0.3), vec![lying], vec![MASS], 0.0, [None; 3]);
    let dynamics = Dynamics::new(body, vec![floor(0.3, 0.0)], Motion { safety: 0.99, ..still() });
    assert_eq!(dynamics.shortenings, 0);
}

/// C-13: a grain set down sliding ends rolling at 5/7 (sphere) or 2/3 (disc) of its speed, after 2 v / (7 mu g) or
/// v / (3 mu g).
#[test]
fn sliding_turns_into_rolling() {
    fn check<S: SpecimenSpace>(grain: &str, share: f64, duration: f64) {
        let (friction, speed) = (0.3, 0.5);
        let mut dynamics = on_incline::<S>(0.0, friction, speed);
        let instant = duration * speed / (friction * GRAVITY);
        run_until(&mut dynamics, 0.9 * instant);
        let sliding = speed - friction * GRAVITY * dynamics.time;
        let found = dynamics.body.grains[0].velocity.as_ref()[0];
        Claim::of("C-13", &format!("speed of a {grain} that still slides, m/s")).value(found, sliding).within(1e-3);
        run_until(&mut dynamics, 1.5 * instant);
        // The tangential spring keeps ringing by mu m g / k_t after the grain has caught; the mean does not.
        let (mut velocity, mut spin, steps) = (0.0, 0.0, 4000);
        for _ in 0..steps {
            dynamics.advance();
            let grain = dynamics.body.grains[0];
            velocity += grain.velocity.as_ref()[0] / f64::from(steps);
            spin -= grain.spin.as_ref()[grain.spin.as_ref().len() - 1] / f64::from(steps);
        }
        let quantity = format!("speed of a {grain} that slid and rolls, over that at the start");
        Claim::of("C-13", &quantity).value(velocity / speed, share).within(1e-3);
        let quantity = format!("speed of the surface of a {grain} that rolls against that of its centre, m/s");
        Claim::of("C-13", &quantity).value(spin * RADIUS, velocity).within(1e-3);
    }
    check::<Discs>("disc", 2.0 / 3.0, 1.0 / 3.0);
    check::<Spheres>("sphere", 5.0 / 7.0, 2.0 / 7.0);
}

/// C-14: rolls down with 2/3 (disc) or 5/7 (sphere) of g sin, or slides if too steep.
#[test]
fn incline_is_rolled_or_slid_down() {
    fn check<S: SpecimenSpace>(kind: &str, rolling_share: f64, spin_factor: f64) {
        let angle = 0.3f64;
        for friction in [0.5, 0.05] {
            let mut dynamics = on_incline::<S>(angle, friction, 0.0);
            // Long enough that the ringing of the tangential spring, set off by the start, is little next to the speed.
            run_until(&mut dynamics, 0.6);
            let time = dynamics.time;
            let rolls = angle.tan() < spin_factor_limit(rolling_share) * friction;
            let (acceleration, spin_rate) = if rolls {
                let acceleration = rolling_share * GRAVITY * angle.sin();
                (acceleration, acceleration / RADIUS)
            } else {
                let along = GRAVITY * (angle.sin() - friction * angle.cos());
                (along, spin_factor * friction * GRAVITY * angle.cos() / RADIUS)
            };
            let grain = dynamics.body.grains[0];
            let velocity = grain.velocity.as_ref()[0];
            let spin = grain.spin.as_ref().iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
            let motion = if rolls { "rolls" } else { "slides" };
            let quantity = format!("speed of a {kind} that {motion} down a slope, m/s");
            Claim::of("C-14", &quantity).value(velocity, acceleration * time).within(1e-3);
            let quantity = format!("spin of a grain that {motion} down a slope, rad/s");
            Claim::of("C-14", &quantity).value(spin, spin_rate * time).within(1e-3);
        }
    }
    // tan(angle) below 3 mu (disc) or 7/2 mu (sphere) rolls.
    fn spin_factor_limit(rolling_share: f64) -> f64 {
        1.0 / (1.0 - rolling_share)
    }
    check::<Discs>("disc", 2.0 / 3.0, 2.0);
    check::<Spheres>("sphere", 5.0 / 7.0, 2.5);
}

/// Restitution of a linear spring and dashpot that never pull, damping ratio below the square root of 1/2.
fn restitution(ratio: f64) -> f64 {
    let free = (1.0 - ratio * ratio).sqrt();
    let angle = (2.0 * ratio * free / (free * free - ratio * ratio)).atan();
    (-(ratio / free) * (std::f64::consts::PI - angle)).exp()
}

/// C-15: free fall, then apexes that shrink by the square of the restitution. C-5 at the same time.
#[test]
fn bounces_reach_the_height_that_restitution_leaves() {
    for ratio in [0.0, 0.05, 0.2] {
        let height = 0.1;
        let start = grain::<Spheres>([0.0, RADIUS + height, 0.0], [0.0; 3]);
        // So stiff that the weight means less than 1e-3 while the grain is pressed on the floor.
        let stiff = spring_law(1000.0 * STIFFNESS, 0.0);
        let body = Body::new(stiff, vec![start], vec![MASS], ratio, [None; 3]);
        let gravity = [0.0, -GRAVITY, 0.0];
        let mut floor = floor(0.0, ratio);
        floor.law = stiff;
        let mut dynamics = Dynamics::new(body, vec![floor], Motion { gravity, safety: 0.004, ..still() });
        let fall = (2.0 * height / GRAVITY).sqrt();
        run_until(&mut dynamics, 0.5 * fall);
        let fallen = RADIUS + height - dynamics.body.grains[0].position[1];
        let expected = 0.5 * GRAVITY * dynamics.time * dynamics.time;
        Claim::of("C-15", "height that a grain has fallen, m").value(fallen, expected).within(1e-3);
        let mut apexes = Vec::new();
        let mut rising = false;
        while apexes.len() < 2 {
            dynamics.advance();
            let up = dynamics.body.grains[0].velocity[1] > 0.0;
            if rising && !up {
                apexes.push(dynamics.body.grains[0].position[1] - RADIUS);
            }
            rising = up;
            assert!(dynamics.time < 20.0 * fall);
        }
        let share = restitution(ratio).powi(2);
        for (bounce, apex) in apexes.iter().enumerate() {
            let expected = height * share.powi(bounce as i32 + 1);
            let quantity = format!("height of the first two bounces, damping ratio {ratio}, m");
            Claim::of("C-15", &quantity).value(*apex, expected).within(1e-3);
        }
        if ratio > 0.0 {
            let found = (apexes[1] / apexes[0]).sqrt();
            let quantity = "restitution of a grain that bounces under gravity, from the heights of two bounces";
            Claim::of("C-5", quantity).value(found, restitution(ratio)).within(1e-3);
        }
    }
}

/// C-15: two grains between two plates: three springs in series, and the weights on top.
#[test]
fn stack_between_plates_rests_where_springs_in_series_do() {
    let gap = 4.0 * RADIUS - 3e-6;
    let grains = vec![
        grain::<Discs>([0.0, RADIUS - 1e-6, 0.0], [0.0; 3]),
        grain::<Discs>([0.0, 3.0 * RADIUS - 2e-6, 0.0], [0.0; 3]),
    ];
    let body = Body::new(law(0.5), grains, vec![MASS; 2], 0.0, [None; 3]);
    let top = Wall::new("top", [0.0, gap], [0.0, -1.0], law(0.5), WallDrive::Velocity(0.0), 0.0);
    let gravity = [0.0, -GRAVITY, 0.0];
    let motion = Motion { gravity, local_damping: 0.7, safety: 0.3, ..still() };
    let mut dynamics = Dynamics::new(body, vec![floor(0.5, 0.0), top], motion);
    for _ in 0..4000 {
        dynamics.advance();
    }
    // Overlaps d1 (floor), d2, d3 (top): d1 + d2 + d3 = 4 R - gap, k d1 - k d2 = m g, k d2 - k d3 = m g.
    let sum = 4.0 * RADIUS - gap;
    let weight = MASS * GRAVITY / STIFFNESS;
    let expected = [sum / 3.0 + weight, sum / 3.0, sum / 3.0 - weight];
    let lower = dynamics.body.grains[0].position[1];
    let upper = dynamics.body.grains[1].position[1];
    let found = [RADIUS - lower, 2.0 * RADIUS - (upper - lower), upper + RADIUS - gap];
    for (found, expected) in found.iter().zip(expected) {
        let quantity = "overlap of a contact of two grains stacked between plates, m";
        Claim::of("C-15", quantity).value(*found, expected).within(1e-3);
    }
    let force = dynamics.walls[1].normal_force();
    let quantity = "force on the upper plate over two stacked grains, N";
    Claim::of("C-15", quantity).value(force, STIFFNESS * expected[2]).within(1e-3);
}

/// A wall under force control brings a column of grains to that force.
#[test]
fn servo_wall_reaches_its_force() {
    let grains = (0..3).map(|k| grain::<Discs>([0.0, (2.0 * f64::from(k) + 1.0) * RADIUS, 0.0], [0.0; 3])).collect();
    let body = Body::new(law(0.5), grains, vec![MASS; 3], 0.0, [None; 3]);
    let drive = WallDrive::Force { target: 50.0, gain: 0.01, largest_speed: 0.1 };
    let top = Wall::new("top", [0.0, 6.1 * RADIUS], [0.0, -1.0], law(0.0), drive, 0.0);
    let motion = Motion { local_damping: 0.7, safety: 0.3, ..still() };
    let mut dynamics = Dynamics::new(body, vec![floor(0.5, 0.0), top], motion);
    for _ in 0..60_000 {
        dynamics.advance();
    }
    assert!((dynamics.walls[1].normal_force() / 50.0 - 1.0).abs() < 1e-6, "{}", dynamics.walls[1].normal_force());
    assert!((dynamics.walls[0].normal_force() / 50.0 - 1.0).abs() < 1e-6);
}

/// Work of gravity is kinetic and stored energy and what friction takes.
#[test]
fn energy_of_a_falling_heap_balances() {
    let mut grains = Vec::new();
    for row in 0..6 {
        for column in 0..6 {
            let shift = if row % 2 == 0 { 0.3 } else { -0.2 };
            let x = (2.3 * f64::from(column) + shift) * RADIUS;
            grains.push(grain::<Discs>([x, (2.2 * f64::from(row) + 1.2) * RADIUS, 0.0], [0.0; 3]));
        }
    }
    let count = grains.len();
    let body = Body::new(law(0.4), grains, vec![MASS; count], 0.0, [None; 3]);
    let motion = Motion { gravity: [0.0, -GRAVITY, 0.0], safety: 0.05, ..still() };
    let mut dynamics = Dynamics::new(body, vec![floor(0.4, 0.0)], motion);
    let mut kinetic = 0.0;
    for _ in 0..12_000 {
        kinetic = dynamics.advance().kinetic_energy;
    }
    let work = dynamics.works[3];
    let open = work - kinetic - dynamics.contacts.elastic_energy - dynamics.works[0];
    assert!(dynamics.works[0] > 0.05 * work, "friction has worked");
    assert!(open.abs() < 5e-3 * work, "{open} of {work} J are missing");
}

/// A large body has the same bits with one thread and with several.
#[test]
fn threads_leave_no_trace() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let side = 120;
            let grains: Vec<Grain<Discs>> = (0..side * side)
                .map(|k| {
                    let (i, j) = (f64::from(k % side), f64::from(k / side));
                    let wobble = 0.05 * ((7 * k) % 11) as f64;
                    grain::<Discs>([(1.98 * i + wobble) * RADIUS, (1.98 * j + 1.0) * RADIUS, 0.0], [0.0; 3])
                })
                .collect();
            let count = grains.len();
            let body = Body::new(law(0.4), grains, vec![MASS; count], 0.0, [None; 3]);
            let motion = Motion { gravity: [0.0, -GRAVITY, 0.0], local_damping: 0.1, safety: 0.3, ..still() };
            let mut dynamics = Dynamics::new(body, vec![floor(0.4, 0.0)], motion);
            let mut last = 0.0;
            for _ in 0..40 {
                last = dynamics.advance().kinetic_energy;
            }
            (dynamics.body.grains, dynamics.contacts, last)
        })
    };
    let (grains, contacts, energy) = run(1);
    assert!(contacts.contacts > 10_000);
    let other = run(3);
    assert!(other.0 == grains && other.1 == contacts && other.2 == energy);
}
