//! Brings a frame to equilibrium: the whole frame follows the affine motion in small steps, the grains relax against it
//! under the constraint of the boundary.
//!
//! Starts from the converged positions and rotations of the last state. Erratum of [Liu2018] table 2: there the boundary
//! grains go back to `F X_q` without rotation in every increment, which throws away the fluctuations found before.

use super::constraint::project;
use super::geometry::FrameGeometry;
use super::motion::{FireMixing, KickAndMove, PowerAndSquares};
use super::options::{FrameDamping, FrameOptions};
use crate::cell::GrainState;
use crate::contact::{ContactLaw, Rotations};
use crate::definition::{FrameConstraint, FrameControl};
use crate::programs::specimen::{Body, ContactSums, Load, bound};
use crate::simd::{Tuple, dispatch};
use crate::solver::{Advice, ConvergenceMonitor, Imbalance, LEAST_LOAD, descent_share};
use crate::space::Discs;
use crate::space::plane::{self, Plane};

/// Moment of inertia of the relaxation over mass times radius squared: that of a disc would make rotations the fastest
/// motion and shorten the step.
const INERTIA: f64 = 0.8;

/// `omega_max` stays below this share of the stability limit.
const SAFETY: f64 = 0.8;

/// Contacts of the stiffest kind per grain that the mass always suits: grains that touch nothing have no stiffness until contacts close.
/// With `SAFETY` it is stable for six of them.
const FEWEST_CONTACTS: f64 = 4.0;

/// Steps between two checks of the stiffness.
const STIFFNESS_INTERVAL: u64 = 64;

/// Growth of the number of contacts since the last check, as a share of it, with which the stiffness is checked at once.
const CONTACT_GROWTH: f64 = 0.1;

/// FIRE: first mixing, its decay, steps of positive power before it decays.
const MIXING: f64 = 0.1;
const MIXING_DECAY: f64 = 0.99;
const DOWNHILL_STEPS: u32 = 5;

/// Steps in a row that the energy criterion must hold. Erratum of [Liu2018] eq. 31: a single hit also accepts the turning
/// points of the motion.
const ENERGY_HITS: u32 = 10;

/// How a relaxation ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Relaxed {
    pub(crate) force_evaluations: u64,
    pub(crate) ramp_steps: u32,
    /// Largest load left over mean normal contact force.
    pub(crate) unbalanced: f64,
    /// Residual of the anti-periodicity of boundary loads over mean contact force, [Liu2018] eq. 37 with a norm that
    /// does not depend on the numerical step.
    pub(crate) boundary_residual: f64,
    pub(crate) equilibrated: bool,
    pub(crate) dissipation: f64,
}

/// A frame in motion.
pub(crate) struct FrameRelaxation<'a, C: ContactLaw<Discs>> {
    pub(crate) geometry: &'a FrameGeometry,
    pub(crate) options: &'a FrameOptions,
    pub(crate) constraint: FrameConstraint,
    pub(crate) turning: Rotations,
    pub(crate) body: Body<Discs, C>,
    /// Rotations added up, rad.
    pub(crate) rotations: Vec<f64>,
    loads: Vec<Load<Discs>>,
    /// Largest sum of normal forces that the frame has carried at rest, N.
    largest_load: f64,
    inertias: Vec<f64>,
    /// Largest share of one contact in the stability bound of a grain, N/m, whether grains touch or not.
    stiffest: f64,
    mass: f64,
    /// Contacts at the last check of the stiffness.
    checked_contacts: u64,
    /// Share of the full push that the next step may have.
    push: f64,
    mixing: f64,
    positive_steps: u32,
    contacts: ContactSums,
    /// While the boundary is held between two corrections of the servo.
    boundary_is_held: bool,
    relaxed: Relaxed,
}

impl<'a, C: ContactLaw<Discs>> FrameRelaxation<'a, C> {
    pub(crate) fn new(
        geometry: &'a FrameGeometry,
        options: &'a FrameOptions,
        constraint: FrameConstraint,
        turning: Rotations,
        body: Body<Discs, C>,
        state: &GrainState<Discs>,
    ) -> Self {
        let inertias = geometry.radii.iter().map(|radius| INERTIA * radius * radius).collect();
        let law = body.law();
        let of_pair = |radius: &f64| bound(law.stiffness(&law.constants([*radius; 2]), 0.0), *radius, INERTIA);
        let stiffest = geometry.radii.iter().map(of_pair).fold(0.0, f64::max);
        let mut relaxation = Self {
            geometry,
            options,
            constraint,
            turning,
            loads: body.loads.clone(),
            body,
            rotations: state.rotations.clone(),
            largest_load: state.largest_load,
            inertias,
            stiffest,
            mass: 0.0,
            checked_contacts: 0,
            push: 1.0,
            mixing: MIXING,
            positive_steps: 0,
            contacts: ContactSums::default(),
            boundary_is_held: false,
            relaxed: Relaxed::default(),
        };
        relaxation.evaluate();
        relaxation
    }

