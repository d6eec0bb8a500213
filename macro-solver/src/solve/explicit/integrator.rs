//! The central difference method over one stage.
//!
//! At an instant `n` all forces are known and the velocity of the half step before; the equations of motion give the velocity
//! of the half step behind, and with it the displacements of the instant `n + 1`. Dampers inside elements see the half
//! step before, dampers at nodes the mean of both. A report about an instant is complete: its velocity is that mean.

use super::constrained_velocities::{VelocityConstraints, given_velocities};
use super::dashpots::{Dashpots, next_velocity};
use super::energy::{BalanceViolation, Forces, Monitor};
use super::masses::{element_masses, nodal_masses, scale_factors};
use crate::element::PointGeometry;
use crate::element::hourglass::HourglassControl;
use crate::material::PointMaterial;
use crate::model::assembly::forces::{ElementLaws, Motion};
use crate::model::assembly::isotropic::Isotropic;
use crate::model::assembly::viscosity::Viscosity;
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use crate::model::failure::{Failure, failure};
use crate::model::loads::Loads;
use crate::model::points::Points;
use crate::model::stable_step::{ElementLimits, limits};
use crate::observer::EnergyBalance;
use crate::observer::{Outcome, Statistics};
use crate::problem::dynamics::{DynamicSettings, Reporting, StepRule};
use crate::problem::{Moment, Problem, ProblemError, Stage};
use crate::solve::driver::timed;
use nalgebra::{Matrix3, Vector3};
use protocol::TangentKind;

/// Asked for the stable step: every contact sticks, which is as stiff as the network gets.
const STIFFEST: TangentKind = TangentKind::TrussLike;

/// The parts of the solver that a dynamic stage moves.
pub(crate) struct Specimen<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) stage: &'a Stage,
    pub(crate) settings: &'a DynamicSettings,
    pub(crate) body: &'a mut Body,
    pub(crate) points: &'a mut Points,
    pub(crate) constraints: &'a Constraints,
    pub(crate) loads: &'a Loads,
    pub(crate) statistics: &'a mut Statistics,
}

/// A dynamic stage under way.
#[derive(Clone, Debug)]
pub(crate) struct Integrator {
    pub(super) viscosity: Viscosity,
    pub(super) stiffness: Vec<Isotropic>,
    /// By element, what the step is bounded by.
    pub(super) scale_factors: Vec<f64>,
    /// By node, kg.
    pub(super) masses: Vec<f64>,
    /// Added by mass scaling, kg.
    pub(super) added_mass: f64,
    pub(super) dashpots: Dashpots,
    pub(super) velocity_constraints: VelocityConstraints,
    /// Time step, s, the instant from which it holds, s, and the number of that instant.
    pub(super) step: f64,
    pub(super) origin: (f64, u64),
    /// Instants passed, and those of the whole stage.
    pub(super) done: u64,
    pub(super) total: u64,
    /// Of the half step behind the instant, m/s.
    pub(super) ahead: Vec<f64>,
    /// Of the instant, m/s and m/s2.
    pub(super) velocity: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
    pub(super) forces: Forces,
    pub(super) hourglass_energy: f64,
    pub(super) monitor: Monitor,
    /// Displacement gradients of the latest step.
    pub(super) gradients: Vec<Matrix3<f64>>,
}

