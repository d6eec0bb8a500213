//! From one instant to the next: forces, velocities, accelerations, reactions and energies of the nodes.

use super::constrained_velocities::given_velocities;
use super::dashpots::next_velocity;
use super::energy::Forces;
use super::handover::Handover;
use super::integrator::Integrator;
use super::masses::element_masses;
use super::stage_context::StageContext;
use crate::element::hourglass::HourglassControl;
use crate::model::assembly::forces::Motion;
use crate::model::stable_step::limits;
use crate::observer::Outcome;
use crate::problem::dynamics::TimeStepRule;
use nalgebra::Vector3;

impl Integrator {
    /// Forces, velocities and the ledger at the start.
    pub(super) fn first_instant(&mut self, context: &StageContext<'_>, handover: &Handover) {
        for given in &context.settings.initial_velocities {
            let axes = context.problem.mesh.dimension.count();
            for &node in context.problem.nodes(&given.nodes).expect("checked before the run") {
                self.velocity[axes * node..axes * (node + 1)].copy_from_slice(&given.value[..axes]);
            }
        }
        for dof in 0..self.velocity.len() {
            // A support that starts to move has its velocity from the start, unless its history says how it starts: only then and at free
            // nodes there is an acceleration.
            if let Some(velocity) = self.prescribed_velocity(context, dof) {
                self.velocity[dof] = context.constraints.velocity_at_start(dof).unwrap_or(velocity);
            }
        }
        let mut velocity = std::mem::take(&mut self.velocity);
        self.apply_constraints(context, &mut velocity, None);
        self.velocity = velocity;
        self.ahead.clone_from(&self.velocity);
        self.collect_forces(context);
        let axes = context.problem.mesh.dimension.count();
        let absorbs = |dof: usize| self.dashpots.is_absorbing(dof / axes) && !context.constraints.is_given(dof);
        let is_linked_as_before = handover.linked_as_before(context.constraints);
        let begun = handover.loads_begun(&self.forces.loads);
        // Linked nodes too: each bears its own share, and links do no work.
        let borne =
            |dof: usize| handover.support(dof, -(self.driving_force(dof) - begun[dof]), is_linked_as_before[dof]);
        self.held = (0..self.velocity.len()).map(|dof| if absorbs(dof) { borne(dof) } else { 0.0 }).collect();
        add(&mut self.forces.loads, &self.held);
        let rate = context.settings.damping.mass;
        for node in 0..self.masses.len() {
            let damper = self.dashpots.of_node(node, self.masses[node], rate);
            let velocity = triple(&self.velocity, axes, node);
            let dashpot = damper * velocity;
            for axis in 0..axes {
                let dof = axes * node + axis;
                self.forces.dashpots[dof] = dashpot[axis];
                if !context.constraints.is_prescribed(dof) {
                    self.acceleration[dof] = (self.driving_force(dof) - dashpot[axis]) / self.masses[node];
                    self.ahead[dof] = self.velocity[dof] + 0.5 * self.step * self.acceleration[dof];
                } else if context.constraints.velocity_at_start(dof).is_some()
                    && let Some(ahead) = self.prescribed_velocity(context, dof)
                {
                    self.acceleration[dof] = (ahead - self.velocity[dof]) / (0.5 * self.step);
                    self.ahead[dof] = ahead;
                }
            }
        }
        let mut ahead = std::mem::take(&mut self.ahead);
        self.apply_constraints(context, &mut ahead, None);
        for dof in self.velocity_constraints.tied() {
            self.acceleration[dof] = (ahead[dof] - self.velocity[dof]) / (0.5 * self.step);
        }
        self.ahead = ahead;
        self.find_reactions(context, axes);
        let per_freedom = self.acceleration.iter().enumerate();
        let left: f64 =
            per_freedom.map(|(dof, rate)| self.masses[dof / axes] * (rate * self.step).powi(2) / 8.0).sum();
        self.monitor.start(self.kinetic_energy(axes), left);
    }

    /// Forces, velocities, accelerations and energies after the displacements `path` (m) of a step; `renews` if the tangents have
    /// been updated, so that the step may be chosen again.
    pub(super) fn next_instant(
        &mut self,
        context: &StageContext<'_>,
        path: &[f64],
        renews: bool,
    ) -> Result<(), Outcome> {
        let before = self.forces.clone();
        let last_step = self.step;
        self.collect_forces(context);
        if renews && self.done < self.total && matches!(context.settings.step, TimeStepRule::Stable { .. }) {
            let masses = element_masses(context.body, context.settings).map_err(Outcome::Refused)?;
            let limits = limits(&self.laws(context), context.constraints, &masses);
            self.choose_step(context, &limits)?;
        }
        let mean_step = 0.5 * (last_step + self.step);
        let axes = context.problem.mesh.dimension.count();
        let rate = context.settings.damping.mass;
        let mut next = context.body.zero();
        for node in 0..self.masses.len() {
            let damper = self.dashpots.of_node(node, self.masses[node], rate);
            let behind = triple(&self.ahead, axes, node);
            let force = Vector3::from_fn(|axis, _| match axis < axes {
                true => self.driving_force(axes * node + axis),
                false => 0.0,
            });
            let prescribed = std::array::from_fn(|axis| match axis < axes {
                true => self.prescribed_velocity(context, axes * node + axis),
                false => None,
            });
            let velocity = next_velocity(axes, self.masses[node], &damper, mean_step, &behind, &force, prescribed);
            (0..axes).for_each(|axis| next[axes * node + axis] = velocity[axis]);
        }
        self.apply_constraints(context, &mut next, Some(mean_step));
        for node in 0..self.masses.len() {
            let damper = self.dashpots.of_node(node, self.masses[node], rate);
            let (behind, ahead) = (triple(&self.ahead, axes, node), triple(&next, axes, node));
            let (velocity, acceleration) = (0.5 * (ahead + behind), (ahead - behind) / mean_step);
            let dashpot = damper * velocity;
            for axis in 0..axes {
                let dof = axes * node + axis;
                self.ahead[dof] = ahead[axis];
                self.velocity[dof] = velocity[axis];
                self.acceleration[dof] = acceleration[axis];
                self.forces.dashpots[dof] = dashpot[axis];
            }
        }
        self.find_reactions(context, axes);
        let set_off = self.set_off(context, &before, mean_step);
        self.monitor.step(path, &before, &self.forces, self.kinetic_energy(axes), set_off);
        // Dashpots store nothing: what they have taken since the stage began.
        if let HourglassControl::Viscous { .. } = context.problem.hourglass {
            self.hourglass_energy = self.monitor.balance.hourglass;
        }
        Ok(())
    }

