//! One contact of a body: between two grains, or between a grain and a plane wall.
//!
//! The forces come from the same laws as in periodic cells; conventions of one contact: see [`crate::cell::network`].

use super::SpecimenSpace;
use super::contact_forces::{Approach, ContactForces, ForceSums, History, contact_forces, share_with_dashpot};
use crate::contact::{AT_LIMIT, ContactLaw};
use crate::simd::{Real, Tuple, put_lane, take_lane};

/// A grain as contacts see it. Rates are per second, or per step where the step is the unit of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain<S: SpecimenSpace> {
    /// Centre, m.
    pub position: S::Coordinates<f64>,
    /// Velocity, m/s.
    pub velocity: S::Coordinates<f64>,
    /// Rotation velocity, rad/s.
    pub spin: S::Axial<f64>,
    /// Radius, m.
    pub radius: f64,
}

/// Force and moment on a grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<S: SpecimenSpace> {
    /// Force, N.
    pub force: S::Coordinates<f64>,
    /// Moment about the centre, N m.
    pub moment: S::Axial<f64>,
}

impl<S: SpecimenSpace> Load<S> {
    /// Nothing.
    pub fn none() -> Self {
        Self { force: Tuple::zero(), moment: Tuple::zero() }
    }
}

/// Force of a contact on its two grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PairLoad<S: SpecimenSpace> {
    /// Force on the origin grain, N; the opposite acts on the end grain.
    pub(crate) force: S::Coordinates<f64>,
    /// Moments on origin and end grain, N m.
    pub(crate) moments: [S::Axial<f64>; 2],
}

impl<S: SpecimenSpace> PairLoad<S> {
    pub(crate) fn none() -> Self {
        Self { force: Tuple::zero(), moments: [Tuple::zero(); 2] }
    }
}

/// Sums over contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactSums {
    /// Number of touching pairs.
    pub contacts: u64,
    /// Sum of |f_n|, N.
    pub normal_force: f64,
    /// Work lost to friction since the last evaluation, J.
    pub dissipation: f64,
    /// Work lost to contact viscosity since the last evaluation, J.
    pub viscous_work: f64,
    /// Stored energy, J.
    pub elastic_energy: f64,
    /// Contacts between grains at their friction limit.
    pub sliding: u64,
    /// Largest overlap over the smaller radius.
    pub largest_overlap: f64,
}

impl ContactSums {
    /// Adds those of other contacts.
    pub(crate) fn add(&mut self, other: &Self) {
        self.contacts += other.contacts;
        self.normal_force += other.normal_force;
        self.dissipation += other.dissipation;
        self.viscous_work += other.viscous_work;
        self.elastic_energy += other.elastic_energy;
        self.sliding += other.sliding;
        self.largest_overlap = self.largest_overlap.max(other.largest_overlap);
    }
}