impl Integrator {
    /// Begins a stage at the committed state; `velocity` is that of the stage before, m/s. Every point is asked once for its
    /// elastic tangent.
    ///
    /// # Errors
    /// The end of the run: a problem that does not fit, or points that do not answer.
    pub(crate) fn start(
        specimen: &mut Specimen<'_>,
        velocity: Option<Vec<f64>>,
        material: &mut dyn PointMaterial,
    ) -> Result<Self, Outcome> {
        let still = vec![Matrix3::zeros(); specimen.points.all().len()];
        specimen.points.start_step();
        specimen.points.fix_ramps(&still);
        specimen.ask(&still, STIFFEST, material)?;
        material.rollback();
        specimen.points.forget_trials();
        let dimension = specimen.problem.mesh.dimension;
        let settings = specimen.settings;
        let stiffness: Vec<Isotropic> =
            specimen.points.all().iter().map(|point| Isotropic::of(dimension, &point.response.moduli)).collect();
        let viscosity = Viscosity::new(settings.damping, settings.viscosity, settings.density);
        let dashpots = Dashpots::of_stage(specimen, &stiffness);
        let velocity_constraints = specimen.velocity_constraints(&dashpots).map_err(Outcome::Refused)?;
        let mut integrator = Self {
            viscosity,
            scale_factors: Vec::new(),
            masses: Vec::new(),
            added_mass: 0.0,
            dashpots,
            velocity_constraints,
            stiffness,
            step: 0.0,
            origin: (0.0, 0),
            done: 0,
            total: 0,
            ahead: specimen.body.zero(),
            velocity: velocity.unwrap_or_else(|| specimen.body.zero()),
            acceleration: specimen.body.zero(),
            forces: Forces::default(),
            hourglass_energy: 0.0,
            monitor: Monitor::new(settings.energy_tolerance, settings.longest_excess),
            gradients: still,
        };
        integrator.choose_masses_and_step(specimen)?;
        integrator.first_instant(specimen);
        Ok(integrator)
    }

    fn choose_masses_and_step(&mut self, specimen: &Specimen<'_>) -> Result<(), Outcome> {
        let masses = element_masses(specimen.body, specimen.settings).map_err(Outcome::Refused)?;
        let limits = limits(&self.laws(specimen), specimen.constraints, &masses);
        self.scale_factors = scale_factors(specimen.settings, &limits);
        (self.masses, self.added_mass) = nodal_masses(specimen.body, &masses, &self.scale_factors);
        self.choose_step(specimen, &limits);
        Ok(())
    }

    /// Divides what is left of the stage into equal steps.
    fn choose_step(&mut self, specimen: &Specimen<'_>, limits: &[ElementLimits]) {
        let critical = limits
            .iter()
            .zip(&self.scale_factors)
            .map(|(limits, factor)| limits.scaled(*factor).step())
            .fold(f64::INFINITY, f64::min);
        let wanted = match specimen.settings.step {
            StepRule::Stable { safety } => safety * critical,
            StepRule::Fixed { step } => step,
        };
        let now = self.time();
        let left = specimen.stage.duration - now;
        // A sliver of a step at the end would only be rounding.
        let steps = (left / wanted - 1e-9).ceil().max(1.0);
        self.origin = (now, self.done);
        self.step = left / steps;
        self.total = self.done + steps as u64;
    }

    /// Forces, velocities and the ledger at the start.
    fn first_instant(&mut self, specimen: &Specimen<'_>) {
        for given in &specimen.settings.initial_velocities {
            let axes = specimen.problem.mesh.dimension.count();
            for &node in specimen.problem.nodes(&given.nodes).expect("checked before the run") {
                self.velocity[axes * node..axes * (node + 1)].copy_from_slice(&given.value[..axes]);
            }
        }
        for dof in 0..self.velocity.len() {
            // A support that starts to move has its velocity from the start: only free nodes are accelerated.
            if let Some(velocity) = self.prescribed_velocity(specimen, dof) {
                self.velocity[dof] = velocity;
            }
        }
        let mut velocity = std::mem::take(&mut self.velocity);
        self.apply_constraints(specimen, &mut velocity, None);
        self.velocity = velocity;
        self.ahead.clone_from(&self.velocity);
        self.collect_forces(specimen);
        let rate = specimen.settings.damping.mass;
        let axes = specimen.problem.mesh.dimension.count();
        for node in 0..self.masses.len() {
            let damper = self.dashpots.of_node(node, self.masses[node], rate);
            let velocity = triple(&self.velocity, axes, node);
            let dashpot = damper * velocity;
            for axis in 0..axes {
                let dof = axes * node + axis;
                self.forces.dashpots[dof] = dashpot[axis];
                if !specimen.constraints.is_prescribed(dof) {
                    self.acceleration[dof] = (self.driving_force(dof) - dashpot[axis]) / self.masses[node];
                    self.ahead[dof] = self.velocity[dof] + 0.5 * self.step * self.acceleration[dof];
                }
            }
        }
        let mut ahead = std::mem::take(&mut self.ahead);
        self.apply_constraints(specimen, &mut ahead, None);
        for dof in self.velocity_constraints.tied() {
            self.acceleration[dof] = (ahead[dof] - self.velocity[dof]) / (0.5 * self.step);
        }
        self.ahead = ahead;
        self.find_reactions(specimen, axes);
        let per_freedom = self.acceleration.iter().enumerate();
        let left: f64 =
            per_freedom.map(|(dof, rate)| self.masses[dof / axes] * (rate * self.step).powi(2) / 8.0).sum();
        self.monitor.start(self.kinetic_energy(axes), left);
    }

