//! Explicit motion of the grains in pseudo-time with a unit step: FIRE or local damping, mass-scaled.
//!
//! Only the *peculiar* velocity is integrated and damped, the velocity against the affine motion of the cell: damping the
//! whole velocity would resist the imposed strain and depend on the frame.

use super::assembly::Assembly;
use super::stiffness::{INERTIA_FACTOR, largest_own_stiffness};
use crate::definition::{Damping, NormalStiffness, Rotations};
use crate::model::GrainModel;
use crate::plane::Plane;

/// `omega_max` stays below this share of the stability limit, so that contacts born between two checks do no harm.
const SAFETY: f64 = 0.8;

/// FIRE mixes this share of the force direction into the velocity at first.
const MIXING: f64 = 0.1;

/// Each step with positive power after the first few multiplies the mixing by this.
const MIXING_DECAY: f64 = 0.99;

/// Steps with positive power before the mixing decays.
const PATIENCE: u32 = 5;

/// Velocities, masses and the memory of the damping rule. Starts from rest in every trial.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motion {
    /// Peculiar velocity and spin per step, m and rad.
    velocities: Vec<[f64; 3]>,
    /// Relative mass per grain; all ones for a constant stiffness.
    shape: Vec<f64>,
    /// Inertia of translation and rotation and their reciprocals, per unit of the common mass scale.
    inertias: Vec<Inertia>,
    blocks: Vec<[f64; 6]>,
    mass: f64,
    mixing: f64,
    positive_steps: u32,
}

#[derive(Clone, Copy, Debug)]
struct Inertia {
    mass: f64,
    rotation: f64,
    inverse_mass: f64,
    inverse_rotation: f64,
}

/// Sums over all grains of one evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GrainSums {
    /// Largest of |F| and |M| / R, N.
    pub(crate) largest_force: f64,
    /// Sum of |F|^2 + (M / R)^2, N2.
    pub(crate) force_square: f64,
    /// Kinetic energy of the peculiar motion, with scaled masses and unit step, J.
    pub(crate) kinetic_energy: f64,
    power: f64,
    scaled_force_square: f64,
}

impl Motion {
    /// At rest, with masses for the present contacts.
    pub(crate) fn start(&mut self, model: &GrainModel, assembly: &Assembly) {
        let count = assembly.grains.len();
        self.velocities.clear();
        self.velocities.resize(count, [0.0; 3]);
        let mean = model.mean_radius();
        self.shape.clear();
        self.shape.extend(model.radii.iter().map(|radius| match model.normal {
            NormalStiffness::Constant(_) => 1.0,
            // k_n grows with the radii, so equally sluggish grains need masses that do.
            NormalStiffness::Modulus(_) => radius / mean,
        }));
        self.inertias.clear();
        let factor = inertia_factor(model);
        self.inertias.extend(self.shape.iter().zip(&model.radii).map(|(&mass, radius)| {
            let rotation = factor * mass * radius * radius;
            let inverse_rotation = if rotation > 0.0 { 1.0 / rotation } else { 0.0 };
            Inertia { mass, rotation, inverse_mass: 1.0 / mass, inverse_rotation }
        }));
        self.mass = 0.0;
        self.raise_mass(model, assembly);
        self.mixing = MIXING;
        self.positive_steps = 0;
    }

    /// Raises the masses if the contacts have become stiffer; never lowers them within a trial. Also freezes motion
    /// that has decayed below all significance, because subnormal numbers cost a hundred times more.
    pub(crate) fn raise_mass(&mut self, model: &GrainModel, assembly: &Assembly) {
        let stiffness = largest_own_stiffness(
            &model.law,
            inertia_factor(model),
            &assembly.grains,
            &self.shape,
            &assembly.pairs,
            &mut self.blocks,
        );
        // Local damping shortens the stable step by about its coefficient.
        let damping = match model.options.damping {
            Damping::Fire => 1.0,
            Damping::Local => 1.0 + model.options.local_coefficient(),
        };
        self.mass = self.mass.max(damping * stiffness / (2.0 * SAFETY * SAFETY));
        for value in self.velocities.iter_mut().flatten().filter(|value| value.abs() < 1e-200) {
            *value = 0.0;
        }
    }

