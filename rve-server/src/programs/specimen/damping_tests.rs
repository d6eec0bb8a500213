//! Local damping: what it takes from one grain between two plates, that it asks for the absolute velocity there, and that
//! periodic cells have it ask for the velocity against their own flow.

use super::body::Body;
use super::contact::Grain;
use super::dynamics::{Dynamics, Motion};
use super::tests::{MASS, RADIUS, STIFFNESS, law, still};
use super::wall::{Wall, WallDrive};
use crate::contact::{ContactTable, PlainLinear};
use crate::definition::{Damping, GrainDefinition, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::space::Discs;
use claims::Claim;
use protocol::{RveSolver, Tensor2, TrialOptions};
use std::path::Path;

/// Overlap with both plates in the middle, m.
const SUNK: f64 = 1e-5;

/// Steps in a period of the undamped grain.
const STEPS: f64 = 8000.0;

/// A grain that springs back from both plates at `0.5 SUNK` off the middle, everything moving up at `drift`, m/s.
fn held(coefficient: f64, stiffness: f64, drift: f64) -> Dynamics<Discs, PlainLinear> {
    let gap = 2.0 * (RADIUS - SUNK);
    let spring = PlainLinear { springs: super::tests::spring_law(stiffness, 0.0).springs, ..law(0.0) };
    let grain =
        Grain { position: [0.0, 0.5 * gap + 0.5 * SUNK], velocity: [0.0, drift], spin: [0.0], radius: RADIUS };
    let body = Body::new(spring, vec![grain], vec![MASS], 0.0, [None; 3]);
    let plate = |height: f64, up: f64| {
        Wall::new("plate", [0.0, height], [0.0, up], spring, WallDrive::Velocity(up * drift), 0.0)
    };
    let step = std::f64::consts::TAU / (2.0 * stiffness / MASS).sqrt() / STEPS;
    let motion = Motion { local_damping: coefficient, step: Some(step), ..still() };
    Dynamics::new(body, vec![plate(0.0, 1.0), plate(gap, -1.0)], motion)
}

/// Amplitude after one cycle over that before it.
fn amplitude_left(mut dynamics: Dynamics<Discs, PlainLinear>) -> f64 {
    let off_middle = |dynamics: &Dynamics<Discs, PlainLinear>| {
        let middle = 0.5 * (dynamics.walls[0].point[1] + dynamics.walls[1].point[1]);
        dynamics.body.grains[0].position[1] - middle
    };
    let mut before = off_middle(&dynamics);
    let (first, mut was_rising) = (before, false);
    for _ in 0..4 * STEPS as u32 {
        dynamics.advance();
        let now = off_middle(&dynamics);
        if was_rising && now <= before {
            return before / first;
        }
        (was_rising, before) = (now > before, now);
    }
    panic!("the grain did not swing back")
}

/// B-8: with the coefficient `a`, a grain on a spring is pushed with `(1 - a)` of the force towards rest and with `(1 + a)`
/// away from it. A cycle leaves `((1 - a) / (1 + a))^2` of the energy, which for small `a` is a loss of `4 a` and a
/// damping ratio of `a / pi`, whatever the frequency.
#[test]
fn local_damping_takes_its_share_of_every_cycle_at_any_rate() {
    for coefficient in [0.01f64, 0.1, 0.7] {
        let share = ((1.0 - coefficient) / (1.0 + coefficient)).powi(2);
        for stiffness in [STIFFNESS, 100.0 * STIFFNESS] {
            let left = amplitude_left(held(coefficient, stiffness, 0.0)).powi(2);
            let quantity = format!("energy left after one cycle, damping coefficient {coefficient}");
            Claim::of("B-8", &quantity).value(left, share).within(2e-3);
            if coefficient == 0.01 {
                let quantity = "energy lost in one cycle, damping coefficient 0.01, against four times that";
                Claim::of("B-8", quantity).value(1.0 - left, 4.0 * coefficient).within(0.05);
            }
        }
    }
}

/// B-8, why cells damp the velocity against their own flow: riding on a drift faster than its swing, the grain is never
/// seen to turn round and loses nothing.
#[test]
fn local_damping_is_blind_to_a_swing_on_a_drift() {
    let swing = SUNK * (2.0 * STIFFNESS / MASS).sqrt();
    let left = amplitude_left(held(0.7, STIFFNESS, 10.0 * swing));
    let quantity = "amplitude left after one cycle on a drift faster than the swing, damping coefficient 0.7";
    Claim::of("B-8", quantity).value(left, 1.0).within(2e-3);
}

/// B-8: the flow of a strained cell moves grains about the origin; another origin superposes a rigid velocity on all of them,
/// and the stress does not notice.
#[test]
fn cells_do_not_damp_a_superposed_rigid_velocity() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
    let packing = PackingFile::<Discs>::read(&file).unwrap();
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let options = RveOptions {
        damping: Damping::Local,
        tolerance: Some(1e-11),
        strain_per_step: Some(1e-6),
        ..RveOptions::default()
    };
    let stress_from = |cells: f64| {
        let mut packing = packing.clone();
        for grain in &mut packing.grains {
            grain[0] += cells * packing.periodicity[0][0];
            grain[1] -= cells * packing.periodicity[1][1];
        }
        let definition = GrainDefinition { packing, contact: contact.clone(), options: options.clone() };
        let target = Tensor2::from_plane([[3e-5, 1e-5], [1e-5, -6e-5]]);
        GrainRve::<Discs>::new(&definition).unwrap().trial(&target, &TrialOptions::default()).unwrap().stress
    };
    let expected = stress_from(0.0);
    for cells in [1.0, 20.5] {
        let found = stress_from(cells);
        let error = found.0.iter().zip(expected.0).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs())) / 1e5;
        let quantity = "change of a cell's stress by a superposed rigid velocity, over 100 kPa";
        Claim::of("B-8", quantity).error(error).within(1e-10);
    }
}