    /// One time step: displacements, answers, forces, velocities, energies.
    ///
    /// # Errors
    /// The end of the run; [`Outcome::Unstable`] names the step and the remedy.
    pub(crate) fn advance(
        &mut self,
        specimen: &mut Specimen<'_>,
        material: &mut dyn PointMaterial,
    ) -> Result<(), Outcome> {
        let path: Vec<f64> = self.ahead.iter().map(|velocity| velocity * self.step).collect();
        self.gradients = specimen.body.gradients(&path);
        let is_sound = |gradient: &Matrix3<f64>| (Matrix3::identity() + gradient).determinant() > 0.0;
        if let Some(point) = self.gradients.iter().position(|gradient| !is_sound(gradient)) {
            return Err(self.unstable(format!("Gauss point {point} is turned inside out")));
        }
        let every = specimen.settings.tangent_every;
        let renews = every > 0 && (self.done + 1).is_multiple_of(every);
        specimen.points.fix_ramps(&self.gradients);
        let tangent = if renews { STIFFEST } else { TangentKind::None };
        specimen.ask(&self.gradients, tangent, material).map_err(|outcome| self.at_step(outcome))?;
        let lost = |error| match failure(error) {
            Failure::Run(outcome) => outcome,
            Failure::Attempt(reason) => Outcome::WorkersLost { reason },
        };
        material.commit().map_err(lost)?;
        specimen.body.commit(&path);
        specimen.points.commit(&self.gradients);
        self.done += 1;
        specimen.statistics.steps += 1;
        let is_inverted = |geometry: &PointGeometry| geometry.volume.is_nan() || geometry.volume <= 0.0;
        if let Some(point) = specimen.body.settled_geometry().iter().position(is_inverted) {
            return Err(self.unstable(format!("the element of Gauss point {point} is turned inside out")));
        }
        let mut nanoseconds = 0;
        timed(&mut nanoseconds, || self.next_instant(specimen, &path, renews))?;
        specimen.statistics.assembly_nanoseconds += nanoseconds;
        self.check_energy()
    }

    /// Ends a run whose energies do not add up.
    fn check_energy(&self) -> Result<(), Outcome> {
        let balance = self.monitor.balance;
        let (largest, residual) = (balance.largest, balance.relative_residual());
        match self.monitor.excess() {
            None => Ok(()),
            Some(BalanceViolation::Unstable) => Err(self.unstable(format!(
                "the body holds {largest:.1e} J, far more than it was given, and the energy balance is off by {residual:.1e} \
                 of that"
            ))),
            Some(BalanceViolation::Unresolved) => Err(self.unstable(format!(
                "the energy balance has been off by more than it may for {} steps, now by {residual:.1e} of the largest \
                 energy: the motion is too fast for the time step, though it does not grow",
                balance.longest_excess
            ))),
        }
    }