    /// Stretches the frame by `I + strain` in `ramp_steps` steps and relaxes it.
    pub(crate) fn solve(&mut self, strain: &Plane, ramp_steps: u32) -> Relaxed {
        self.relaxed.ramp_steps = ramp_steps;
        let servo = matches!(self.options.control, FrameControl::Servo { .. })
            && self.constraint == FrameConstraint::Periodic;
        self.boundary_is_held = servo;
        let mut before = plane::IDENTITY;
        for step in 1..=ramp_steps {
            let stretch = plane::add_scaled(&plane::IDENTITY, f64::from(step) / f64::from(ramp_steps), strain);
            let increment = plane::add_scaled(&[[0.0; 2]; 2], 1.0 / f64::from(ramp_steps), strain);
            let affine = plane::product(&increment, &plane::inverse(&before));
            before = stretch;
            self.advance(&affine);
        }
        self.hold();
        if servo {
            self.correct_boundary();
        }
        self.relaxed.boundary_residual = self.boundary_residual();
        self.relaxed.equilibrated &= self.constraint != FrameConstraint::Periodic
            || self.relaxed.boundary_residual <= self.options.servo_tolerance();
        self.relaxed
    }

    /// The outer loop of [Liu2018] table 2: correct the boundary, relax the inner grains, until opposite loads cancel.
    fn correct_boundary(&mut self) {
        for _ in 0..self.options.most_corrections() {
            if self.boundary_residual() <= self.options.servo_tolerance() || !self.relaxed.equilibrated {
                return;
            }
            self.apply_correction();
            self.hold();
        }
    }

    /// Opposite grains are moved along the sum of their contact loads by `gain` over their summed stiffness. Erratum of
    /// [Liu2018] eq. 34: with boundary forces as external loads, that is minus the contact loads, a positive gain moves
    /// against balance, and the printed iteration diverges.
    fn apply_correction(&mut self) {
        let FrameControl::Servo { gain } = self.options.control else { return };
        let stiffness = self.stiffness_sums();
        let stop = |grain: &mut crate::programs::specimen::Grain<Discs>| {
            grain.velocity = Tuple::zero();
            grain.spin = Tuple::zero();
        };
        self.body.grains.iter_mut().for_each(stop);
        let free = if self.boundary_turns() { gain } else { 0.0 };
        for &[minus, plus] in &self.geometry.pairs {
            let force = self.body.loads[minus].force.plus(self.body.loads[plus].force);
            let moment = self.body.loads[minus].moment.plus(self.body.loads[plus].moment);
            let [normal, turning] = [0, 1].map(|kind| stiffness[minus][kind] + stiffness[plus][kind]);
            if normal > 0.0 {
                let shift = force.scaled(gain / normal);
                let turn = if turning > 0.0 { moment.scaled(free / turning) } else { [0.0] };
                for grain in [minus, plus] {
                    let grain = &mut self.body.grains[grain];
                    grain.position = grain.position.plus(shift);
                    grain.spin = turn;
                }
            }
        }
        let corners = self.geometry.corners;
        let moment: f64 = corners.iter().map(|corner| self.body.loads[*corner].moment[0]).sum();
        let turning: f64 = corners.iter().map(|corner| stiffness[*corner][1]).sum();
        for corner in corners {
            self.body.grains[corner].spin = [if turning > 0.0 { free * moment / turning } else { 0.0 }];
        }
        for (rotation, grain) in self.rotations.iter_mut().zip(&self.body.grains) {
            *rotation += grain.spin[0];
        }
        self.evaluate();
        self.body.grains.iter_mut().for_each(stop);
    }