/// History and constants of one listed pair, or of a grain near a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slot<S: SpecimenSpace, C: ContactLaw<S>> {
    pub(crate) radii: [f64; 2],
    pub(super) constants: C::Constants<f64>,
    /// Share of the contact that belongs to this body, 1 unless it is shared with a neighbour.
    pub(crate) weight: f64,
    /// Twice the damping ratio times the square root of the reduced mass; 0 without contact viscosity.
    pub(super) viscosity: f64,
    /// Viscous part of the normal force at the last evaluation, N, positive while the grains approach.
    pub(super) viscous_force: f64,
    pub(crate) touches: bool,
    pub(crate) direction: S::Coordinates<f64>,
    pub(crate) tangential_force: S::Axial<f64>,
    pub(super) memory: C::Memory<f64>,
    /// At the last evaluation, if it touched then, m.
    pub(crate) overlap: f64,
    /// Elastic normal force at the last evaluation, N, negative in compression.
    pub(crate) normal_force: f64,
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Slot<S, C> {
    /// A pair that does not touch yet. `masses` matter for contact viscosity alone.
    pub(crate) fn new(law: &C, radii: [f64; 2], masses: [f64; 2], damping_ratio: f64, weight: f64) -> Self {
        let reduced = masses[0] * masses[1] / (masses[0] + masses[1]);
        Self::with(radii, law.constants(radii), viscosity(reduced, damping_ratio), weight)
    }

    /// A grain that does not touch its wall yet.
    pub(crate) fn at_wall(law: &C, radius: f64, mass: f64, damping_ratio: f64) -> Self {
        Self::with([radius, f64::INFINITY], law.wall_constants(radius), viscosity(mass, damping_ratio), 1.0)
    }

    fn with(radii: [f64; 2], constants: C::Constants<f64>, viscosity: f64, weight: f64) -> Self {
        Self {
            radii,
            constants,
            weight,
            viscosity,
            viscous_force: 0.0,
            touches: false,
            direction: Tuple::zero(),
            tangential_force: Tuple::zero(),
            memory: Tuple::zero(),
            overlap: 0.0,
            normal_force: 0.0,
        }
    }

    /// Normal, tangential and rolling stiffness at the last overlap, N/m and N m.
    pub(crate) fn stiffness(&self, law: &C) -> [f64; 3] {
        law.stiffness(&self.constants, self.overlap)
    }

    /// Stored energy at the last evaluation, J.
    pub(super) fn stored(&self, law: &C) -> f64 {
        let energy = law.energy(&self.constants, self.overlap, S::length(self.tangential_force), &self.memory);
        if self.touches { self.weight * energy } else { 0.0 }
    }

    /// The same contact named from its other grain.
    pub(super) fn seen_from_end(self, law: &C) -> Self {
        let mut slot = self;
        slot.radii.reverse();
        slot.direction = slot.direction.scaled(-1.0);
        law.carry(&mut slot.memory, |moment| moment.scaled(-1.0));
        slot
    }

    /// Whether the tangential force was at its limit at the last evaluation.
    pub(super) fn is_sliding(&self, law: &C) -> bool {
        S::length(self.tangential_force) >= AT_LIMIT * self.friction_limit(law)
    }

    /// Largest tangential force at the last evaluation, N: what cohesion and the dashpot add to the repulsion counts.
    pub(crate) fn friction_limit(&self, law: &C) -> f64 {
        let mut constants = self.constants;
        if self.viscosity > 0.0 {
            let share =
                share_with_dashpot(law, &constants, self.normal_force, self.normal_force - self.viscous_force);
            constants = law.limits_scaled(&constants, share);
        }
        law.friction_limit(&constants, self.overlap)
    }

    /// Contribution of the contact to the stability bound of its grain of radius `radius`.
    pub(super) fn own(&self, law: &C, radius: f64, inertia_factor: f64) -> OwnStiffness {
        let stiffness = self.stiffness(law);
        let root = self.weight * stiffness[0].sqrt();
        OwnStiffness {
            stiffness: self.weight * bound(stiffness, radius, inertia_factor),
            root,
            dashpot: self.viscosity * root,
        }
    }

    /// Viscosity for other masses: `reduced` is the reduced mass of the pair, kg.
    pub(super) fn change_mass(&mut self, reduced: f64, damping_ratio: f64) {
        self.viscosity = viscosity(reduced, damping_ratio);
    }

    /// Restores tangential force and rolling moment along a branch that the contact has at this moment. Returns whether the
    /// grains touch; nothing is restored if they do not.
    pub(crate) fn adopt(
        &mut self,
        law: &C,
        branch: S::Coordinates<f64>,
        tangential_force: S::Axial<f64>,
        moment: S::Axial<f64>,
    ) -> bool {
        let length = branch.dot(branch).sqrt();
        let overlap = (self.radii[0] + self.radii[1]) - length;
        if overlap <= 0.0 {
            return false;
        }
        self.direction = branch.scaled(1.0 / length);
        self.tangential_force = tangential_force;
        self.memory = law.resumed(overlap, moment);
        self.touches = true;
        true
    }

    /// The pair has come apart.
    #[inline(always)]
    pub(crate) fn open(&mut self, law: &C, sums: &mut ContactSums) {
        sums.dissipation += self.weight * law.opening_loss(&self.constants, self.tangential_force, &self.memory);
        self.touches = false;
        self.direction = Tuple::zero();
        self.tangential_force = Tuple::zero();
        self.memory = Tuple::zero();
        self.overlap = 0.0;
        self.normal_force = 0.0;
        self.viscous_force = 0.0;
    }

    /// Puts constants and history into one lane.
    #[inline(always)]
    pub(super) fn put_into_lane<R: Real>(&self, history: &mut History<S, C, R>, radii: &mut [R; 2], lane: usize) {
        for (radius, own) in radii.iter_mut().zip(self.radii) {
            radius.set_lane(lane, own);
        }
        put_lane(&mut history.constants, lane, &self.constants);
        history.weight.set_lane(lane, self.weight);
        history.viscosity.set_lane(lane, self.viscosity);
        history.viscous_force.set_lane(lane, self.viscous_force);
        history.touched.set_lane(lane, f64::from(u8::from(self.touches)));
        put_lane(&mut history.direction, lane, &self.direction);
        put_lane(&mut history.tangential_force, lane, &self.tangential_force);
        put_lane(&mut history.memory, lane, &self.memory);
    }

    /// Takes the new history from one lane.
    #[inline(always)]
    pub(super) fn keep_lane<R: Real>(
        &mut self,
        approach: &Approach<S, R>,
        forces: &ContactForces<S, C, R>,
        lane: usize,
    ) {
        self.touches = true;
        self.direction = take_lane(&approach.direction, lane);
        self.tangential_force = take_lane(&forces.tangential_force, lane);
        self.memory = take_lane(&forces.memory, lane);
        self.overlap = approach.overlap.lane(lane);
        self.normal_force = forces.normal_force.lane(lane);
        self.viscous_force = forces.viscous_force.lane(lane);
    }

    /// Forces of a grain that overlaps a wall with the inward unit normal `normal`, after a motion of `step` seconds.
    #[expect(clippy::too_many_arguments, reason = "the parts of one contact with a wall, put together in one place")]
    pub(crate) fn press_wall(
        &mut self,
        law: &C,
        overlap: f64,
        normal: S::Coordinates<f64>,
        wall_velocity: S::Coordinates<f64>,
        grain: &Grain<S>,
        step: f64,
        sums: &mut ContactSums,
    ) -> PairLoad<S> {
        let direction = normal.scaled(-1.0);
        let arm = grain.radius - 0.5 * overlap;
        let relative = wall_velocity.minus(grain.velocity);
        let spin = grain.spin.scaled(step);
        let moved = S::cross(direction, relative.scaled(step));
        let approach = Approach {
            direction,
            overlap,
            arms: [arm, 0.0],
            slip: S::across(moved.minus(spin.scaled(arm)), direction),
            carried: self.tangential_force,
            rolling: S::across(spin, direction),
            closing: -direction.dot(relative),
        };
        let (mut history, mut radii) = (History::none(), [0.0; 2]);
        self.put_into_lane(&mut history, &mut radii, 0);
        let forces = contact_forces(law, &history, &approach, grain.radius, step, self.viscosity > 0.0);
        self.keep_lane(&approach, &forces, 0);
        let mut own = ForceSums::default();
        own.add(&forces.sums, true);
        own.add_to(sums);
        sums.contacts += 1;
        PairLoad { force: forces.force, moments: forces.moments }
    }
}