    fn next_instant(&mut self, specimen: &Specimen<'_>, path: &[f64], renews: bool) -> Result<(), Outcome> {
        let before = self.forces.clone();
        let last_step = self.step;
        self.collect_forces(specimen);
        if renews && self.done < self.total && matches!(specimen.settings.step, StepRule::Stable { .. }) {
            let masses = element_masses(specimen.body, specimen.settings).map_err(Outcome::Refused)?;
            let limits = limits(&self.laws(specimen), specimen.constraints, &masses);
            self.choose_step(specimen, &limits);
        }
        let mean_step = 0.5 * (last_step + self.step);
        let axes = specimen.problem.mesh.dimension.count();
        let rate = specimen.settings.damping.mass;
        let mut next = specimen.body.zero();
        for node in 0..self.masses.len() {
            let damper = self.dashpots.of_node(node, self.masses[node], rate);
            let behind = triple(&self.ahead, axes, node);
            let force = Vector3::from_fn(|axis, _| match axis < axes {
                true => self.driving_force(axes * node + axis),
                false => 0.0,
            });
            let prescribed = std::array::from_fn(|axis| match axis < axes {
                true => self.prescribed_velocity(specimen, axes * node + axis),
                false => None,
            });
            let velocity = next_velocity(axes, self.masses[node], &damper, mean_step, &behind, &force, prescribed);
            (0..axes).for_each(|axis| next[axes * node + axis] = velocity[axis]);
        }
        self.apply_constraints(specimen, &mut next, Some(mean_step));
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
        self.find_reactions(specimen, axes);
        self.monitor.step(path, &before, &self.forces, self.kinetic_energy(axes));
        Ok(())
    }

    /// All forces of the instant but those that depend on its own velocity.
    fn collect_forces(&mut self, specimen: &Specimen<'_>) {
        let elements = self.laws(specimen).forces(Motion {
            geometry: specimen.body.settled_geometry(),
            displacements: &specimen.body.displacements,
            velocity: &self.ahead,
        });
        let positions = specimen.body.positions(&specimen.body.zero());
        let loads = specimen.loads.force(&positions, self.moment(specimen, self.time()));
        self.hourglass_energy = match specimen.problem.hourglass {
            HourglassControl::Stiffness { .. } => elements.hourglass_energy,
            HourglassControl::Viscous { .. } => 0.0,
        };
        self.forces = Forces {
            internal: elements.internal,
            hourglass: elements.hourglass,
            viscous: elements.viscous,
            loads,
            dashpots: specimen.body.zero(),
            reactions: specimen.body.zero(),
        };
    }

