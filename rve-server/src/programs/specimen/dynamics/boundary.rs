//! What sides do besides pressing: glued layers, walls that move along their planes, periodic sides that strain.

use super::super::SpecimenSpace;
use super::super::body::mean_place;
use super::super::contact::Grain;
use super::super::state_stream::StateStream;
use super::Dynamics;
use crate::contact::ContactLaw;
use crate::simd::Tuple;
use crate::space::{Components, Tensor, apply};

/// The homogeneous flow of moving periodic sides. Local damping asks for the velocity against it: against the absolute velocity a
/// grain would be damped otherwise than its own image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flow<S: SpecimenSpace> {
    /// Place that rests in it, m: the mean place of the grains when sides first moved.
    centre: S::Coordinates<f64>,
    /// Velocity gradient, 1/s.
    gradient: S::Tensor,
    /// Rotation velocity, rad/s.
    spin: S::Axial<f64>,
}

impl<S: SpecimenSpace> Flow<S> {
    fn new(centre: S::Coordinates<f64>, gradient: S::Tensor) -> Self {
        // Half the curl; in the plane its only component is about z.
        let about = |axis: usize| {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            0.5 * (gradient[j][i] - gradient[i][j])
        };
        let spin = <S::Axial<f64>>::build(|component| about(if S::DIMENSION == 2 { 2 } else { component }));
        Self { centre, gradient, spin }
    }

    fn velocity(&self, place: S::Coordinates<f64>) -> S::Coordinates<f64> {
        let lead = place.minus(self.centre);
        let velocity = apply(&self.gradient, S::Vector::from_fn(|axis| lead.as_ref()[axis]));
        <S::Coordinates<f64>>::build(|axis| velocity[axis])
    }

    /// Velocity and spin of a grain against the flow.
    #[inline(always)]
    pub(super) fn own_motion(&self, grain: &Grain<S>) -> (S::Coordinates<f64>, S::Axial<f64>) {
        (grain.velocity.minus(self.velocity(grain.position)), grain.spin.minus(self.spin))
    }
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Dynamics<S, C> {
    /// Fixes the grains nearer than `depth`, m, to these walls: a rigid layer that does not rotate, [Liu2015] section 3.4. A
    /// grain that two walls reach belongs to the first. The walls take over what the grains have of kinetic energy and what
    /// was stored in their contacts with the wall.
    pub fn grip(&mut self, walls: impl Iterator<Item = usize>, depth: f64) {
        let before = self.kinetic_energy();
        let mut stored = 0.0;
        for wall in walls {
            stored += self.walls[wall].grip(&self.body.grains, &self.body.loads, depth, &mut self.driven);
        }
        self.gather_viscous();
        self.contacts.elastic_energy -= stored;
        self.wall_work += self.kinetic_energy() - before - stored;
    }

    /// Gives the periodic sides these rates, m/s per axis. The grains take the change of the flow at once, so that it is
    /// homogeneous from the start and need not travel inwards as a wave; this work is that of the sides.
    pub fn strain_sides(&mut self, rates: [S::Vector; 3]) {
        if rates == self.body.side_rates() {
            return;
        }
        let centre = match &self.flow {
            Some(flow) => flow.centre,
            None => mean_place::<S>(self.body.grains.iter().map(|grain| grain.position)),
        };
        let flow_of = |dynamics: &Self| Flow::new(centre, dynamics.body.flow_gradient().unwrap_or(S::Tensor::ZERO));
        let before = self.kinetic_energy();
        let old: Flow<S> = flow_of(self);
        self.body.strain_sides(rates);
        let new: Flow<S> = flow_of(self);
        for (grain, driven) in self.body.grains.iter_mut().zip(&self.driven) {
            if !driven {
                let change = new.velocity(grain.position).minus(old.velocity(grain.position));
                grain.velocity = grain.velocity.plus(change);
                if self.motion.rotations_free {
                    grain.spin = grain.spin.plus(new.spin.minus(old.spin));
                }
            }
        }
        self.flow = Some(new);
        let work = self.kinetic_energy() - before;
        self.wall_work += work;
        self.shear_work += work;
    }

    /// Keeps the flow that of the sides as they are now: their rates stay, their lengths do not.
    pub(super) fn follow_sides(&mut self) {
        if let (Some(flow), Some(gradient)) = (&mut self.flow, self.body.flow_gradient()) {
            *flow = Flow::new(flow.centre, gradient);
        }
    }

    /// Work of walls along their planes and of periodic sides in a part of a step, s, at the present forces.
    pub(super) fn add_shear_work(&mut self, step: f64) {
        let walls = self.walls.iter().fold(0.0, |sum, wall| sum + wall.shear_power());
        let power = walls + self.body.side_power();
        if power != 0.0 {
            self.shear_work += step * power;
            self.wall_work += step * power;
        }
    }

    /// Glued grains have the velocity of their wall.
    pub(super) fn carry_glued(&mut self) {
        for wall in &self.walls {
            let velocity = wall.motion();
            for &grain in &wall.glued {
                let grain = &mut self.body.grains[grain as usize];
                grain.velocity = velocity;
                grain.spin = Tuple::zero();
            }
        }
    }

    /// A wall bears what its glued layer bears.
    pub(super) fn gather_glued(&mut self) {
        for wall in &mut self.walls {
            for &grain in &wall.glued {
                wall.force = wall.force.plus(self.body.loads[grain as usize].force);
                wall.stiffness += self.body.stiffness_against_free(grain as usize, &self.driven);
            }
        }
    }

    /// How much of what the walls bear is contact viscosity.
    pub(super) fn gather_viscous(&mut self) {
        if self.body.damping_ratio() == 0.0 {
            return;
        }
        for wall in &mut self.walls {
            let layer = wall
                .glued
                .iter()
                .fold(0.0, |sum, grain| sum - self.body.viscous_force(*grain as usize).dot(wall.normal));
            wall.viscous_force = wall.viscous_force_of_contacts() + layer;
        }
    }

    /// Saves or loads the state of grains, contacts, walls and energy.
    pub(crate) fn keep(&mut self, stream: &mut StateStream<'_>) {
        self.body.keep(stream);
        self.walls.iter_mut().for_each(|wall| wall.keep(stream, &self.body.grains));
        stream.fixed(&mut self.driven, |stream, driven| stream.flag(driven));
        stream.fixed(&mut self.masses, |stream, mass| stream.number(mass));
        stream.fixed(&mut self.rotations, |stream, rotation| stream.numbers(rotation.as_mut()));
        stream.count(&mut self.steps);
        stream.count(&mut self.shortenings);
        stream.sums(&mut self.contacts);
        stream.numbers(&mut self.works);
        for number in [
            &mut self.time,
            &mut self.step,
            &mut self.wall_work,
            &mut self.shear_work,
            &mut self.raised,
            &mut self.first_energy,
            &mut self.looked_at,
        ] {
            stream.number(number);
        }
        let mut flows = self.flow.is_some();
        stream.flag(&mut flows);
        if flows {
            let mut centre = self.flow.map_or(Tuple::zero(), |flow| flow.centre);
            stream.numbers(centre.as_mut());
            self.flow = Some(Flow::new(centre, self.body.flow_gradient().unwrap_or(S::Tensor::ZERO)));
        }
    }
}
