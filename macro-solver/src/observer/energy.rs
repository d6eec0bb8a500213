//! The ledger of energies of a dynamic stage.

use serde::{Deserialize, Serialize};

/// Energies since the start of the stage, J, in the plane per metre of thickness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnergyBalance {
    /// Kinetic energy now.
    pub kinetic: f64,
    /// Kinetic energy at the start of the stage.
    pub initial_kinetic: f64,
    /// Work of the stresses on the body.
    pub internal: f64,
    /// Work against hourglass control.
    pub hourglass: f64,
    /// Work against dampers: Rayleigh, viscosity, absorbing boundaries.
    pub damping: f64,
    /// Work of loads and supports.
    pub external: f64,
    /// Largest absolute entry so far.
    pub largest: f64,
    /// Largest absolute residual so far.
    pub largest_residual: f64,
    /// Instants so far at which the residual was beyond the tolerance of the run, without what the start has left in it for good:
    /// `-sum m a^2 dt^2 / 8` with the first accelerations.
    pub excess_steps: u64,
    /// Most of them in a row.
    pub longest_excess: u64,
}

impl EnergyBalance {
    /// Kinetic energy, internal, hourglass and damping work minus external work and initial kinetic energy; zero in a perfect world.
    pub fn residual(&self) -> f64 {
        self.kinetic - self.initial_kinetic + self.internal + self.hourglass + self.damping - self.external
    }

    /// Residual over the largest energy so far; 0 while there is none.
    pub fn relative_residual(&self) -> f64 {
        if self.largest > 0.0 { self.residual().abs() / self.largest } else { 0.0 }
    }

    /// Largest residual of the run over its largest energy.
    pub fn largest_relative_residual(&self) -> f64 {
        if self.largest > 0.0 { self.largest_residual / self.largest } else { 0.0 }
    }

    /// Takes the entries of the latest instant into the largest ones.
    pub(crate) fn close(&mut self) {
        // The largest single entry, not a sum: every joule appears on both sides of the balance.
        let entries = [self.kinetic, self.internal, self.hourglass, self.damping, self.external];
        self.largest = entries.iter().fold(self.largest, |largest, entry| largest.max(entry.abs()));
        self.largest_residual = self.largest_residual.max(self.residual().abs());
    }
}
