//! Newton's equations of a specimen, explicitly: contact and wall forces, gravity, local damping.
//!
//! Velocities live half a step before the positions (leap-frog, second order). The step is a fixed share of the stability
//! limit; it is checked whenever the pair list is renewed and shortened if contacts have become stiffer, which is
//! counted.

mod boundary;

use self::boundary::Flow;
use super::SpecimenSpace;
use super::body::Body;
use super::contact::{ContactSums, Grain, Load, OwnStiffness, bound};
use super::wall::Wall;
use crate::contact::ContactLaw;
use crate::simd::{Tuple, Vectorised, dispatch};
use rayon::prelude::*;

/// Grains from which on threads are worth their cost.
const FEWEST_FOR_THREADS: usize = 8192;

/// Growth of the sum of the normal forces after which contacts that stiffen as they are pressed are looked at again, and the steps
/// after which they are in any case.
const PRESSED: f64 = 1.05;
const STIFFNESS_INTERVAL: u64 = 64;

/// Overlap over the radius of contacts that are expected where few grains touch: a tenth of a per cent of the diameter.
const USUAL_OVERLAP: f64 = 2e-3;

/// Grains moved as one unit of work.
const GRAINS_PER_BLOCK: usize = 2048;

/// Loads, damping and masses of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Acceleration of gravity, m/s2, per axis.
    pub gravity: [f64; 3],
    /// Coefficient of local damping, 0 for none: every load component loses this share of its size against the motion.
    pub local_damping: f64,
    /// Share of the stability limit that a step takes, in (0, 1).
    pub safety: f64,
    /// Step, s; chosen from the stability limit if absent.
    pub step: Option<f64>,
    /// Whether grains rotate.
    pub rotations_free: bool,
    /// Whether every grain gets the mass that makes its own stability limit that of all others, instead of its physical
    /// mass. For quasi-static runs: results then depend on the loading rate alone.
    pub scaled_masses: bool,
}

/// Sums over the grains of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GrainSums {
    /// Kinetic energy of translation and rotation, J.
    pub kinetic_energy: f64,
    /// Largest unbalanced force, N.
    pub largest_force: f64,
    /// Largest weight of a grain that nothing touches, N.
    pub free_weight: f64,
    /// Work of gravity in this step, J.
    pub gravity_work: f64,
    /// Work lost to local damping in this step, J.
    pub damping_work: f64,
}