    /// Per grain: sum of contact stiffnesses against motion, N/m, and against rotation, N m.
    fn stiffness_sums(&self) -> Vec<[f64; 2]> {
        let mut sums = vec![[0.0; 2]; self.geometry.places.len()];
        for index in self.body.touching() {
            let slot = &self.body.slots[index];
            let [normal, tangential, _] = slot.stiffness(self.body.law()).map(|stiffness| slot.weight * stiffness);
            let pair = self.body.pairs[index];
            for grain in [pair.origin as usize, pair.end as usize] {
                let radius = self.geometry.radii[grain];
                sums[grain][0] += normal + tangential;
                sums[grain][1] += tangential * radius * radius;
            }
        }
        sums
    }

    /// Relaxes without affine motion until the criterion holds, the grains get no nearer to rest or the step cap is reached.
    fn hold(&mut self) {
        let mut monitor = ConvergenceMonitor::new(self.geometry.places.len(), 2);
        let mut hits = 0;
        for step in 0..=self.options.max_steps() {
            self.relaxed.unbalanced = self.unbalanced();
            let (measure, tolerance, needed) = match self.options.damping {
                FrameDamping::Fire => (self.relaxed.unbalanced, self.options.tolerance(), 1),
                FrameDamping::Local { .. } => (self.energy_ratio(), self.options.energy_tolerance(), ENERGY_HITS),
            };
            hits = if measure <= tolerance { hits + 1 } else { 0 };
            if hits >= needed && step >= 10 {
                self.relaxed.equilibrated = true;
                return;
            }
            // The frame keeps its damping where the cell would take another: only the end of the watch is heeded.
            let imbalance = Imbalance { measure, of_present: measure, ratio: measure };
            if monitor.note(step, &imbalance, self.contacts.normal_force) == Advice::End {
                break;
            }
            if step < self.options.max_steps() {
                self.advance(&[[0.0; 2]; 2]);
            }
        }
        self.relaxed.equilibrated = false;
    }

    /// One step: kick, move with the affine motion, evaluate.
    fn advance(&mut self, affine: &Plane) {
        let is_due = self.relaxed.force_evaluations.is_multiple_of(STIFFNESS_INTERVAL) || self.mass == 0.0;
        if is_due || self.contacts.contacts as f64 > (1.0 + CONTACT_GROWTH) * self.checked_contacts as f64 {
            self.raise_mass();
        }
        self.steer();
        // Grains that are not to turn get no moment either.
        let free = if self.boundary_turns() { 1.0 } else { 0.0 };
        dispatch(KickAndMove {
            grains: &mut self.body.grains,
            rotations: &mut self.rotations,
            loads: &self.loads,
            inertias: &self.inertias,
            affine,
            push: self.push,
            turning_push: self.push * free,
            mass: self.mass,
        });
        self.evaluate();
    }

    /// Damps the velocities before the kick, and for local damping the loads.
    fn steer(&mut self) {
        match self.options.damping {
            FrameDamping::Fire => self.steer_by_fire(),
            FrameDamping::Local { coefficient } => {
                for (load, grain) in self.loads.iter_mut().zip(&mut self.body.grains) {
                    // A grain that touches nothing is damped by nothing: it would fly on for ever.
                    if *load == Load::none() {
                        grain.velocity = Tuple::zero();
                        grain.spin = Tuple::zero();
                    }
                    for (force, velocity) in load.force.iter_mut().zip(grain.velocity) {
                        *force -= coefficient * force.abs() * sign(velocity);
                    }
                    load.moment[0] -= coefficient * load.moment[0].abs() * sign(grain.spin[0]);
                }
            }
        }
    }

    fn steer_by_fire(&mut self) {
        let (grains, loads, inertias) = (&mut self.body.grains, &self.loads, &self.inertias);
        let [power, motion, force] = dispatch(PowerAndSquares { grains, loads, inertias });
        self.push = 1.0;
        if power < 0.0 {
            self.push = descent_share(SAFETY);
            self.mixing = MIXING;
            self.positive_steps = 0;
            for grain in grains {
                grain.velocity = Tuple::zero();
                grain.spin = Tuple::zero();
            }
            return;
        }
        let turn = if force > 0.0 { self.mixing * (motion / force).sqrt() } else { 0.0 };
        dispatch(FireMixing { grains, loads, inertias, turn, keep: 1.0 - self.mixing });
        self.positive_steps += 1;
        if self.positive_steps > DOWNHILL_STEPS {
            self.mixing *= MIXING_DECAY;
        }
    }