    fn laws<'s>(&'s self, specimen: &'s Specimen<'_>) -> ElementLaws<'s> {
        ElementLaws {
            body: specimen.body,
            points: specimen.points,
            stiffness: &self.stiffness,
            viscosity: self.viscosity,
            densities: &specimen.settings.element_densities,
            hourglass: specimen.problem.hourglass,
        }
    }

    /// Force that accelerates, without dampers at nodes and supports, N.
    fn driving_force(&self, dof: usize) -> f64 {
        let forces = &self.forces;
        forces.loads[dof] - forces.internal[dof] - forces.hourglass[dof] - forces.viscous[dof]
    }

    /// Moves velocities of the coming step onto the velocity_constraints. After a change over `mean_step` (s) nodes resist by their masses and dampers;
    /// at the start, `None`, by their masses alone.
    fn apply_constraints(&mut self, specimen: &Specimen<'_>, velocity: &mut [f64], mean_step: Option<f64>) {
        if self.velocity_constraints.is_empty() {
            return;
        }
        let next = self.moment(specimen, self.time() + self.step);
        let given = given_velocities(specimen.constraints, &specimen.body.displacements, next, self.step);
        let (axes, rate) = (specimen.problem.mesh.dimension.count(), specimen.settings.damping.mass);
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

    fn find_reactions(&mut self, specimen: &Specimen<'_>, axes: usize) {
        for dof in 0..self.acceleration.len() {
            if !specimen.constraints.is_unloaded(dof) {
                self.forces.reactions[dof] = self.masses[dof / axes] * self.acceleration[dof]
                    + self.forces.dashpots[dof]
                    - self.driving_force(dof);
            }
        }
    }

    /// Velocity of a prescribed degree of freedom over the coming step: that which meets its displacement exactly.
    fn prescribed_velocity(&self, specimen: &Specimen<'_>, dof: usize) -> Option<f64> {
        let next = self.moment(specimen, self.time() + self.step);
        let target = specimen.constraints.prescribed(dof, next)?;
        Some((target - specimen.body.displacements[dof]) / self.step)
    }

    fn kinetic_energy(&self, axes: usize) -> f64 {
        self.velocity
            .iter()
            .enumerate()
            .map(|(dof, velocity)| 0.5 * self.masses[dof / axes] * velocity * velocity)
            .sum()
    }

    fn moment(&self, specimen: &Specimen<'_>, time: f64) -> Moment {
        Moment { load: time / specimen.stage.duration, time }
    }

    fn unstable(&self, reason: String) -> Outcome {
        Outcome::Unstable { step: self.done, time: self.time(), time_step: self.step, reason }
    }

    /// What a failed evaluation means: smaller steps have been tried by the points that refused.
    fn at_step(&self, outcome: Outcome) -> Outcome {
        match outcome {
            Outcome::DidNotConverge { reason } => self.unstable(reason),
            other => other,
        }
    }

    /// Time since the stage began, s.
    pub(crate) fn time(&self) -> f64 {
        self.origin.0 + self.step * (self.done - self.origin.1) as f64
    }

    /// Share of the stage that has passed; exactly 1 at its end.
    pub(crate) fn load(&self, stage: &Stage) -> f64 {
        if self.is_done() { 1.0 } else { self.time() / stage.duration }
    }

    /// Whether the stage is over.
    pub(crate) fn is_done(&self) -> bool {
        self.done >= self.total
    }

    /// Whether the instant is to be reported.
    pub(crate) fn is_reported(&self, reporting: Reporting) -> bool {
        let passed = |time: f64, interval: f64| (time / interval + 1e-9).floor();
        let is_due = match reporting {
            Reporting::Steps(steps) => self.done.is_multiple_of(steps),
            Reporting::Interval(interval) => {
                passed(self.time(), interval) > passed(self.time() - self.step, interval)
            }
        };
        is_due || self.is_done()
    }

    /// The ledger.
    pub(crate) fn energy(&self) -> EnergyBalance {
        self.monitor.balance
    }

    /// Velocities of the instant, m/s.
    pub(crate) fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Accelerations of the instant, m/s2.
    pub(crate) fn acceleration(&self) -> &[f64] {
        &self.acceleration
    }

    /// Forces of the supports, N.
    pub(crate) fn reactions(&self) -> &[f64] {
        &self.forces.reactions
    }

    /// Forces of the loads, N.
    pub(crate) fn loads(&self) -> &[f64] {
        &self.forces.loads
    }

    /// Energy of hourglass springs, J.
    pub(crate) fn hourglass_energy(&self) -> f64 {
        self.hourglass_energy
    }

    /// Displacement gradients of the latest step.
    pub(crate) fn gradients(&self) -> &[Matrix3<f64>] {
        &self.gradients
    }

    /// Instants passed.
    pub(crate) fn done(&self) -> u64 {
        self.done
    }

    /// Time step, s.
    pub(crate) fn step(&self) -> f64 {
        self.step
    }

    /// Added by mass scaling, kg, and the mass of the body with it.
    pub(crate) fn added_mass(&self) -> (f64, f64) {
        (self.added_mass, self.masses.iter().sum())
    }
}

impl Specimen<'_> {
    /// The velocity_constraints of the stage between nodes with these dampers.
    pub(super) fn velocity_constraints(&self, dashpots: &Dashpots) -> Result<VelocityConstraints, ProblemError> {
        let axes = self.problem.mesh.dimension.count();
        VelocityConstraints::of_stage(self.constraints, |dof| dashpots.is_oblique(dof / axes, dof % axes))
    }

    /// Asks the points for their answers to the gradients of a step.
    fn ask(
        &mut self,
        gradients: &[Matrix3<f64>],
        tangent: TangentKind,
        material: &mut dyn PointMaterial,
    ) -> Result<(), Outcome> {
        let mut waiting = 0;
        let answered =
            timed(&mut waiting, || self.points.evaluate_in_parts(gradients, tangent, material, self.statistics));
        self.statistics.material_nanoseconds += waiting;
        match answered {
            Ok(_) => Ok(()),
            Err(Failure::Attempt(reason)) => Err(Outcome::DidNotConverge { reason }),
            Err(Failure::Run(outcome)) => Err(outcome),
        }
    }
}

fn triple(values: &[f64], axes: usize, node: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| if axis < axes { values[axes * node + axis] } else { 0.0 })
}