/// Explicit dynamics of a specimen: its grains, walls, masses, step and energy balance.
#[derive(Clone, Debug)]
pub struct Dynamics<S: SpecimenSpace, C: ContactLaw<S>> {
    /// Grains and their contacts.
    pub body: Body<S, C>,
    /// Walls.
    pub walls: Vec<Wall<S, C>>,
    /// Grains whose velocity is prescribed: they keep it whatever acts on them. Their kinetic energy counts for nothing.
    pub driven: Vec<bool>,
    /// Motion settings.
    pub motion: Motion,
    /// Rotations added up, rad.
    pub rotations: Vec<S::Axial<f64>>,
    /// Time, s.
    pub time: f64,
    /// Steps so far.
    pub steps: u64,
    /// Step in use, s.
    pub step: f64,
    /// How often the step had to be shortened.
    pub shortenings: u64,
    /// Sums of the last evaluation.
    pub contacts: ContactSums,
    /// Work lost to friction, to contact viscosity and to local damping, and work of gravity, J.
    pub works: [f64; 4],
    /// Work that the walls and the periodic sides have done on the grains, J.
    pub wall_work: f64,
    /// Part of it that came from walls moving along their planes and from periodic sides, J.
    pub shear_work: f64,
    /// Kinetic energy that came with masses that were raised during the run, J.
    pub raised: f64,
    /// Stored and kinetic energy at the first evaluation, J.
    pub first_energy: f64,
    inertia_factor: f64,
    masses: Vec<f64>,
    skin: f64,
    /// Whether contacts become stiffer as they are pressed.
    stiffens: bool,
    /// Sum of the normal forces, N, when the contacts were last looked at for step or masses.
    looked_at: f64,
    /// Largest strain of a step of the present stage: contacts that have just been born are taken to be pressed as far as that.
    strain_per_step: f64,
    /// Flow of moving periodic sides.
    flow: Option<Flow<S>>,
    /// Sums of the blocks of grains in the last motion, in their order.
    block_sums: Vec<GrainSums>,
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Dynamics<S, C> {
    /// A specimen whose forces have been evaluated once.
    pub fn new(body: Body<S, C>, walls: Vec<Wall<S, C>>, motion: Motion) -> Self {
        let count = body.grains.len();
        let mean = body.grains.iter().map(|grain| grain.radius).sum::<f64>() / count.max(1) as f64;
        let masses: Vec<f64> = (0..count).map(|grain| body.mass(grain)).collect();
        let constants = body.law().constants([mean, mean]);
        let stiffness = |overlap: f64| body.law().stiffness(&constants, overlap)[0];
        let stiffens = stiffness(4e-3 * mean) > stiffness(1e-3 * mean);
        let mut dynamics = Self {
            body,
            walls,
            driven: vec![false; count],
            motion,
            rotations: vec![Tuple::zero(); count],
            time: 0.0,
            steps: 0,
            step: 0.0,
            shortenings: 0,
            contacts: ContactSums::default(),
            works: [0.0; 4],
            wall_work: 0.0,
            shear_work: 0.0,
            raised: 0.0,
            first_energy: 0.0,
            inertia_factor: S::INERTIA_FACTOR,
            masses,
            skin: 0.1 * mean,
            stiffens,
            looked_at: 0.0,
            strain_per_step: 0.0,
            flow: None,
            block_sums: Vec::new(),
        };
        dynamics.list_walls();
        dynamics.evaluate(0.0);
        // Histories above the Coulomb limit have been cut to it: that is no part of the motion.
        dynamics.works = [0.0; 4];
        dynamics.choose_step();
        dynamics.first_energy = dynamics.contacts.elastic_energy + dynamics.kinetic_energy();
        dynamics
    }

    /// Kinetic energy at the time of the positions, J: velocities are half a step old and are brought up to them.
    pub fn kinetic_energy(&self) -> f64 {
        let half = 0.5 * self.step;
        let mut sum = 0.0;
        for (index, (grain, load)) in self.body.grains.iter().zip(&self.body.loads).enumerate() {
            if self.driven[index] {
                continue;
            }
            let mass = self.masses[index];
            let inertia = self.inertia_factor * mass * grain.radius * grain.radius;
            sum += 0.5 * (mass * grain.velocity.dot(grain.velocity) + inertia * grain.spin.dot(grain.spin));
            sum += half * (load.force.dot(grain.velocity) + load.moment.dot(grain.spin));
        }
        sum
    }

    /// Energy put in less energy stored and lost, J: 0 but for rounding and for errors of finite steps
    /// out. Grains with prescribed velocities that no wall carries are not accounted for.
    pub fn missing_energy(&self) -> f64 {
        let [friction, viscosity, damping, gravity] = self.works;
        let given = self.first_energy + self.wall_work + gravity + self.raised;
        given - (self.contacts.elastic_energy + self.kinetic_energy() + friction + viscosity + damping)
    }

    /// Scale of [`missing_energy`](Self::missing_energy), J: the sum of the sizes of all its parts. What cohesive contacts store is
    /// negative.
    pub fn energy_turnover(&self) -> f64 {
        let works: f64 = self.works.iter().map(|work| work.abs()).sum();
        works
            + self.first_energy.abs()
            + self.wall_work.abs()
            + self.contacts.elastic_energy.abs()
            + self.kinetic_energy().abs()
    }

    /// Mass of a grain in the motion, kg.
    pub fn mass(&self, grain: usize) -> f64 {
        self.masses[grain]
    }

    /// A stage begins, or goes on, whose steps strain the specimen by at most this much.
    pub(in crate::programs::specimen) fn expect_strain(&mut self, strain_per_step: f64) {
        self.strain_per_step = strain_per_step;
    }

    /// Advances by one step.
    pub fn advance(&mut self) -> GrainSums {
        if self.stiffens
            && (self.contacts.normal_force > PRESSED * self.looked_at
                || self.steps.is_multiple_of(STIFFNESS_INTERVAL))
        {
            self.choose_step();
        }
        let step = self.step;
        for wall in &mut self.walls {
            // Half of the work of this step is done by the forces at its start, half by those at its end.
            let force = wall.normal_force();
            wall.advance(step);
            self.wall_work += 0.5 * force * wall.velocity() * step;
        }
        self.add_shear_work(0.5 * step);
        self.carry_glued();
        let sums = self.kick_and_move(step);
        self.body.move_sides(step);
        self.follow_sides();
        if self.body.keep_list_complete() {
            self.list_walls();
            self.choose_step();
        } else if self.walls.iter().any(|wall| wall.has_travelled(self.skin)) {
            self.list_walls();
        }
        self.evaluate(step);
        for wall in &self.walls {
            self.wall_work += 0.5 * wall.normal_force() * wall.velocity() * step;
        }
        self.add_shear_work(0.5 * step);
        self.time += step;
        self.steps += 1;
        self.works[2] += sums.damping_work;
        self.works[3] += sums.gravity_work;
        sums
    }

    fn evaluate(&mut self, step: f64) {
        self.contacts = self.body.evaluate(step);
        for wall in &mut self.walls {
            wall.press(&self.body.grains, &self.masses, step, &mut self.body.loads, &mut self.contacts);
        }
        self.gather_glued();
        self.gather_viscous();
        self.works[0] += self.contacts.dissipation;
        self.works[1] += self.contacts.viscous_work;
    }

    fn list_walls(&mut self) {
        for wall in &mut self.walls {
            wall.list(&self.body.grains, self.skin);
        }
    }

    fn kick_and_move(&mut self, step: f64) -> GrainSums {
        let (motion, factor) = (self.motion, self.inertia_factor);
        let gravity = <S::Coordinates<f64>>::build(|axis| motion.gravity[axis]);
        let (loads, masses, driven, flow) = (&self.body.loads, &self.masses, &self.driven, self.flow.as_ref());
        let work = |first: usize, grains: &mut [Grain<S>], rotations: &mut [S::Axial<f64>]| {
            let range = first..first + grains.len();
            let (loads, masses, driven) = (&loads[range.clone()], &masses[range.clone()], &driven[range]);
            dispatch(KickAndMove {
                grains,
                rotations,
                loads,
                masses,
                driven,
                factor,
                motion: &motion,
                gravity,
                flow,
                step,
            })
        };
        let count = self.body.grains.len();
        self.block_sums.clear();
        self.block_sums.resize(count.div_ceil(GRAINS_PER_BLOCK), GrainSums::default());
        if count >= FEWEST_FOR_THREADS {
            let blocks = self.body.grains.par_chunks_mut(GRAINS_PER_BLOCK).enumerate();
            blocks.zip(self.rotations.par_chunks_mut(GRAINS_PER_BLOCK)).zip(self.block_sums.par_iter_mut()).for_each(
                |(((block, grains), rotations), sums)| *sums = work(block * GRAINS_PER_BLOCK, grains, rotations),
            );
        } else {
            let blocks = self.body.grains.chunks_mut(GRAINS_PER_BLOCK).enumerate();
            let blocks = blocks.zip(self.rotations.chunks_mut(GRAINS_PER_BLOCK)).zip(&mut self.block_sums);
            for (((block, grains), rotations), sums) in blocks {
                *sums = work(block * GRAINS_PER_BLOCK, grains, rotations);
            }
        }
        self.block_sums.iter().fold(GrainSums::default(), |whole, block| GrainSums {
            kinetic_energy: whole.kinetic_energy + block.kinetic_energy,
            largest_force: whole.largest_force.max(block.largest_force),
            free_weight: whole.free_weight.max(block.free_weight),
            gravity_work: whole.gravity_work + block.gravity_work,
            damping_work: whole.damping_work + block.damping_work,
        })
    }

    /// Takes the step, or the masses, from the present contacts.
    fn choose_step(&mut self) {
        let mut own = self.own_stiffness();
        self.looked_at = self.contacts.normal_force;
        if self.stiffens {
            // Contacts that have just been born have next to no stiffness, until the next step presses them.
            for (own, grain) in own.iter_mut().zip(&self.body.grains) {
                let to_come = self.expected_stiffness(grain.radius, 2.0 * grain.radius * self.strain_per_step);
                own.stiffness = own.stiffness.max(to_come.stiffness);
                own.root = own.root.max(to_come.root);
            }
        }
        let safety = self.motion.safety;
        if self.motion.scaled_masses {
            self.scale_masses(&own);
            self.step = 1.0;
            return;
        }
        let longest = |(own, mass): (&OwnStiffness, &f64)| own.longest_step(*mass);
        let limit = own.iter().zip(&self.masses).map(longest).fold(f64::INFINITY, f64::min);
        let wanted = self.motion.step.unwrap_or(safety * limit);
        if self.step == 0.0 {
            self.step = if wanted.is_finite() { wanted } else { self.free_step() };
        }
        // A share above that is what was asked for.
        if self.step > safety.max(0.98) * limit {
            self.step = safety * limit;
            self.shortenings += 1;
        }
    }

    /// The unit of time is the step: every grain gets the mass that makes it the wanted share of its longest stable step.
    fn scale_masses(&mut self, own: &[OwnStiffness]) {
        let mut mean = OwnStiffness::default();
        own.iter().for_each(|own| mean.add(own));
        let count = own.len().max(1) as f64;
        let ratio = self.body.damping_ratio();
        // While few grains touch, the first contacts to come are stiffer than the mean of those there are.
        let is_loose = (self.contacts.contacts as f64) < count;
        let is_first = self.step == 0.0;
        for (index, own) in own.iter().enumerate() {
            let grain = &self.body.grains[index];
            let to_come = if is_loose {
                self.expected_stiffness(grain.radius, USUAL_OVERLAP * grain.radius)
            } else {
                OwnStiffness::default()
            };
            let own = OwnStiffness {
                stiffness: own.stiffness.max(mean.stiffness / count).max(to_come.stiffness),
                root: own.root.max(mean.root / count).max(to_come.root),
                dashpot: 0.0,
            };
            let before = if is_first { 0.0 } else { self.masses[index] };
            let after = before.max(own.mass_for(self.motion.safety, ratio)).max(f64::MIN_POSITIVE);
            let turning = self.inertia_factor * grain.radius * grain.radius * grain.spin.dot(grain.spin);
            // The energy of the first masses is what the specimen begins with.
            if !is_first && !self.driven[index] {
                self.raised += 0.5 * (after - before) * (grain.velocity.dot(grain.velocity) + turning);
            }
            self.masses[index] = after;
        }
        self.body.change_masses(&self.masses);
        for wall in &mut self.walls {
            wall.change_masses(&self.masses);
        }
    }

    /// Stiffness of two contacts of a grain with its like at an overlap, m.
    fn expected_stiffness(&self, radius: f64, overlap: f64) -> OwnStiffness {
        let law = self.body.law();
        let stiffness = law.stiffness(&law.constants([radius, radius]), overlap);
        OwnStiffness {
            stiffness: 2.0 * bound(stiffness, radius, self.inertia_factor),
            root: 2.0 * stiffness[0].sqrt(),
            dashpot: 0.0,
        }
    }

    /// Step while nothing touches, of such grains.
    fn free_step(&self) -> f64 {
        let ratio = self.body.damping_ratio();
        let limit = self.body.grains.iter().zip(&self.masses).fold(f64::INFINITY, |shortest: f64, (grain, mass)| {
            let expected = self.expected_stiffness(grain.radius, USUAL_OVERLAP * grain.radius);
            let own = OwnStiffness { dashpot: 2.0 * ratio * (0.5 * mass).sqrt() * expected.root, ..expected };
            shortest.min(own.longest_step(*mass))
        });
        if limit.is_finite() { self.motion.safety * limit } else { 1.0 }
    }

    /// Per grain, what its contacts with grains and walls add up to: see [`Body::own_stiffness`].
    fn own_stiffness(&self) -> Vec<OwnStiffness> {
        let mut sums = self.body.own_stiffness(self.inertia_factor);
        for wall in &self.walls {
            for (grain, own) in wall.own_stiffnesses(&self.body.grains, self.inertia_factor) {
                sums[grain].add(&own);
            }
        }
        sums
    }
}

/// Grains to be kicked and moved.
struct KickAndMove<'a, S: SpecimenSpace> {
    grains: &'a mut [Grain<S>],
    rotations: &'a mut [S::Axial<f64>],
    loads: &'a [Load<S>],
    masses: &'a [f64],
    driven: &'a [bool],
    factor: f64,
    motion: &'a Motion,
    gravity: S::Coordinates<f64>,
    flow: Option<&'a Flow<S>>,
    step: f64,
}

