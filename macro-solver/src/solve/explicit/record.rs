//! What of a dynamic stage goes into a checkpoint: everything that a later step can see.

use super::dashpots::Dashpots;
use super::energy::{Forces, Monitor};
use super::integrator::Integrator;
use super::stage_context::StageContext;
use crate::checkpoint::CheckpointError;
use crate::model::assembly::isotropic::Isotropic;
use crate::model::assembly::viscosity::Viscosity;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// A dynamic stage after a reported instant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct IntegratorRecord {
    stiffness: Vec<Isotropic>,
    scale_factors: Vec<f64>,
    masses: Vec<f64>,
    added_mass: f64,
    held: Vec<f64>,
    step: f64,
    stable_step: f64,
    origin: (f64, u64),
    done: u64,
    total: u64,
    ahead: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    forces: Forces,
    hourglass_energy: f64,
    monitor: Monitor,
}

impl Integrator {
    /// What a checkpoint keeps.
    pub(crate) fn record(&self) -> IntegratorRecord {
        IntegratorRecord {
            stiffness: self.stiffness.clone(),
            scale_factors: self.scale_factors.clone(),
            masses: self.masses.clone(),
            added_mass: self.added_mass,
            held: self.held.clone(),
            step: self.step,
            stable_step: self.stable_step,
            origin: self.origin,
            done: self.done,
            total: self.total,
            ahead: self.ahead.clone(),
            velocity: self.velocity.clone(),
            acceleration: self.acceleration.clone(),
            forces: self.forces.clone(),
            hourglass_energy: self.hourglass_energy,
            monitor: self.monitor.clone(),
        }
    }

    /// Goes on from a record; body, points and loads are those of the checkpoint already.
    ///
    /// # Errors
    /// The record is that of another mesh.
    pub(crate) fn restore(
        section: &str,
        record: IntegratorRecord,
        context: &StageContext<'_>,
    ) -> Result<Self, CheckpointError> {
        let (points, nodes) = (context.points.all().len(), context.problem.mesh.nodes.len());
        let freedoms = context.body.displacements.len();
        let by_freedom = [&record.ahead, &record.velocity, &record.acceleration, &record.held];
        let fits = by_freedom.into_iter().chain(record.forces.all()).all(|values| values.len() == freedoms)
            && record.stiffness.len() == points
            && record.masses.len() == nodes
            && record.scale_factors.len() == context.problem.mesh.elements.len();
        if !fits {
            return Err(CheckpointError::unfit(section, "the dynamic stage is that of another mesh"));
        }
        let settings = context.settings;
        let dashpots = Dashpots::of_stage(context, &record.stiffness, &record.scale_factors);
        let velocity_constraints =
            context.velocity_constraints(&dashpots).map_err(|error| CheckpointError::unfit(section, error))?;
        Ok(Self {
            viscosity: Viscosity::new(settings.damping, settings.viscosity, settings.density),
            dashpots,
            velocity_constraints,
            stiffness: record.stiffness,
            scale_factors: record.scale_factors,
            masses: record.masses,
            added_mass: record.added_mass,
            held: record.held,
            step: record.step,
            stable_step: record.stable_step,
            origin: record.origin,
            // The next step sets it.
            time_before: 0.0,
            done: record.done,
            total: record.total,
            ahead: record.ahead,
            velocity: record.velocity,
            acceleration: record.acceleration,
            forces: record.forces,
            hourglass_energy: record.hourglass_energy,
            monitor: record.monitor,
            gradients: vec![Matrix3::zeros(); points],
            gradients_since_report: vec![Matrix3::zeros(); points],
        })
    }
}
