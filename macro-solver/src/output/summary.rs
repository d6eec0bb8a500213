//! `summary.json`: what a run did, what it cost, and everything that fell short.

use super::{OutputError, write_atomically};
use crate::observer::trial_costs::SlowestTrials;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunStatus {
    /// The whole path was followed.
    Done,
    /// A step did not converge at the smallest increment; everything up to the last accepted step is written.
    NotConverged,
    /// Workers were lost and could not be replaced.
    WorkersLost,
    /// A person or the system asked to stop.
    Interrupted,
    /// An output file could not be written.
    OutputFailed,
    /// The problem, or the checkpoint to continue from, was refused before the first step.
    Refused,
}

/// Where the time went, s. The worker times are sums over all workers, so that `rve_s + tangent_s + transport_s +
/// idle_s` is about `workers * wall_s`; the macro's own times are wall times of its one thread, partly while workers solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimeShares {
    /// From the opening of the channels, before the first workers start, to the end of the last step; all processes of a continued run
    /// together.
    pub wall_s: f64,
    /// Before that, cells brought to their initial stress by the latest process of the run; not in `wall_s`.
    #[serde(default)]
    pub preparation_s: f64,
    /// Workers, relaxation of grains.
    pub rve_s: f64,
    /// Workers, tangent operators.
    pub tangent_s: f64,
    /// Workers, everything between a job's arrival and its reply that is neither of the above: snapshots, hashing,
    /// messages.
    pub transport_s: f64,
    /// Macro, writing, checking and moving messages.
    #[serde(default)]
    pub macro_transport_s: f64,
    /// Macro, element integrals and boundary conditions.
    pub assembly_s: f64,
    /// Macro, factorizations and solves.
    pub linear_solver_s: f64,
    /// Workers, waiting for a job.
    pub idle_s: f64,
}

/// What checkpoints have cost, over all processes of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointSummary {
    /// Checkpoints written.
    pub written: u64,
    /// Checkpoints that could not be written.
    pub failed: u64,
    /// Size of the last one, bytes.
    pub bytes: u64,
    /// Time spent collecting and writing, s.
    pub seconds: f64,
    /// That time over the wall time.
    pub share_of_wall: f64,
    /// Times that the run was continued.
    pub resumed: u64,
}

/// Estimated error of the stresses, from Gauss points that are solved once more. Errors are relative to the largest mean pressure
/// that a point has had.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AccuracySummary {
    /// Root mean square over the points, after the last step.
    pub estimated_error: f64,
    /// The same of the mean stress of the points.
    pub estimated_error_of_mean: f64,
    /// Largest of a point, after the last step.
    pub largest_of_a_point: f64,
    /// Root mean square over points and steps.
    pub over_all_steps: f64,
    /// Largest root mean square of a step.
    pub largest_of_a_step: f64,
    /// Error that the run keeps to, the key `rve.error`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wanted: Option<f64>,
    /// Points that are solved once more.
    pub points: u64,
    /// Steps at the end without an estimate, since none of these points bears load any more: the errors are those of the step before.
    #[serde(default)]
    pub steps_without_estimate: u64,
    /// Smallest strain per ramp step of any step.
    pub smallest_strain_per_step: f64,
    /// Largest strain per ramp step of any step.
    pub largest_strain_per_step: f64,
    /// Force evaluations of the points solved once more over those of all others.
    pub share_of_force_evaluations: f64,
}

/// How far forces were from balance in the accepted steps, and what that leaves of an error of the stresses: the change that the next
/// correction would bring, relative to the largest mean pressure of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BalanceSummary {
    /// Largest out-of-balance force of a step over reactions and loads.
    pub largest_force_ratio: f64,
    /// Largest sum of the out-of-balance forces along an axis, over reactions and loads along it.
    #[serde(default)]
    pub largest_force_sum: f64,
    /// Largest correction that an accepted state would still have got, over the displacement of a full step.
    pub largest_displacement_ratio: f64,
    /// Root mean square over the points, after the last step.
    pub error: f64,
    /// The same of the mean stress of the points.
    pub error_of_mean: f64,
    /// Largest root mean square of a step.
    pub largest_of_a_step: f64,
    /// Largest error of the mean stress in a step.
    pub largest_of_mean: f64,
}

