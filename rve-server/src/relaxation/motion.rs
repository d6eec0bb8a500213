//! Explicit motion of the grains in pseudo-time with a unit step: FIRE or local damping, mass-scaled.
//!
//! Only the *peculiar* velocity is integrated and damped, the velocity against the affine motion of the cell: damping the
//! whole velocity would resist the imposed strain and depend on the frame.

use super::assembly::Assembly;
use super::stiffness::{Block, ContactTerms, INERTIA_FACTOR, add_contact, largest_eigenvalue};
use crate::definition::{Damping, Rotations};
use crate::law::ContactLaw;
use crate::model::GrainModel;
use crate::space::{Components, Space, apply};

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
pub(crate) struct Motion<S: Space> {
    velocities: Vec<Velocity<S>>,
    /// Relative mass per grain; all ones for a constant stiffness.
    shape: Vec<f64>,
    /// Inertia of translation and rotation and their reciprocals, per unit of the common mass scale.
    inertias: Vec<Inertia>,
    blocks: Vec<Block>,
    mass: f64,
    mixing: f64,
    positive_steps: u32,
}

/// Peculiar velocity and spin per step, m and rad.
#[derive(Clone, Copy, Debug, Default)]
struct Velocity<S: Space> {
    translation: S::Vector,
    spin: S::Spin,
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

impl<S: Space> Motion<S> {
    /// At rest, with masses for the present contacts.
    pub(crate) fn start<L: ContactLaw<S::Kinematics>>(&mut self, model: &GrainModel, assembly: &Assembly<S, L>) {
        let count = assembly.grains.len();
        self.velocities.clear();
        self.velocities.resize(count, Velocity::default());
        let mean = model.mean_radius();
        self.shape.clear();
        // Where k_n grows with the radii, equally sluggish grains need masses that do.
        let relative_mass = |radius: &f64| if model.stiffness_grows_with_size { radius / mean } else { 1.0 };
        self.shape.extend(model.radii.iter().map(relative_mass));
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
    pub(crate) fn raise_mass<L: ContactLaw<S::Kinematics>>(&mut self, model: &GrainModel, assembly: &Assembly<S, L>) {
        let stiffness = largest_own_stiffness(inertia_factor(model), assembly, &self.shape, &mut self.blocks);
        // Local damping shortens the stable step by about its coefficient.
        let damping = match model.options.damping {
            Damping::Fire => 1.0,
            Damping::Local => 1.0 + model.options.local_coefficient(),
        };
        let wanted = damping * stiffness / (2.0 * SAFETY * SAFETY) * assembly.law.mass_factor();
        self.mass = self.mass.max(wanted);
        for velocity in &mut self.velocities {
            let values = velocity.translation.components_mut().iter_mut().chain(velocity.spin.components_mut());
            for value in values.filter(|value| value.abs() < 1e-200) {
                *value = 0.0;
            }
        }
    }

    /// Sums over the grains for the present loads and velocities.
    pub(crate) fn sums<L: ContactLaw<S::Kinematics>>(
        &self,
        model: &GrainModel,
        assembly: &Assembly<S, L>,
    ) -> GrainSums {
        let mut sums = GrainSums::default();
        let mut largest_square = 0.0f64;
        let rotate = if model.rotations == Rotations::Free { 1.0 } else { 0.0 };
        for (((load, grain), velocity), inertia) in
            assembly.loads.iter().zip(&assembly.grains).zip(&self.velocities).zip(&self.inertias)
        {
            let arm = S::Spin::from_fn(|axis| rotate * load.moment.components()[axis] / grain.radius);
            let force = load.force.dot(load.force);
            let turning = arm.dot(arm);
            let larger = if force > turning { force } else { turning };
            largest_square = if larger > largest_square { larger } else { largest_square };
            sums.force_square += force + turning;
            sums.power += load.force.dot(velocity.translation) + load.moment.dot(velocity.spin);
            sums.scaled_force_square +=
                force * inertia.inverse_mass + load.moment.dot(load.moment) * inertia.inverse_rotation;
            sums.kinetic_energy += inertia.mass * velocity.translation.dot(velocity.translation)
                + inertia.rotation * velocity.spin.dot(velocity.spin);
        }
        sums.largest_force = largest_square.sqrt();
        sums.kinetic_energy *= 0.5 * self.mass;
        sums
    }

    /// One step: velocities from the present loads, then grains move by `affine x + v`. Returns a bound of the distance
    /// any grain moved against the affine motion, m.
    pub(crate) fn step<L: ContactLaw<S::Kinematics>>(
        &mut self,
        model: &GrainModel,
        assembly: &mut Assembly<S, L>,
        sums: &GrainSums,
        affine: &S::Tensor,
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
    fn damp_locally<L: ContactLaw<S::Kinematics>>(&self, assembly: &mut Assembly<S, L>, coefficient: f64) {
        for (load, velocity) in assembly.loads.iter_mut().zip(&self.velocities) {
            load.force = damped(load.force, velocity.translation, coefficient);
            load.moment = damped(load.moment, velocity.spin, coefficient);
        }
    }

    fn advance<L: ContactLaw<S::Kinematics>>(
        &mut self,
        assembly: &mut Assembly<S, L>,
        affine: &S::Tensor,
        keep: f64,
        push: f64,
    ) -> f64 {
        let mut farthest = 0.0f64;
        let slots = assembly.grains.iter_mut().zip(&assembly.loads).zip(&mut assembly.rotations);
        for (((grain, load), rotation), (velocity, inertia)) in
            slots.zip(self.velocities.iter_mut().zip(&self.inertias))
        {
            let push_here = push * inertia.inverse_mass;
            velocity.translation = velocity.translation.times(keep).plus(load.force.times(push_here));
            let torque_here = push * inertia.inverse_rotation;
            velocity.spin = velocity.spin.times(keep).plus(load.moment.times(torque_here));
            grain.position = grain.position.plus(apply(affine, grain.position).plus(velocity.translation));
            grain.spin = velocity.spin;
            *rotation = rotation.plus(velocity.spin);
            let square = velocity.translation.dot(velocity.translation);
            farthest = if square > farthest { square } else { farthest };
        }
        farthest.sqrt()
    }
}

/// Each component loses a share of its size against the sign of its velocity.
fn damped<T: Components>(load: T, velocity: T, coefficient: f64) -> T {
    let (loads, velocities) = (load.components(), velocity.components());
    T::from_fn(|place| {
        let (force, motion) = (loads[place], velocities[place]);
        if motion == 0.0 { force } else { force - coefficient * force.abs() * motion.signum() }
    })
}

/// Largest eigenvalue over all grains of the own stiffness block divided by unit masses `shape[i]` and inertias
/// `inertia shape[i] R_i^2`, N/m.
pub(crate) fn largest_own_stiffness<S: Space, L: ContactLaw<S::Kinematics>>(
    inertia: f64,
    assembly: &Assembly<S, L>,
    shape: &[f64],
    blocks: &mut Vec<Block>,
) -> f64 {
    blocks.clear();
    blocks.resize(assembly.grains.len(), [0.0; 21]);
    for (_, pair) in assembly.contacts() {
        let [normal, tangential, rolling] = assembly.law.stiffness(&pair.constants, assembly.overlap(pair));
        for (grain, direction) in [(pair.origin, pair.direction), (pair.end, pair.direction.times(-1.0))] {
            let radius = assembly.grains[grain as usize].radius;
            let rolling = rolling / (radius * radius);
            let terms = ContactTerms { direction, stiffness: [normal, tangential], rolling };
            add_contact::<S>(&mut blocks[grain as usize], &terms, inertia);
        }
    }
    blocks
        .iter()
        .zip(shape)
        .fold(0.0, |largest: f64, (block, mass)| largest.max(largest_eigenvalue::<S>(block) / mass))
}

fn inertia_factor(model: &GrainModel) -> f64 {
    match model.rotations {
        Rotations::Free => INERTIA_FACTOR,
        Rotations::Blocked => 0.0,
    }
}
