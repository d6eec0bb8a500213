//! Loops over the grains of a frame in one step, with the widest instructions that help.

use crate::programs::specimen::{Grain, Load};
use crate::simd::{Tuple, Vectorised};
use crate::space::Discs;
use crate::space::plane::{self, Plane};

/// Kick and motion of all grains in one step.
pub(super) struct KickAndMove<'a> {
    pub grains: &'a mut [Grain<Discs>],
    pub rotations: &'a mut [f64],
    pub loads: &'a [Load<Discs>],
    pub inertias: &'a [f64],
    pub affine: &'a Plane,
    pub push: f64,
    pub turning_push: f64,
    pub mass: f64,
}

impl Vectorised for KickAndMove<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { grains, rotations, loads, inertias, affine, push, turning_push, mass } = self;
        for ((grain, rotation), (load, inertia)) in grains.iter_mut().zip(rotations).zip(loads.iter().zip(inertias)) {
            grain.velocity = load.force.scaled_plus(push / mass, grain.velocity);
            grain.spin = load.moment.scaled_plus(turning_push / (mass * inertia), grain.spin);
            let carried = plane::apply(affine, grain.position);
            grain.position = grain.position.plus(carried).plus(grain.velocity);
            *rotation += grain.spin[0];
        }
    }
}

/// Power of the loads, square of the velocities and square of the loads, each with its rotational part.
pub(super) struct PowerAndSquares<'a> {
    pub grains: &'a [Grain<Discs>],
    pub loads: &'a [Load<Discs>],
    pub inertias: &'a [f64],
}

impl Vectorised for PowerAndSquares<'_> {
    type Output = [f64; 3];

    #[inline(always)]
    fn run(self) -> [f64; 3] {
        let (mut power, mut motion, mut force) = (0.0, 0.0, 0.0);
        for ((load, grain), inertia) in self.loads.iter().zip(self.grains).zip(self.inertias) {
            power += load.force.dot(grain.velocity) + load.moment[0] * grain.spin[0];
            motion += grain.velocity.dot(grain.velocity) + inertia * grain.spin[0] * grain.spin[0];
            force += load.force.dot(load.force) + load.moment[0] * load.moment[0] / inertia;
        }
        [power, motion, force]
    }
}

/// Velocities turned towards the loads, as FIRE does.
pub(super) struct FireMixing<'a> {
    pub grains: &'a mut [Grain<Discs>],
    pub loads: &'a [Load<Discs>],
    pub inertias: &'a [f64],
    pub turn: f64,
    pub keep: f64,
}

impl Vectorised for FireMixing<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { grains, loads, inertias, turn, keep } = self;
        for ((load, grain), inertia) in loads.iter().zip(grains).zip(inertias) {
            grain.velocity = load.force.scaled_plus(turn, grain.velocity.scaled(keep));
            grain.spin = load.moment.scaled_plus(turn / inertia, grain.spin.scaled(keep));
        }
    }
}