/// A means by which a run saves work, or pays for knowing its error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shortcut {
    /// Whether it was allowed.
    pub enabled: bool,
    /// How often it was taken.
    pub count: u64,
    /// How often it could have been taken: the evaluations, trials or steps that `count` is a part of.
    #[serde(default)]
    pub of: u64,
    /// Force evaluations that it saved: those of the replies that were used again, or the fewest that a relaxation takes. 0 where nothing
    /// of that kind is saved or can be counted.
    pub force_evaluations_saved: u64,
    /// Force evaluations that it took in addition.
    #[serde(default)]
    pub force_evaluations_spent: u64,
    /// Time of workers that it saved, s, by the mean times of this run with and without it; negative if it took longer. Left out where
    /// the run has no such times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds_saved: Option<f64>,
    /// Trials of a message, mean over those that `count` holds; left out where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trials_per_message: Option<f64>,
    /// Bound of what it changes: unbalanced force over mean contact force, or out-of-balance force over reactions and loads; 0 where no
    /// bit changes, or where the result keeps the same tolerances.
    pub error: f64,
}

/// Content of `summary.json`; the keys are a contract with scripts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// How it ended.
    pub status: RunStatus,
    /// Why it did not reach its end, for people; left out of a run that did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Accepted steps; of dynamic stages, the reports.
    pub steps: u64,
    /// Time steps of dynamic stages.
    #[serde(default)]
    pub time_steps: u64,
    /// Gauss points of the mesh.
    pub gauss_points: u64,
    /// Newton iterations, those of rejected attempts included.
    pub newton_iterations: u64,
    /// RVE evaluations, those of rejected attempts included.
    pub rve_evaluations: u64,
    /// Force evaluations of these RVE evaluations.
    #[serde(default)]
    pub force_evaluations: u64,
    /// `rve_evaluations / gauss_points`.
    pub evaluations_per_gauss_point: f64,
    /// RVE evaluations that were asked for a tangent operator; the others needed none.
    #[serde(default)]
    pub tangents: u64,
    /// Workers that served when the run began.
    pub workers: u64,
    /// Workers started again after one was lost.
    pub worker_restarts: u64,
    /// Jobs given out a second time.
    pub reissued_jobs: u64,
    /// Attempts at a step that failed: it was repeated with a smaller increment, or stabilised.
    #[serde(rename = "cutbacks")]
    pub cut_backs: u64,
    /// RVE evaluations of attempts that were taken back.
    #[serde(default)]
    pub failed_evaluations: u64,
    /// Their force evaluations.
    #[serde(default)]
    pub failed_force_evaluations: u64,
    /// Out-of-balance force of the stress that the run started with, over the reactions or loads.
    #[serde(default)]
    pub initial_imbalance: f64,
    /// Largest deviation of that stress from what `[initial_stress]` expects, over the largest component expected.
    #[serde(default)]
    pub initial_deviation: f64,
    /// Cells that `[initial_stress] prepare` has brought to their stress, by name: all `cells`, those that took smaller steps
    /// (`in_smaller_steps`), and those that miss it by up to 1e-4 of the pressure (`next_to_stress`). Left out of runs that prepare none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub prepared: BTreeMap<String, u64>,
    /// The slowest 1 % of the trials and what they cost.
    #[serde(default)]
    pub slowest_trials: SlowestTrials,
    /// Evaluations that had to take a worse way, by name.
    pub fallbacks: BTreeMap<String, u64>,
    /// Those of them, and of the counts above, that are not 0, by group: what may have cost accuracy (`look_at_this`) and what
    /// has not (`harmless`).
    #[serde(default)]
    pub fallback_groups: BTreeMap<String, BTreeMap<String, u64>>,
    /// Further warnings about accuracy, in words, as in the closing lines: those that are more than a count. Empty where there are none.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Evaluations that were not needed, by name.
    pub skipped: BTreeMap<String, u64>,
    /// Every means by which the run saves work, by name; those of `[economy]` by their key.
    #[serde(default)]
    pub economy: BTreeMap<String, Shortcut>,
    /// Former names of entries, as `table.name`, with the names that replace them; both are present for one version.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub deprecated_names: BTreeMap<String, String>,
    /// Where the time went.
    pub time: TimeShares,
    /// What checkpoints have cost.
    #[serde(default)]
    pub checkpoint: CheckpointSummary,
    /// Estimated error of the stresses; left out of runs that do not estimate it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<AccuracySummary>,
    /// Balance of forces; left out of runs without steps of Newton's method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub balance: Option<BalanceSummary>,
    /// Energies at the end, J, by name.
    pub energy: BTreeMap<String, f64>,
    /// Figures of dynamic stages by name: the last time step (s), mass of the body and added mass (kg, in the plane per metre of
    /// thickness), and the largest residual of the energy balance over the largest energy of any of them. Left out of
    /// quasi-static runs.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub dynamics: BTreeMap<String, f64>,
    /// What happened between hosts, by name: agents that joined, left, were lost or refused, strangers refused, messages and bytes both
    /// ways, and snapshots that did not have to travel. Left out of runs that do not listen for other hosts.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub hosts: BTreeMap<String, u64>,
    /// Versions of everything that can change a bit.
    pub versions: BTreeMap<String, String>,
}