impl<S: SpecimenSpace> Vectorised for KickAndMove<'_, S> {
    type Output = GrainSums;

    #[inline(always)]
    fn run(self) -> GrainSums {
        let Self { grains, rotations, loads, masses, driven, factor, motion, gravity, flow, step } = self;
        let mut sums = GrainSums::default();
        let given = loads.iter().zip(masses).zip(driven);
        for ((grain, rotation), ((load, mass), driven)) in grains.iter_mut().zip(rotations).zip(given) {
            if !driven {
                kick(grain, load, *mass, factor, motion, gravity, flow, step, &mut sums);
            }
            grain.position = grain.velocity.scaled_plus(step, grain.position);
            *rotation = grain.spin.scaled_plus(step, *rotation);
        }
        sums
    }
}

#[expect(clippy::too_many_arguments, reason = "the innermost loop's body; a struct would only rename the arguments")]
#[inline(always)]
fn kick<S: SpecimenSpace>(
    grain: &mut Grain<S>,
    load: &Load<S>,
    mass: f64,
    inertia_factor: f64,
    motion: &Motion,
    gravity: S::Coordinates<f64>,
    flow: Option<&Flow<S>>,
    step: f64,
    sums: &mut GrainSums,
) {
    let inertia = inertia_factor * mass * grain.radius * grain.radius;
    let weight = gravity.scaled(mass);
    let force = load.force.plus(weight);
    sums.largest_force = sums.largest_force.max(force.dot(force).sqrt());
    if load.force == Tuple::zero() {
        sums.free_weight = sums.free_weight.max(weight.dot(weight).sqrt());
    }
    let (own, own_spin) = flow.map_or((grain.velocity, grain.spin), |flow| flow.own_motion(grain));
    let damped = damped(motion.local_damping, force, own);
    let turning = damped_moment::<S>(motion, load.moment, own_spin);
    let (old, old_spin) = (grain.velocity, grain.spin);
    grain.velocity = damped.scaled_plus(step / mass, old);
    grain.spin = if motion.rotations_free { turning.scaled_plus(step / inertia, old_spin) } else { Tuple::zero() };
    sums.kinetic_energy += 0.5 * (mass * grain.velocity.dot(grain.velocity) + inertia * grain.spin.dot(grain.spin));
    // The mean of the velocities before and after the kick is the velocity at the time of the forces.
    let mean = old.plus(grain.velocity).scaled(0.5 * step);
    sums.gravity_work += weight.dot(mean);
    if motion.local_damping > 0.0 {
        let mean_spin = old_spin.plus(grain.spin).scaled(0.5 * step);
        sums.damping_work += force.minus(damped).dot(mean) + load.moment.minus(turning).dot(mean_spin);
    }
}

#[inline(always)]
fn damped_moment<S: SpecimenSpace>(motion: &Motion, moment: S::Axial<f64>, spin: S::Axial<f64>) -> S::Axial<f64> {
    damped(motion.local_damping, moment, spin)
}

/// Each component loses a share of its size against the sign of its velocity.
#[inline(always)]
fn damped<T: Tuple<f64>>(coefficient: f64, load: T, velocity: T) -> T {
    if coefficient == 0.0 {
        return load;
    }
    load.zip(velocity, |force, motion| {
        let sign = if motion > 0.0 {
            1.0
        } else if motion < 0.0 {
            -1.0
        } else {
            0.0
        };
        force - coefficient * force.abs() * sign
    })
}
