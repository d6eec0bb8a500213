//! A gas of smooth elastic discs in a closed box.

use rve_server::contact::{LinearSprings, NormalStiffness, PlainLinear};
use rve_server::programs::specimen::{Body, Dynamics, Grain, Motion, Wall, WallDrive};
use rve_server::space::Discs;

/// Discs along a side of the grid that the gas starts from.
const SIDE: usize = 6;

/// Side of the box in radii.
const ROOM: f64 = 15.0;

/// Stiffness of a contact in mass times squared speed over squared radius.
const STIFFNESS: f64 = 1e4;

/// Phase that a pair in contact turns through in one step, rad.
const PHASE: f64 = 0.01;

/// 36 discs of mass and radius 1 that start on a grid with speeds of 1 or so, between four walls.
pub(crate) fn gas() -> Dynamics<Discs, PlainLinear> {
    let law =
        PlainLinear::plain(LinearSprings { normal: NormalStiffness::Constant(STIFFNESS), stiffness_ratio: 0.0 }, 0.0);
    let pitch = ROOM / SIDE as f64;
    let grains: Vec<Grain<Discs>> = (0..SIDE * SIDE)
        .map(|number| {
            let place = [number % SIDE, number / SIDE].map(|step| (step as f64 + 0.5) * pitch);
            // Directions that share no symmetry with the grid.
            let (sine, cosine) = (2.4 * number as f64).sin_cos();
            let speed = 0.5 + (number % 7) as f64 / 6.0;
            Grain { position: place, velocity: [speed * cosine, speed * sine], spin: [0.0], radius: 1.0 }
        })
        .collect();
    let count = grains.len();
    let body = Body::new(law, grains, vec![1.0; count], 0.0, [None; 3]);
    let wall =
        |point: [f64; 2], normal: [f64; 2]| Wall::new("side", point, normal, law, WallDrive::Velocity(0.0), 0.0);
    let walls = vec![
        wall([0.0, 0.0], [0.0, 1.0]),
        wall([0.0, ROOM], [0.0, -1.0]),
        wall([0.0, 0.0], [1.0, 0.0]),
        wall([ROOM, 0.0], [-1.0, 0.0]),
    ];
    let motion = Motion {
        gravity: [0.0; 3],
        local_damping: 0.0,
        safety: 0.1,
        step: Some(PHASE / (2.0 * STIFFNESS).sqrt()),
        rotations_free: true,
        scaled_masses: false,
    };
    Dynamics::new(body, walls, motion)
}

/// Kinetic and elastic energy at one time: velocities are half a step old and are brought up to the positions.
fn energy(gas: &Dynamics<Discs, PlainLinear>) -> f64 {
    let kinetic: f64 = gas
        .body
        .grains
        .iter()
        .zip(&gas.body.loads)
        .map(|(grain, load)| {
            let speed = [0, 1].map(|axis| grain.velocity[axis] + 0.5 * gas.step * load.force[axis]);
            0.5 * (speed[0] * speed[0] + speed[1] * speed[1])
        })
        .sum();
    kinetic + gas.contacts.elastic_energy
}

/// What became of the energy in a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drift {
    /// Largest deviation from the start, over the energy.
    pub(crate) largest: f64,
    /// Mean of the last tenth minus mean of the first, over the energy.
    pub(crate) secular: f64,
    /// Steps in which some discs touched each other or a wall, over all steps.
    pub(crate) busy: f64,
}

/// Runs a new gas and watches its energy in every step.
pub(crate) fn drift(steps: u32) -> Drift {
    let mut gas = gas();
    let start = energy(&gas);
    let (mut largest, mut ends, mut busy) = (0.0f64, [0.0; 2], 0u32);
    let tenth = steps / 10;
    for step in 0..steps {
        gas.advance();
        let change = energy(&gas) / start - 1.0;
        largest = largest.max(change.abs());
        busy += u32::from(gas.contacts.contacts > 0);
        if step < tenth {
            ends[0] += change / f64::from(tenth);
        }
        if step >= steps - tenth {
            ends[1] += change / f64::from(tenth);
        }
    }
    Drift { largest, secular: ends[1] - ends[0], busy: f64::from(busy) / f64::from(steps) }
}