    fn raise_mass(&mut self) {
        self.checked_contacts = self.contacts.contacts;
        let stiffness = self.body.own_stiffness(INERTIA);
        let loose = FEWEST_CONTACTS * self.stiffest;
        let largest = 2.0 * stiffness.iter().map(|own| own.stiffness).fold(loose, f64::max);
        let damping = match self.options.damping {
            FrameDamping::Fire => 1.0,
            FrameDamping::Local { coefficient } => 1.0 + coefficient,
        };
        self.mass = self.mass.max(damping * largest / (4.0 * SAFETY * SAFETY)).max(f64::MIN_POSITIVE);
    }

    fn evaluate(&mut self) {
        self.body.keep_list_complete();
        self.contacts = self.body.evaluate(1.0);
        self.relaxed.force_evaluations += 1;
        self.relaxed.dissipation += self.contacts.dissipation;
        self.loads.clone_from(&self.body.loads);
        let blocked = match self.turning {
            Rotations::Free => self.loads.len(),
            Rotations::InnerBlocked => self.geometry.boundary,
            Rotations::Blocked => 0,
        };
        for load in &mut self.loads[blocked..] {
            load.moment = Tuple::zero();
        }
        let held = if self.boundary_is_held { FrameConstraint::Linear } else { self.constraint };
        project(held, self.geometry, &self.inertias, &mut self.loads);
    }

    /// Whether the grains of the boundary may turn.
    fn boundary_turns(&self) -> bool {
        self.turning != Rotations::Blocked
    }

    /// Sums of the last evaluation.
    pub(crate) fn contacts(&self) -> ContactSums {
        self.contacts
    }

    /// Sum of normal forces, N, if the frame has come to rest; 0 otherwise.
    pub(crate) fn load_at_rest(&self) -> f64 {
        if self.relaxed.equilibrated { self.contacts.normal_force } else { 0.0 }
    }

    /// Mean normal force of a contact, N, by which forces out of balance are measured. Where grains only graze each other any more, they are
    /// measured by a share of what the frame once carried, see [`LEAST_LOAD`].
    fn mean_force(&self) -> f64 {
        let present = self.contacts.normal_force / (self.contacts.contacts.max(1)) as f64;
        present.max(LEAST_LOAD * self.largest_load / self.body.grains.len() as f64)
    }

    /// Largest load left on a grain over the mean normal contact force; 0 without contacts.
    pub(crate) fn unbalanced(&self) -> f64 {
        let largest = self.loads.iter().zip(&self.geometry.radii).fold(0.0, |largest: f64, (load, radius)| {
            largest.max(load.force.dot(load.force).sqrt()).max(load.moment[0].abs() / radius)
        });
        if largest == 0.0 || self.contacts.contacts == 0 { 0.0 } else { largest / self.mean_force() }
    }

    /// Kinetic over the size of the stored energy, [Liu2018] eq. 31; 0 where nothing moves or nothing touches. What cohesive contacts
    /// store may be negative, and a negative ratio would pass for rest.
    fn energy_ratio(&self) -> f64 {
        let grains = self.body.grains.iter().zip(&self.inertias);
        let kinetic: f64 = grains
            .map(|(grain, inertia)| grain.velocity.dot(grain.velocity) + inertia * grain.spin[0] * grain.spin[0])
            .sum();
        if kinetic == 0.0 || self.contacts.contacts == 0 {
            return 0.0;
        }
        0.5 * self.mass * kinetic / self.contacts.elastic_energy.abs()
    }

    /// How far opposite boundary loads are from cancelling, in mean contact forces: [Liu2018] eq. 37 and table 2. Erratum:
    /// the printed norm divides by mass times radius over the square of the numerical time step, which has nothing to do
    /// with the forces; used here are the mean contact force and the mean radius.
    pub(crate) fn boundary_residual(&self) -> f64 {
        let loads = &self.body.loads;
        let radius = self.geometry.radii.iter().sum::<f64>() / self.geometry.radii.len() as f64;
        let turning = if self.boundary_turns() { 1.0 / (radius * radius) } else { 0.0 };
        let mut square = 0.0;
        for &[minus, plus] in &self.geometry.pairs {
            let force = loads[minus].force.plus(loads[plus].force);
            let moment = loads[minus].moment[0] + loads[plus].moment[0];
            square += force.dot(force) + turning * moment * moment;
        }
        let corner: f64 = self.geometry.corners.iter().map(|corner| loads[*corner].moment[0]).sum();
        square += turning * corner * corner;
        if square == 0.0 { 0.0 } else { square.sqrt() / self.mean_force() }
    }
}

fn sign(value: f64) -> f64 {
    if value > 0.0 {
        1.0
    } else if value < 0.0 {
        -1.0
    } else {
        0.0
    }
}
