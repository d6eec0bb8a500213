//! Two grains without a cell: collisions and prescribed motions, to see what a contact law does.
//!
//! The grains have their real masses and move by an explicit leapfrog in real time. A plane is a grain that is very large
//! and does not move.

use rve_server::contact::{ContactLaw, ContactMotion};
use rve_server::simd::Tuple;
use rve_server::space::{Axial, Components, KernelSpace, Space};

/// One of the two grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body<S: Space> {
    /// Radius, m.
    pub(crate) radius: f64,
    /// 1 / mass, 1/kg; 0 for a grain that does not move.
    pub(crate) inverse_mass: f64,
    /// 1 / moment of inertia, 1/(kg m2); 0 for a grain that does not rotate.
    pub(crate) inverse_inertia: f64,
    /// Centre, m.
    pub(crate) position: S::Vector,
    /// Velocity, m/s.
    pub(crate) velocity: S::Vector,
    /// Angular velocity, rad/s.
    pub(crate) rotation_velocity: S::Spin,
}

impl<S: Space> Body<S> {
    /// A homogeneous grain of a density, kg/m3, at rest.
    pub(crate) fn of_density(radius: f64, density: f64, position: S::Vector) -> Self {
        let mass = density * S::grain_measure(radius);
        Self {
            inverse_mass: 1.0 / mass,
            inverse_inertia: 1.0 / (S::INERTIA_FACTOR * mass * radius * radius),
            ..Self::fixed(radius, position)
        }
    }

    /// A grain that neither moves nor rotates.
    pub(crate) fn fixed(radius: f64, position: S::Vector) -> Self {
        Self {
            radius,
            inverse_mass: 0.0,
            inverse_inertia: 0.0,
            position,
            velocity: S::Vector::ZERO,
            rotation_velocity: S::Spin::ZERO,
        }
    }
}

/// Two grains and what is between them.
#[derive(Clone, Debug)]
pub(crate) struct TwoBody<S: Space, L: ContactLaw<S::Kernel>> {
    /// Contact law.
    pub(crate) law: L,
    /// Origin and end grain.
    pub(crate) bodies: [Body<S>; 2],
    constants: L::Constants<f64>,
    memory: L::Memory<f64>,
    tangential: Axial<S>,
    direction: S::Vector,
    touches: bool,
    force: S::Vector,
    moments: [S::Spin; 2],
    normal_force: f64,
}

impl<S: Space, L: ContactLaw<S::Kernel>> TwoBody<S, L> {
    /// The two grains as they lie, with the forces of their overlap.
    pub(crate) fn new(law: L, bodies: [Body<S>; 2]) -> Self {
        let mut pair = Self {
            law,
            constants: law.constants([bodies[0].radius, bodies[1].radius]),
            bodies,
            memory: Tuple::zero(),
            tangential: Tuple::zero(),
            direction: S::Vector::ZERO,
            touches: false,
            force: S::Vector::ZERO,
            moments: [S::Spin::ZERO; 2],
            normal_force: 0.0,
        };
        pair.evaluate([S::Spin::ZERO; 2]);
        pair
    }

    /// Sum of the radii minus the distance of the centres, m; negative without contact.
    pub(crate) fn overlap(&self) -> f64 {
        self.bodies[0].radius + self.bodies[1].radius - self.branch().norm()
    }

    /// Normal force, N, negative in compression; 0 without contact.
    pub(crate) fn normal_force(&self) -> f64 {
        self.normal_force
    }

    /// Tangential force on the origin grain, N.
    pub(crate) fn tangential_force(&self) -> S::Tangential {
        S::from_axial(self.tangential, self.direction)
    }

    /// Contact force on the origin grain, N; its opposite acts on the end grain.
    pub(crate) fn force(&self) -> S::Vector {
        self.force
    }

    /// Moments of the contact on both grains, N m.
    pub(crate) fn moments(&self) -> [S::Spin; 2] {
        self.moments
    }

    /// Kinetic energy, J; of grains that do not move none is counted.
    pub(crate) fn kinetic_energy(&self) -> f64 {
        let half_over = |inverse: f64| if inverse > 0.0 { 0.5 / inverse } else { 0.0 };
        self.bodies
            .iter()
            .map(|body| {
                half_over(body.inverse_mass) * body.velocity.dot(body.velocity)
                    + half_over(body.inverse_inertia) * body.rotation_velocity.dot(body.rotation_velocity)
            })
            .sum()
    }

    /// One step of `duration` seconds: velocities from the present forces, then positions, then forces.
    pub(crate) fn step(&mut self, duration: f64) {
        for (body, sign, moment) in [(0, 1.0, self.moments[0]), (1, -1.0, self.moments[1])] {
            let body = &mut self.bodies[body];
            body.velocity = body.velocity.plus(self.force.times(sign * duration * body.inverse_mass));
            body.rotation_velocity = body.rotation_velocity.plus(moment.times(duration * body.inverse_inertia));
            body.position = body.position.plus(body.velocity.times(duration));
        }
        self.evaluate([0, 1].map(|body: usize| self.bodies[body].rotation_velocity.times(duration)));
    }

    /// Moves both centres and rotates the grains by these angles in the same step.
    pub(crate) fn place(&mut self, positions: [S::Vector; 2], spins: [S::Spin; 2]) {
        for (body, position) in self.bodies.iter_mut().zip(positions) {
            body.position = position;
        }
        self.evaluate(spins);
    }

    fn branch(&self) -> S::Vector {
        self.bodies[1].position.minus(self.bodies[0].position)
    }

    fn evaluate(&mut self, spins: [S::Spin; 2]) {
        let (branch, overlap) = (self.branch(), self.overlap());
        if overlap <= 0.0 {
            self.touches = false;
            (self.memory, self.tangential) = (Tuple::zero(), Tuple::zero());
            (self.force, self.moments, self.normal_force) = (S::Vector::ZERO, [S::Spin::ZERO; 2], 0.0);
            return;
        }
        let length = branch.norm();
        let direction = branch.times(1.0 / length);
        let arms = [0, 1].map(|body: usize| self.bodies[body].radius - 0.5 * overlap);
        let (slip, carrier) = S::slip(self.direction, direction, length, arms, spins);
        let rolling = S::Kernel::across(S::axial(spins[0].minus(spins[1])), direction);
        let motion = ContactMotion::<S::Kernel, f64> {
            overlap,
            touched: self.touches,
            carried: S::carry(&carrier, self.tangential),
            slip,
            rolling,
        };
        self.law.carry(&mut self.memory, |moment| S::carry(&carrier, moment));
        let response = self.law.respond(&self.constants, &motion, &mut self.memory);
        (self.touches, self.direction, self.tangential) = (true, direction, response.tangential_force);
        let (mut normal, mut tangential) = (response.normal_force, response.tangential_force);
        if let Some(viscous) = response.viscous {
            normal += viscous.normal_force;
            tangential = tangential.plus(viscous.tangential_force);
        }
        self.normal_force = normal;
        self.force = S::contact_force(direction, normal, S::from_axial(tangential, direction));
        let turning = S::spin(tangential);
        let couple = response.couple.map_or(S::Spin::ZERO, S::spin);
        self.moments = [turning.times(arms[0]).plus(couple), turning.times(arms[1]).minus(couple)];
    }
}
