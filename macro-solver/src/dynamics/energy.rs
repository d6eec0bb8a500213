//! The ledger of energies of a dynamic run, and the monitor that stops an unstable one.
//!
//! Works are added up by the trapezium rule with the displacements of the steps, kinetic energy is that of the mean of the two
//! half-step velocities (Belytschko, Liu and Moran 2000, section 6.2.3). The central difference method balances these to
//! `sum m a^2 dt^2 / 8`, which is small as long as motions are resolved in time. A large residual alone may be the front of a sudden
//! load or a motion that the step resolves coarsely: a stable mode near the limit has as much of it as an unstable one. What
//! only an unstable mode does is to grow beyond everything that was supplied.

use serde::{Deserialize, Serialize};

/// Energies since the start of the run, J, in the plane per metre of thickness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnergyBalance {
    /// Kinetic energy now.
    pub kinetic: f64,
    /// Kinetic energy at the start.
    pub initial_kinetic: f64,
    /// Work of the stresses on the body.
    pub internal: f64,
    /// Work against hourglass control.
    pub hourglass: f64,
    /// Work against dampers: Rayleigh, viscosity, absorbing boundaries.
    pub damping: f64,
    /// Work of loads and supports.
    pub external: f64,
    /// Largest sum of the absolute entries so far.
    pub largest: f64,
    /// Largest absolute residual so far.
    pub largest_residual: f64,
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

    fn close(&mut self) {
        // The largest single entry, not a sum: every joule appears on both sides of the balance.
        let entries = [self.kinetic, self.internal, self.hourglass, self.damping, self.external];
        self.largest = entries.iter().fold(self.largest, |largest, entry| largest.max(entry.abs()));
        self.largest_residual = self.largest_residual.max(self.residual().abs());
    }
}

/// Forces of one instant, N, by degree of freedom.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Forces {
    /// Of the stresses, without viscous ones.
    pub(super) internal: Vec<f64>,
    /// Of the hourglass control.
    pub(super) hourglass: Vec<f64>,
    /// Of viscous stresses, with the velocity of the half step before.
    pub(super) viscous: Vec<f64>,
    /// Of the loads.
    pub(super) loads: Vec<f64>,
    /// Of dampers at nodes, with the velocity of the instant.
    pub(super) dashpots: Vec<f64>,
    /// Of the supports; zero where nothing is prescribed.
    pub(super) reactions: Vec<f64>,
}

impl Forces {
    /// All of them.
    pub(super) fn all(&self) -> [&Vec<f64>; 6] {
        [&self.internal, &self.hourglass, &self.viscous, &self.loads, &self.dashpots, &self.reactions]
    }
}

/// Adds up works and watches the balance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Monitor {
    /// The ledger.
    pub(super) balance: EnergyBalance,
    tolerance: f64,
    /// Largest energy that loads, supports and stresses have supplied so far, J.
    supplied: f64,
}

/// Largest energy over what was supplied at which a run is stopped. A stable mode with `x = (w dt / 2)^2` reaches `1 / (1 - x)`:
/// 5 at 0.9 of the critical step, 500 at 0.999 of it.
const AMPLIFICATION: f64 = 1e3;

impl Monitor {
    /// An empty ledger.
    pub(super) fn new(tolerance: f64) -> Self {
        Self { balance: EnergyBalance::default(), tolerance, supplied: 0.0 }
    }

    /// The kinetic energy at the start, J.
    pub(super) fn start(&mut self, kinetic: f64) {
        self.balance.kinetic = kinetic;
        self.balance.initial_kinetic = kinetic;
        self.balance.close();
    }

    /// Closes a step with the displacements `path` (m) between two instants and the kinetic energy (J) at the second.
    pub(super) fn step(&mut self, path: &[f64], before: &Forces, after: &Forces, kinetic: f64) {
        let work = |from: &[f64], to: &[f64]| -> f64 {
            path.iter().zip(from).zip(to).map(|((path, from), to)| 0.5 * path * (from + to)).sum()
        };
        let balance = &mut self.balance;
        balance.internal += work(&before.internal, &after.internal);
        balance.hourglass += work(&before.hourglass, &after.hourglass);
        balance.damping += work(&before.viscous, &after.viscous) + work(&before.dashpots, &after.dashpots);
        balance.external += work(&before.loads, &after.loads) + work(&before.reactions, &after.reactions);
        balance.kinetic = kinetic;
        balance.close();
        let supplied = balance.initial_kinetic + balance.external.abs() + (-balance.internal).max(0.0);
        self.supplied = self.supplied.max(supplied);
    }

    /// Whether energy comes from nowhere: the residual is beyond the tolerance and the body holds far more than it was given, or
    /// something is no number.
    pub(super) fn is_unstable(&self) -> bool {
        let ratio = self.balance.relative_residual();
        !ratio.is_finite() || (ratio > self.tolerance && self.balance.largest > AMPLIFICATION * self.supplied)
    }
}
