//! Grains thrown at a wall with a dashpot that brakes but never pulls: how fast they come back.

use super::body::Body;
use super::contact::Grain;
use super::dynamics::{Dynamics, Motion};
use super::wall::{Wall, WallDrive};
use crate::contact::{
    ContactLaw, HertzSprings, LinearSprings, NormalStiffness, PlainHertzMindlin, PlainLinear, RollingSpring,
    TangentialUnloading,
};
use crate::space::Spheres;
use claims::Claim;

const RADIUS: f64 = 0.01;
const MASS: f64 = 0.02;

/// Speed after over speed before a collision with a wall of the same law, in steps of `step` seconds.
fn restitution<C: ContactLaw<Spheres>>(law: C, damping_ratio: f64, speed: f64, step: f64) -> f64 {
    let grain = Grain {
        position: [0.0, RADIUS + 0.25 * speed * step, 0.0],
        velocity: [0.0, -speed, 0.0],
        spin: [0.0; 3],
        radius: RADIUS,
    };
    let body = Body::new(law, vec![grain], vec![MASS], 0.0, [None; 3]);
    let drive = WallDrive::Velocity(0.0);
    let floor = Wall::new("floor", [0.0; 3], [0.0, 1.0, 0.0], law, drive, damping_ratio);
    let motion = Motion {
        gravity: [0.0; 3],
        local_damping: 0.0,
        safety: 0.1,
        step: Some(step),
        rotations_free: true,
        scaled_masses: false,
    };
    let mut dynamics = Dynamics::new(body, vec![floor], motion);
    for _ in 0..3_000_000 {
        dynamics.advance();
        let grain = dynamics.body.grains[0];
        if grain.velocity[1] > 0.0 && grain.position[1] > RADIUS {
            return grain.velocity[1] / speed;
        }
    }
    panic!("the grain did not come back")
}

/// C-5: spring and dashpot in parallel, released when the force would pull: the closed form for every damping ratio below,
/// between and above the square root of 1/2 and 1.
#[test]
fn linear_dashpot_without_tension_has_its_restitution() {
    let stiffness: f64 = 1e6;
    let law =
        PlainLinear::plain(LinearSprings { normal: NormalStiffness::Constant(stiffness), stiffness_ratio: 0.8 }, 0.0);
    // Half a period of the undamped contact in 100 000 steps: the dashpot sees the velocity of half a step ago.
    let step = std::f64::consts::PI * (MASS / stiffness).sqrt() / 100_000.0;
    for (ratio, expected) in [(0.05, 0.85876), (0.2, 0.57174), (0.5, 0.29844), (0.8, 0.17978), (1.5, 0.07559)] {
        let b: f64 = ratio;
        let closed_form = if b < 1.0 {
            let free = (1.0 - b * b).sqrt();
            let angle = std::f64::consts::PI - (2.0 * b * free).atan2(free * free - b * b);
            (-(b / free) * angle).exp()
        } else {
            let over = (b * b - 1.0).sqrt();
            ((b + over) / (b - over)).powf(-b / over)
        };
        assert!((closed_form / expected - 1.0).abs() < 1e-4, "{closed_form} against the tabulated {expected}");
        let found = restitution(law, ratio, 1.0, step);
        let quantity = format!("restitution of a linear spring and dashpot that never pull, damping ratio {ratio}");
        Claim::of("C-5", &quantity).value(found, closed_form).within(1e-4);
    }
}

/// C-6: a Hertzian contact whose dashpot is `2 gamma sqrt(m S_n)`: the restitution belongs to `gamma` alone, whatever the
/// speed.
#[test]
fn hertzian_dashpot_has_one_restitution_at_every_speed() {
    let law = PlainHertzMindlin {
        springs: HertzSprings { shear_modulus: 1e9, poisson_ratio: 0.2 },
        friction: 0.0,
        cohesion: 0.0,
        unloading: TangentialUnloading::Rescaled,
        rolling: RollingSpring::default(),
        viscosity: 0.0,
    };
    let table = [
        (0.1, 1.13487),
        (0.2, 0.66753),
        (0.3, 0.45392),
        (0.4, 0.32362),
        (0.5, 0.23303),
        (0.6, 0.16510),
        (0.7, 0.11157),
        (0.8, 0.06788),
        (0.9, 0.03128),
        (0.95, 0.01506),
        (0.98, 0.00589),
    ];
    // Duration of an elastic impact at 1 m/s is below 1.5e-4 s; it goes with the speed to the power of -1/5.
    for (expected, gamma) in table {
        for speed in [0.1f64, 1.0] {
            let step = 1.5e-4 * speed.powf(-0.2) / 20_000.0;
            let found = restitution(law, gamma, speed, step);
            let quantity = format!("restitution of a Hertzian spring and dashpot at {speed} m/s");
            Claim::of("C-6", &quantity).value(found, expected).within(1e-3);
        }
    }
}