/// Sum over all contacts of a grain, for the stability limit of the motion. A mode of squared frequency
/// `omega^2` and viscous rate `c / m` is stable in leap-frog steps `dt`, whose dashpots see the velocity half a step ago,
/// while `dt^2 omega^2 + 2 dt c / m < 4`. Both sums bound their share because the energy, and the loss, of a contact is at
/// most that of both grains moving against each other: `dt^2 stiffness + 2 dt dashpot < 2 m` for every grain is enough.
/// Erratum of [Liu2015] eq. 64: the frequency of a single contact bounds nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnStiffness {
    /// Sum of the largest stiffness of each contact, N/m.
    pub stiffness: f64,
    /// Sum of the roots of the normal stiffnesses, (N/m)^(1/2).
    pub root: f64,
    /// Sum of the viscosities, N s/m.
    pub dashpot: f64,
}

impl OwnStiffness {
    pub(super) fn add(&mut self, other: &Self) {
        self.stiffness += other.stiffness;
        self.root += other.root;
        self.dashpot += other.dashpot;
    }

    /// Longest stable step, s, of a grain of this mass, kg; infinite where nothing holds it.
    pub(super) fn longest_step(&self, mass: f64) -> f64 {
        let Self { stiffness, dashpot, .. } = *self;
        if stiffness == 0.0 {
            f64::INFINITY
        } else if dashpot == 0.0 {
            2.0 / (2.0 * stiffness / mass).sqrt()
        } else {
            2.0 * mass / (dashpot + (dashpot * dashpot + 2.0 * stiffness * mass).sqrt())
        }
    }

    /// Mass for which a step of 1 is this share of the longest stable one, with contacts of this damping ratio. The reduced
    /// mass of a contact is below that of either grain, so a dashpot is at most `2 ratio sqrt(mass) root`.
    pub(super) fn mass_for(&self, safety: f64, damping_ratio: f64) -> f64 {
        if damping_ratio == 0.0 {
            return 2.0 * self.stiffness / (4.0 * safety * safety);
        }
        let dashpot = damping_ratio * self.root;
        let root = (dashpot + (dashpot * dashpot + 0.5 * self.stiffness).sqrt()) / safety;
        root * root
    }
}

/// Largest stiffness of one contact for the motion of one grain of mass 1 and inertia `inertia_factor radius^2`, N/m. The
/// tangential spring couples translation and spin, the rolling one adds to the spin alone: the larger eigenvalue of both.
pub(crate) fn bound([normal, tangential, rolling]: [f64; 3], radius: f64, inertia_factor: f64) -> f64 {
    if rolling == 0.0 {
        return normal.max(tangential * (1.0 + 1.0 / inertia_factor));
    }
    let turning = (tangential + rolling / (radius * radius)) / inertia_factor;
    let coupling = tangential / inertia_factor.sqrt();
    normal.max(0.5 * (tangential + turning) + (0.5 * (tangential - turning)).hypot(coupling))
}

/// Twice the damping ratio times the root of the reduced mass: times the root of a stiffness it is a dashpot.
fn viscosity(reduced_mass: f64, damping_ratio: f64) -> f64 {
    if damping_ratio > 0.0 { 2.0 * damping_ratio * reduced_mass.sqrt() } else { 0.0 }
}
