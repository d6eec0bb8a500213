//! Plane walls: rigid, smooth or rough, held, driven at a velocity or servo-controlled to a stress. Any of them can slide along
//! its plane and carry a layer of glued grains.

use super::SpecimenSpace;
use super::contact::{ContactSums, Grain, Load, OwnStiffness, Slot};
use super::state_stream::StateStream;
use crate::contact::ContactLaw;
use crate::simd::Tuple;
use std::collections::BTreeMap;

/// How a wall moves along its normal; along its plane it moves with [`Wall::glide`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WallDrive {
    /// At this velocity along the inward normal, m/s; 0 holds it.
    Velocity(f64),
    /// So that the grains press on it with this force, N. The area that a stress refers to is the caller's.
    Force {
        /// Elastic force of the grains on the wall along its outward normal, N: without that of contact viscosity.
        target: f64,
        /// Speed per force that is missing, relative to the wall's contact stiffness per second, dimensionless.
        gain: f64,
        /// Largest speed, m/s.
        largest_speed: f64,
    },
}

/// One wall.
#[derive(Clone, Debug)]
pub struct Wall<S: SpecimenSpace, C: ContactLaw<S>> {
    /// Name in tables.
    pub name: String,
    /// A point on the wall, m.
    pub point: S::Coordinates<f64>,
    /// Unit normal into the specimen.
    pub normal: S::Coordinates<f64>,
    /// Law of its contacts; a smooth wall has one without friction.
    pub law: C,
    /// How it moves.
    pub drive: WallDrive,
    /// Velocity along its plane, m/s.
    pub glide: S::Coordinates<f64>,
    /// Way along its plane so far, m.
    pub slid: S::Coordinates<f64>,
    /// Grains that move with it, ascending.
    pub glued: Vec<u32>,
    /// Force of the grains on the wall and its glued layer at the last evaluation, N.
    pub force: S::Coordinates<f64>,
    /// Part of the normal force that is contact viscosity, N, as [`Wall::normal_force`] counts it. The servo leaves it out: it answers the
    /// wall's own velocity at once, so that a wall driven by it would chatter.
    pub viscous_force: f64,
    /// Sum of the normal stiffnesses of its contacts and of those between its glued layer and free grains, N/m.
    pub stiffness: f64,
    velocity: f64,
    damping_ratio: f64,
    slots: BTreeMap<u32, Slot<S, C>>,
    near: Vec<u32>,
    travelled: f64,
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Wall<S, C> {
    /// A wall through `point` with the inward unit normal `normal`.
    pub fn new(
        name: &str,
        point: S::Coordinates<f64>,
        normal: S::Coordinates<f64>,
        law: C,
        drive: WallDrive,
        damping_ratio: f64,
    ) -> Self {
        Self {
            name: name.to_owned(),
            point,
            normal,
            law,
            drive,
            glide: Tuple::zero(),
            slid: Tuple::zero(),
            glued: Vec::new(),
            force: Tuple::zero(),
            viscous_force: 0.0,
            stiffness: 0.0,
            velocity: 0.0,
            damping_ratio,
            slots: BTreeMap::new(),
            near: Vec::new(),
            travelled: 0.0,
        }
    }

    /// Force of the grains along the outward normal, N.
    pub fn normal_force(&self) -> f64 {
        -self.force.dot(self.normal)
    }

    /// Velocity along the inward normal, m/s.
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Velocity with the part along its plane, m/s.
    pub(crate) fn motion(&self) -> S::Coordinates<f64> {
        let along_normal = self.normal.scaled(self.velocity);
        if self.glide == Tuple::zero() { along_normal } else { along_normal.plus(self.glide) }
    }

    /// Power that its motion along its plane puts into the grains, W.
    pub(crate) fn shear_power(&self) -> f64 {
        -self.force.dot(self.glide)
    }

    /// Number of grains that touch it.
    pub fn contacts(&self) -> usize {
        self.slots.len()
    }

    /// Moves the wall for one step.
    pub(crate) fn advance(&mut self, step: f64) {
        self.velocity = match self.drive {
            WallDrive::Velocity(velocity) => velocity,
            WallDrive::Force { target, gain, largest_speed } => {
                let missing = target - (self.normal_force() - self.viscous_force);
                // Without contacts there is no stiffness to judge by: approach at the largest speed.
                let wanted = if self.stiffness > 0.0 {
                    gain * missing / (self.stiffness * step)
                } else {
                    missing.signum() * largest_speed
                };
                wanted.clamp(-largest_speed, largest_speed)
            }
        };
        let way = self.velocity * step;
        self.point = self.normal.scaled_plus(way, self.point);
        self.travelled += way.abs();
        self.slid = self.glide.scaled_plus(step, self.slid);
    }

    /// Lists the grains that may touch before the next renewal, and those that have left its reach since they touched last, whose contacts have
    /// yet to open. The wall goes at most half a `skin` before that. A grain may come nearer by a whole one: where the wall has renewed its
    /// own list alone, it may be half a skin off its place in the list of pairs, and go as far to the other side. Grains that do not touch
    /// change no bit.
    pub(crate) fn list(&mut self, grains: &[Grain<S>], skin: f64) {
        self.near.clear();
        for (index, grain) in grains.iter().enumerate() {
            let number = index as u32;
            let is_near = self.gap(grain) < 1.5 * skin || self.slots.contains_key(&number);
            if is_near && self.glued.binary_search(&number).is_err() {
                self.near.push(number);
            }
        }
        self.travelled = 0.0;
    }

    /// Distance of a grain's surface from the wall, m; negative if it touches.
    pub(crate) fn gap(&self, grain: &Grain<S>) -> f64 {
        grain.position.minus(self.point).dot(self.normal) - grain.radius
    }

    /// Fixes the grains whose surface is nearer than `depth`, m, to the wall, except those that are `taken`, and marks them as such.
    /// Their contacts with the wall end; the energy stored in them, J, is returned.
    pub(crate) fn grip(&mut self, grains: &[Grain<S>], loads: &[Load<S>], depth: f64, taken: &mut [bool]) -> f64 {
        let mut stored = 0.0;
        for (index, grain) in grains.iter().enumerate() {
            if taken[index] || self.gap(grain) >= depth {
                continue;
            }
            taken[index] = true;
            let number = index as u32;
            self.glued.push(number);
            self.near.retain(|near| *near != number);
            if let Some(slot) = self.slots.remove(&number) {
                stored += slot.stored(&self.law);
            }
            // What the wall gave to the grain is now within the layer, what others gave to it is borne by the wall.
            self.force = self.force.plus(loads[index].force);
        }
        self.glued.sort_unstable();
        stored
    }

    /// Whether the list must be renewed although no grain has gone far.
    pub(crate) fn has_travelled(&self, skin: f64) -> bool {
        self.travelled >= 0.5 * skin
    }

    /// Adds the loads of all contacts with this wall, in grain order. Sliding along a wall is not counted: a smooth one has no friction
    /// that could hold.
    pub(crate) fn press(
        &mut self,
        grains: &[Grain<S>],
        masses: &[f64],
        step: f64,
        loads: &mut [Load<S>],
        sums: &mut ContactSums,
    ) {
        self.force = Tuple::zero();
        self.stiffness = 0.0;
        let velocity = self.motion();
        let sliding_grains = sums.sliding;
        for &index in &self.near {
            let grain = &grains[index as usize];
            let overlap = grain.radius - grain.position.minus(self.point).dot(self.normal);
            if overlap <= 0.0 {
                if let Some(mut slot) = self.slots.remove(&index) {
                    slot.open(&self.law, sums);
                }
                continue;
            }
            let law = &self.law;
            let slot = self
                .slots
                .entry(index)
                .or_insert_with(|| Slot::at_wall(law, grain.radius, masses[index as usize], self.damping_ratio));
            let load = slot.press_wall(law, overlap, self.normal, velocity, grain, step, sums);
            self.stiffness += slot.stiffness(law)[0];
            self.force = self.force.minus(load.force);
            let total = &mut loads[index as usize];
            total.force = total.force.plus(load.force);
            total.moment = total.moment.plus(load.moments[0]);
        }
        sums.sliding = sliding_grains;
    }

    /// Viscous part of the normal forces of its own contacts, N.
    pub(crate) fn viscous_force_of_contacts(&self) -> f64 {
        self.slots.values().fold(0.0, |sum, slot| sum + slot.viscous_force)
    }

    /// Contribution of each grain's contact with this wall to its stability bound.
    pub(crate) fn own_stiffnesses<'a>(
        &'a self,
        grains: &'a [Grain<S>],
        inertia_factor: f64,
    ) -> impl Iterator<Item = (usize, OwnStiffness)> + 'a {
        self.slots.iter().map(move |(grain, slot)| {
            let grain = *grain as usize;
            (grain, slot.own(&self.law, grains[grain].radius, inertia_factor))
        })
    }

    /// Contact viscosity for other masses of the grains, kg.
    pub(crate) fn change_masses(&mut self, masses: &[f64]) {
        for (grain, slot) in &mut self.slots {
            slot.change_mass(masses[*grain as usize], self.damping_ratio);
        }
    }

    /// Saves or loads its state. What drives it is set in every step.
    pub(crate) fn keep(&mut self, stream: &mut StateStream<'_>, grains: &[Grain<S>]) {
        for vector in [&mut self.point, &mut self.glide, &mut self.slid, &mut self.force] {
            stream.numbers(vector.as_mut());
        }
        for number in [&mut self.viscous_force, &mut self.stiffness, &mut self.velocity, &mut self.travelled] {
            stream.number(number);
        }
        let mut touching: Vec<u32> = self.slots.keys().copied().collect();
        for list in [&mut self.glued, &mut self.near, &mut touching] {
            stream.list(list, &0, |stream, grain| stream.index(grain));
            if list.iter().any(|grain| *grain as usize >= grains.len()) {
                stream.refuse();
                return;
            }
        }
        if stream.is_loading() {
            let law = &self.law;
            let slot = |grain: u32| Slot::at_wall(law, grains[grain as usize].radius, 1.0, self.damping_ratio);
            self.slots = touching.iter().map(|grain| (*grain, slot(*grain))).collect();
        }
        self.slots.values_mut().for_each(|slot| stream.slot(slot));
    }
}