impl Summary {
    /// Writes the summary as JSON.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        let mut text = serde_json::to_string_pretty(self).map_err(|reason| OutputError::encode(path, reason))?;
        text.push('\n');
        write_atomically(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The keys that scripts read; a missing one is a broken contract.
    #[test]
    fn the_summary_has_every_promised_key() {
        let summary = Summary {
            status: RunStatus::NotConverged,
            reason: Some("no progress".to_owned()),
            steps: 3,
            time_steps: 0,
            gauss_points: 8,
            newton_iterations: 9,
            rve_evaluations: 72,
            force_evaluations: 7200,
            evaluations_per_gauss_point: 9.0,
            tangents: 4,
            workers: 2,
            worker_restarts: 0,
            reissued_jobs: 0,
            cut_backs: 1,
            failed_evaluations: 64,
            failed_force_evaluations: 6400,
            initial_imbalance: 0.25,
            prepared: BTreeMap::new(),
            initial_deviation: 0.0,
            slowest_trials: SlowestTrials::default(),
            fallbacks: BTreeMap::new(),
            fallback_groups: BTreeMap::new(),
            warnings: vec!["energy balance open".to_owned()],
            skipped: BTreeMap::new(),
            economy: BTreeMap::from([("zero_increments".to_owned(), Shortcut::default())]),
            deprecated_names: BTreeMap::new(),
            time: TimeShares::default(),
            checkpoint: CheckpointSummary::default(),
            balance: Some(BalanceSummary { error_of_mean: 2e-3, ..BalanceSummary::default() }),
            accuracy: None,
            energy: BTreeMap::new(),
            dynamics: BTreeMap::new(),
            hosts: BTreeMap::new(),
            versions: BTreeMap::new(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        summary.write(&path).unwrap();
        let value: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(value["status"], "not_converged");
        for key in [
            "wall_s",
            "rve_s",
            "tangent_s",
            "transport_s",
            "macro_transport_s",
            "assembly_s",
            "linear_solver_s",
            "idle_s",
        ] {
            assert!(value["time"][key].is_number(), "{key}");
        }
        for key in ["fallbacks", "fallback_groups", "skipped", "economy", "energy", "versions"] {
            assert!(value[key].is_object(), "{key}");
        }
        assert_eq!(value["warnings"][0], "energy balance open");
        assert_eq!(serde_json::from_value::<Summary>(value).unwrap(), summary);
    }
}