    /// Sums over the grains for the present loads and velocities.
    pub(crate) fn sums(&self, model: &GrainModel, assembly: &Assembly) -> GrainSums {
        let mut sums = GrainSums::default();
        let mut largest_square = 0.0f64;
        let rotate = if model.rotations == Rotations::Free { 1.0 } else { 0.0 };
        for (((load, grain), velocity), inertia) in
            assembly.loads.iter().zip(&assembly.grains).zip(&self.velocities).zip(&self.inertias)
        {
            let [fx, fy] = load.force;
            let arm = rotate * load.moment / grain.radius;
            let force = fx * fx + fy * fy;
            let turning = arm * arm;
            let larger = if force > turning { force } else { turning };
            largest_square = if larger > largest_square { larger } else { largest_square };
            sums.force_square += force + turning;
            sums.power += (fx * velocity[0] + fy * velocity[1]) + load.moment * velocity[2];
            sums.scaled_force_square +=
                force * inertia.inverse_mass + load.moment * load.moment * inertia.inverse_rotation;
            sums.kinetic_energy += inertia.mass * (velocity[0] * velocity[0] + velocity[1] * velocity[1])
                + inertia.rotation * (velocity[2] * velocity[2]);
        }
        sums.largest_force = largest_square.sqrt();
        sums.kinetic_energy *= 0.5 * self.mass;
        sums
    }

    /// One step: velocities from the present loads, then grains move by `affine x + v`. Returns a bound of the distance
    /// any grain moved against the affine motion, m.
    pub(crate) fn step(
        &mut self,
        model: &GrainModel,
        assembly: &mut Assembly,
        sums: &GrainSums,
        affine: &Plane,
    ) -> f64 {
        if self.mass <= 0.0 {
            // No contact, no force: the grains follow the cell.
            return self.advance(assembly, affine, 0.0, 0.0);
        }
        let kick = 1.0 / self.mass;
        match model.options.damping {
            Damping::Fire => {
                let (keep, push) = self.steer(sums, kick);
                self.advance(assembly, affine, keep, push)
            }
            Damping::Local => {
                self.damp_locally(assembly, model.options.local_coefficient());
                self.advance(assembly, affine, 1.0, kick)
            }
        }
    }

    /// FIRE: factors of the old velocity and of `F / m`.
    fn steer(&mut self, sums: &GrainSums, kick: f64) -> (f64, f64) {
        if sums.power <= 0.0 {
            self.mixing = MIXING;
            self.positive_steps = 0;
            return (0.0, kick);
        }
        self.positive_steps += 1;
        if self.positive_steps > PATIENCE {
            self.mixing *= MIXING_DECAY;
        }
        // |v| / |F| in mass-weighted norms: sqrt(sum m v^2) / sqrt(sum F^2 / m).
        let ratio = (2.0 * sums.kinetic_energy / (sums.scaled_force_square * kick)).sqrt();
        (1.0 - self.mixing, kick * (1.0 + self.mixing * ratio))
    }

    /// Local damping: each load component loses a share against the sign of its velocity.
    fn damp_locally(&self, assembly: &mut Assembly, coefficient: f64) {
        let damped = |force: f64, velocity: f64| {
            if velocity == 0.0 { force } else { force - coefficient * force.abs() * velocity.signum() }
        };
        for (load, velocity) in assembly.loads.iter_mut().zip(&self.velocities) {
            load.force = [damped(load.force[0], velocity[0]), damped(load.force[1], velocity[1])];
            load.moment = damped(load.moment, velocity[2]);
        }
    }

    fn advance(&mut self, assembly: &mut Assembly, affine: &Plane, keep: f64, push: f64) -> f64 {
        let mut farthest = 0.0f64;
        let slots = assembly.grains.iter_mut().zip(&assembly.loads).zip(&mut assembly.rotations);
        for (((grain, load), rotation), (velocity, inertia)) in
            slots.zip(self.velocities.iter_mut().zip(&self.inertias))
        {
            let push_here = push * inertia.inverse_mass;
            velocity[0] = keep * velocity[0] + push_here * load.force[0];
            velocity[1] = keep * velocity[1] + push_here * load.force[1];
            velocity[2] = keep * velocity[2] + push * inertia.inverse_rotation * load.moment;
            let [x, y] = grain.position;
            grain.position[0] = x + ((affine[0][0] * x + affine[0][1] * y) + velocity[0]);
            grain.position[1] = y + ((affine[1][0] * x + affine[1][1] * y) + velocity[1]);
            grain.spin = velocity[2];
            *rotation += velocity[2];
            let square = velocity[0] * velocity[0] + velocity[1] * velocity[1];
            farthest = if square > farthest { square } else { farthest };
        }
        farthest.sqrt()
    }
}

fn inertia_factor(model: &GrainModel) -> f64 {
    match model.rotations {
        Rotations::Free => INERTIA_FACTOR,
        Rotations::Blocked => 0.0,
    }
}