    /// All forces of the instant but those that depend on its own velocity.
    fn collect_forces(&mut self, context: &StageContext<'_>) {
        let elements = self.laws(context).forces(Motion {
            geometry: context.body.settled_geometry(),
            displacements: &context.body.displacements,
            velocity: &self.ahead,
        });
        let positions = context.body.positions(&context.body.zero());
        let mut loads = context.loads.force(&positions, self.moment(context, self.time()));
        add(&mut loads, &self.held);
        if let HourglassControl::Stiffness { .. } = context.problem.hourglass {
            self.hourglass_energy = elements.hourglass_energy;
        }
        self.forces = Forces {
            internal: elements.internal,
            hourglass: elements.hourglass,
            viscous: elements.viscous,
            loads,
            dashpots: context.body.zero(),
            reactions: context.body.zero(),
        };
    }

    /// Force that accelerates, without dampers at nodes and supports, N.
    fn driving_force(&self, dof: usize) -> f64 {
        let forces = &self.forces;
        forces.loads[dof] - forces.internal[dof] - forces.hourglass[dof] - forces.viscous[dof]
    }

    /// Moves velocities of the coming step onto the constraints. After a change over `mean_step` (s) nodes resist by their masses and dampers;
    /// at the start, `None`, by their masses alone.
    fn apply_constraints(&mut self, context: &StageContext<'_>, velocity: &mut [f64], mean_step: Option<f64>) {
        if self.velocity_constraints.is_empty() {
            return;
        }
        let next = self.moment(context, self.time() + self.step);
        let given = given_velocities(context.constraints, &context.body.displacements, next, self.step);
        let (axes, rate) = (context.problem.mesh.dimension.count(), context.settings.damping.mass);
        let (masses, dashpots) = (&self.masses, &self.dashpots);
        let weight = |dof: usize| {
            let (node, axis) = (dof / axes, dof % axes);
            match mean_step {
                None => masses[node],
                Some(step) => masses[node] / step + 0.5 * dashpots.of_node(node, masses[node], rate)[(axis, axis)],
            }
        };
        self.velocity_constraints.keep(velocity, weight, &given);
    }

    fn find_reactions(&mut self, context: &StageContext<'_>, axes: usize) {
        for dof in 0..self.acceleration.len() {
            if !context.constraints.is_unloaded(dof) {
                self.forces.reactions[dof] = self.masses[dof / axes] * self.acceleration[dof]
                    + self.forces.dashpots[dof]
                    - self.driving_force(dof);
            }
        }
    }

    /// Velocity of a prescribed degree of freedom over the coming step: that which meets its displacement exactly.
    fn prescribed_velocity(&self, context: &StageContext<'_>, dof: usize) -> Option<f64> {
        let next = self.moment(context, self.time() + self.step);
        let target = context.constraints.prescribed(dof, next)?;
        Some((target - context.body.displacements[dof]) / self.step)
    }

    /// Energy of the velocities at the instant that changes of loads since the one `before`, and the accelerations of supports, have given
    /// over half a step, J. The response of the body is no part of it.
    fn set_off(&self, context: &StageContext<'_>, before: &Forces, step: f64) -> f64 {
        let axes = context.problem.mesh.dimension.count();
        let of = |dof: usize| {
            let mass = self.masses[dof / axes];
            let force = match context.constraints.is_prescribed(dof) {
                true => mass * self.acceleration[dof],
                false => self.forces.loads[dof] - before.loads[dof],
            };
            (force * step).powi(2) / (8.0 * mass)
        };
        (0..self.velocity.len()).map(of).sum()
    }

    fn kinetic_energy(&self, axes: usize) -> f64 {
        self.velocity
            .iter()
            .enumerate()
            .map(|(dof, velocity)| 0.5 * self.masses[dof / axes] * velocity * velocity)
            .sum()
    }
}

fn add(sum: &mut [f64], more: &[f64]) {
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
}

fn triple(values: &[f64], axes: usize, node: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| if axis < axes { values[axes * node + axis] } else { 0.0 })
}
