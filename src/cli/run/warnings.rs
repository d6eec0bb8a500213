//! Warnings about the accuracy of a run that are more than a count.

use crate::cli::start_state::{MISMATCH, SLIGHT_MISMATCH};
use macro_solver::output::Summary;

/// Relative residual of the energy ledger above which it is warned of.
const LARGEST_RESIDUAL: f64 = 0.05;

/// Sum of the out-of-balance forces along an axis over reactions and loads along it, above which it is warned of.
const LARGEST_FORCE_SUM: f64 = 0.05;

/// Error of the mean stress by the balance of forces above which it is warned of, over the pressure.
const LARGEST_BALANCE_ERROR: f64 = 0.1;

/// Residual of the energy balance of dynamic stages above which it is warned of, over the largest energy of the stage so far, which is small
/// at first.
const LARGEST_RESIDUAL_OF_MOTION: f64 = 0.1;

/// Mass that scaling adds, over that of the body, from which on it is warned of.
const LARGEST_ADDED_MASS: f64 = 0.05;

/// What may have cost accuracy, in words, without the counters. `starts_in_balance`: step 0 has found an equilibrium.
pub(super) fn warnings(summary: &Summary, starts_in_balance: bool) -> Vec<String> {
    let residual = summary.energy.get("relative_residual").copied().unwrap_or(0.0);
    let open = (residual > LARGEST_RESIDUAL).then(|| {
        let percent = 100.0 * residual;
        format!(
            "energy balance open by {percent:.0} %: load steps are large where stresses change or turn fast (smaller ones close it), or \
             grains answer above equilibrium while they are strained, which damping takes (smaller rve.strain_per_step and \
             rve.tolerance close that)"
        )
    });
    let of_motion = summary.dynamics.get("energy_residual").copied().unwrap_or(0.0);
    let off = (of_motion > LARGEST_RESIDUAL_OF_MOTION).then(|| {
        let percent = 100.0 * of_motion;
        format!(
            "energy balance of the motion off by up to {percent:.0} % of the largest energy: the time step is too large for it, or the motion \
             began from forces that were not in balance (a smaller dynamics.safety or time_step tells which)"
        )
    });
    let of_mean = summary.balance.as_ref().map_or(0.0, |balance| balance.largest_of_mean);
    let unbalanced = (of_mean > LARGEST_BALANCE_ERROR).then(|| {
        format!(
            "forces balance to an error of up to {:.0} % of the mean stress only (column balance_error_of_mean of history.csv tells where): \
             smaller steps or a smaller solver.force_tolerance",
            100.0 * of_mean
        )
    });
    let [step, stable] = ["time_step", "stable_step"].map(|name| summary.dynamics.get(name).copied().unwrap_or(0.0));
    let unstable = (step > stable * (1.0 + 1e-6)).then(|| {
        format!("dynamics.time_step = {step:.3e} s is above the stable step of the elements, {stable:.3e} s: a motion may grow without bound")
    });
    let [mass, added] = ["mass", "added_mass"].map(|name| summary.dynamics.get(name).copied().unwrap_or(0.0));
    let heavier = (added > LARGEST_ADDED_MASS * (mass - added)).then(|| {
        let percent = 100.0 * added / (mass - added);
        format!(
            "mass scaling has added {percent:.0} % to the mass of the body: inertia is that much too large (a smaller dynamics.mass_scaled_step or \
             mass_factor adds less)"
        )
    });
    let is_prepared = summary.prepared.contains_key("cells");
    let mismatch = if is_prepared { SLIGHT_MISMATCH } else { MISMATCH };
    let unprepared = (starts_in_balance && summary.initial_imbalance > mismatch).then(|| {
        let what = if is_prepared { "cells were" } else { "the packing was" };
        format!(
            "{what} not prepared under the initial loads, and step 0 has strained the body (see initial residual)"
        )
    });
    let lacking = summary.balance.as_ref().filter(|balance| balance.largest_force_sum > LARGEST_FORCE_SUM).map(|balance| {
        format!(
            "forces out of balance add up to {:.1} % of the reactions and loads along an axis (a smaller solver.force_tolerance and \
             solver.stagnated_force_tolerance)",
            100.0 * balance.largest_force_sum
        )
    });
    [unprepared, open, unbalanced, lacking, off, unstable, heavier].into_iter().flatten().collect()
}
