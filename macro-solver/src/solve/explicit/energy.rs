//! The ledger of energies of a dynamic run, and the monitor that stops an unstable one.
//!
//! Works are added up by the trapezium rule with the displacements of the steps, kinetic energy is that of the mean of the two
//! half-step velocities (Belytschko, Liu and Moran 2000, section 6.2.3). The central difference method balances these to
//! `sum m a^2 dt^2 / 8`, which is small as long as motions are resolved in time. A large residual alone may be the front of a sudden
//! load or a motion that the step resolves coarsely: a stable mode near the limit has as much of it as an unstable one. What
//! only an unstable mode does is to grow beyond everything that was supplied. A residual that stays large, instant after instant,
//! says that the motion is not resolved in time: its result is not one to go on with either.

use crate::observer::EnergyBalance;
use serde::{Deserialize, Serialize};

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
    /// Instants in a row beyond the tolerance at which the run is stopped; 0: never.
    max_unresolved: u64,
    /// Instants in a row beyond the tolerance up to now.
    in_a_row: u64,
    /// What the accelerations of the start take from the balance for good, J.
    left_by_start: f64,
    /// What jumps of loads and of the velocities of supports have set off before anything had moved by them, J.
    set_off: f64,
    /// Largest energy that loads, supports and stresses have supplied so far, J.
    supplied: f64,
}

/// Why the monitor stops a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BalanceViolation {
    /// The body holds far more energy than it was given, or something is no number.
    Unstable,
    /// The residual has been beyond the tolerance for too many instants in a row.
    Unresolved,
}

/// Largest energy over what was supplied at which a run is stopped. A stable mode with `x = (w dt / 2)^2` reaches `1 / (1 - x)`:
/// 5 at 0.9 of the critical step, 500 at 0.999 of it.
const AMPLIFICATION: f64 = 1e3;

/// Instants in a row beyond the tolerance at which a run with a time step above the stable one is stopped.
const MOST_ABOVE_STABLE_STEP: u64 = 4;

/// Residual over the largest energy at which such a run is stopped at once.
const GROSS: f64 = 0.1;

impl Monitor {
    /// An empty ledger.
    pub(super) fn new(tolerance: f64, max_unresolved: u64) -> Self {
        Self {
            balance: EnergyBalance::default(),
            tolerance,
            max_unresolved,
            in_a_row: 0,
            left_by_start: 0.0,
            set_off: 0.0,
            supplied: 0.0,
        }
    }

    /// The kinetic energy at the start, J, and `sum m a^2 dt^2 / 8`, by which its accelerations set off the balance for good.
    pub(super) fn start(&mut self, kinetic: f64, left_by_start: f64) {
        self.left_by_start = left_by_start;
        self.balance.kinetic = kinetic;
        self.balance.initial_kinetic = kinetic;
        self.balance.close();
    }

    /// Closes a step with the displacements `path` (m) between two instants and the kinetic energy (J) at the second. `set_off` is the energy (J)
    /// of the velocities that loads and supports have given by their change over the step: it is there before they have done work.
    pub(super) fn step(&mut self, path: &[f64], before: &Forces, after: &Forces, kinetic: f64, set_off: f64) {
        let work = |from: &[f64], to: &[f64]| -> f64 {
            path.iter().zip(from).zip(to).map(|((path, from), to)| 0.5 * path * (from + to)).sum()
        };
        let was_at_rest = self.balance.largest == 0.0;
        let balance = &mut self.balance;
        balance.internal += work(&before.internal, &after.internal);
        balance.hourglass += work(&before.hourglass, &after.hourglass);
        balance.damping += work(&before.viscous, &after.viscous) + work(&before.dashpots, &after.dashpots);
        balance.external += work(&before.loads, &after.loads) + work(&before.reactions, &after.reactions);
        balance.kinetic = kinetic;
        balance.close();
        self.set_off += set_off;
        let supplied = balance.initial_kinetic + balance.external.abs() + (-balance.internal).max(0.0) + self.set_off;
        self.supplied = self.supplied.max(supplied);
        if was_at_rest {
            // So do links whose jump begins.
            self.supplied = self.supplied.max(kinetic);
        }
        let unresolved = (balance.residual() + self.left_by_start).abs() > self.tolerance * balance.largest;
        self.in_a_row = if unresolved { self.in_a_row + 1 } else { 0 };
        balance.excess_steps += u64::from(self.in_a_row > 0);
        balance.longest_excess = balance.longest_excess.max(self.in_a_row);
    }

    /// What is wrong with the balance, if anything. Where the time step is above the stable one of the elements, motions may grow, and soon
    /// strain grains so far that a single time step takes minutes: the run is stopped earlier.
    pub(super) fn excess(&self, is_above_stable_step: bool) -> Option<BalanceViolation> {
        let ratio = self.balance.relative_residual();
        let grows = ratio > self.tolerance && self.balance.largest > AMPLIFICATION * self.supplied;
        if grows || !ratio.is_finite() {
            return Some(BalanceViolation::Unstable);
        }
        let is_gross = is_above_stable_step && ratio > GROSS;
        let most =
            if is_above_stable_step { self.max_unresolved.min(MOST_ABOVE_STABLE_STEP) } else { self.max_unresolved };
        let is_unresolved = self.max_unresolved > 0 && (is_gross || self.in_a_row >= most);
        is_unresolved.then_some(BalanceViolation::Unresolved)
    }
}
