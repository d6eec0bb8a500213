//! `summary.json` from the figures of solver and pool.

use super::counters::{DEPRECATED_NAMES, SKIPPED, add_deprecated, grouped};
use super::packings::PackingCounts;
use super::resume::Contents;
use super::shortcuts::{Allowed, shortcuts};
use super::warnings::warnings;
use crate::build_info;
use macro_solver::checkpoint::CheckpointFigures;
use macro_solver::material::difference::DifferenceCounts;
use macro_solver::material::error_estimate::ReplicaFigures;
use macro_solver::observer::{AccuracyFigures, Outcome, Run, Statistics};
use macro_solver::output::{AccuracySummary, BalanceSummary, CheckpointSummary, RunStatus, Summary, TimeShares};
use macro_solver::pool::PoolStatistics;
use protocol::PROTOCOL_VERSION;
use protocol::transport::shared_memory::ICEORYX2_VERSION;
use scene_reader::CellPreparation;
use std::collections::BTreeMap;

/// Inputs of the summary that neither solver nor pool knows.
pub(super) struct SummaryInputs {
    /// Gauss points of the mesh.
    pub(super) gauss_points: usize,
    /// Why the run did not reach its end.
    pub(super) reason: Option<String>,
    /// Workers of the run.
    pub(super) workers: usize,
    /// Wall time from the first worker's start to the end of the last step, s.
    pub(super) wall_s: f64,
    /// Whether the first stage is dynamic.
    pub(super) starts_in_motion: bool,
    /// Engines with their versions and points.
    pub(super) engines: String,
    /// Counts of finite differences.
    pub(super) differences: DifferenceCounts,
    /// Cost of the replicas.
    pub(super) replicas: ReplicaFigures,
    /// Error that the run keeps to.
    pub(super) error: Option<f64>,
    /// The energy ledger.
    pub(super) energy: BTreeMap<String, f64>,
    /// Figures of dynamic stages.
    pub(super) dynamics: BTreeMap<String, f64>,
    /// What decides the results and does not stand in the scene.
    pub(super) contents: Contents,
    /// Cost of checkpoints.
    pub(super) checkpoints: CheckpointFigures,
    /// Whether a part of the run was made by another build of this program.
    pub(super) other_build: bool,
    /// Which shortcuts are allowed.
    pub(super) allowed: Allowed,
    /// What happened between hosts.
    pub(super) hosts: BTreeMap<String, u64>,
    /// Cells brought to their stress before the run.
    pub(super) prepared: Option<CellPreparation>,
    /// Packings that the contact law does not leave in equilibrium.
    pub(super) packings: PackingCounts,
}

/// Puts the figures of solver and pool together.
pub(super) fn summary(run: &Run, pool: &PoolStatistics, inputs: SummaryInputs) -> Summary {
    let statistics = &run.statistics;
    let mut fallbacks = fallbacks(statistics, pool, &inputs);
    let others = [
        ("cutbacks", statistics.cut_backs),
        ("worker_restarts", pool.worker_restarts),
        ("reissued_jobs", pool.reissued),
    ];
    let all = fallbacks.iter().map(|(name, count)| (name.as_str(), *count)).chain(others);
    let fallback_groups = grouped(all);
    add_deprecated("fallbacks", &mut fallbacks);
    let flags = &statistics.flags;
    let skips = [
        statistics.skipped,
        pool.duplicates_skipped,
        flags.null_targets + statistics.still_points,
        flags.elastic_increments,
        flags.event_increments,
        statistics.idle_steps,
    ];
    let mut skipped: BTreeMap<String, u64> =
        SKIPPED.into_iter().zip(skips).map(|((name, _), count)| (name.to_owned(), count)).collect();
    add_deprecated("skipped", &mut skipped);
    let deprecated =
        |(table, former, name): (&str, &str, &str)| (format!("{table}.{former}"), format!("{table}.{name}"));
    let seconds = |nanoseconds: u64| nanoseconds as f64 * 1e-9;
    let accuracy = accuracy(&statistics.accuracy, &inputs, statistics.cost.force_evaluations);
    let mut made = Summary {
        status: status(&run.outcome),
        reason: inputs.reason,
        steps: statistics.steps,
        time_steps: statistics.time_steps,
        gauss_points: inputs.gauss_points as u64,
        newton_iterations: statistics.iterations,
        rve_evaluations: statistics.evaluations,
        force_evaluations: statistics.cost.force_evaluations,
        evaluations_per_gauss_point: statistics.evaluations as f64 / inputs.gauss_points as f64,
        tangents: statistics.tangents,
        workers: inputs.workers as u64,
        worker_restarts: pool.worker_restarts,
        reissued_jobs: pool.reissued,
        cut_backs: statistics.cut_backs,
        failed_evaluations: statistics.failed_evaluations,
        failed_force_evaluations: statistics.failed_force_evaluations,
        initial_imbalance: statistics.initial_imbalance,
        prepared: prepared(inputs.prepared),
        initial_deviation: statistics.initial_deviation,
        slowest_trials: statistics.trial_costs.slowest(0.01),
        fallbacks,
        fallback_groups,
        warnings: Vec::new(),
        skipped,
        economy: shortcuts(statistics, pool, &inputs.replicas, inputs.allowed),
        deprecated_names: DEPRECATED_NAMES.into_iter().map(deprecated).collect(),
        time: TimeShares {
            wall_s: inputs.wall_s,
            preparation_s: inputs.prepared.map_or(0.0, |prepared| prepared.seconds),
            rve_s: pool.rve_s,
            tangent_s: pool.tangent_s,
            transport_s: pool.transport_s,
            macro_transport_s: pool.macro_transport_s,
            assembly_s: seconds(statistics.assembly_nanoseconds),
            linear_solver_s: seconds(statistics.linear_solver_nanoseconds),
            // A worker waits while an evaluation is under way, and all of them while the macro does anything else.
            idle_s: pool.idle_s + (inputs.wall_s - pool.wall_s).max(0.0) * inputs.workers as f64,
        },
        checkpoint: CheckpointSummary {
            written: inputs.checkpoints.written,
            failed: inputs.checkpoints.failed,
            bytes: inputs.checkpoints.bytes,
            seconds: inputs.checkpoints.seconds,
            share_of_wall: inputs.checkpoints.seconds / inputs.wall_s.max(f64::MIN_POSITIVE),
            resumed: inputs.checkpoints.resumed,
        },
        accuracy,
        balance: balance(statistics),
        energy: inputs.energy,
        dynamics: inputs.dynamics,
        hosts: inputs.hosts,
        versions: versions(inputs.engines, &inputs.contents),
    };
    made.warnings = warnings(&made, !inputs.starts_in_motion && !run.has_no_start());
    made
}

fn versions(engines: String, contents: &Contents) -> BTreeMap<String, String> {
    let mut versions = BTreeMap::from([
        ("grainspan".to_owned(), build_info::VERSION.to_owned()),
        ("protocol".to_owned(), PROTOCOL_VERSION.to_string()),
        ("engines".to_owned(), engines),
        ("iceoryx2".to_owned(), ICEORYX2_VERSION.to_owned()),
        ("compiler".to_owned(), build_info::COMPILER.to_owned()),
    ]);
    versions.extend(contents.recorded());
    versions
}

fn status(outcome: &Outcome) -> RunStatus {
    match outcome {
        Outcome::Completed => RunStatus::Done,
        Outcome::DidNotConverge { .. } | Outcome::Unstable { .. } => RunStatus::NotConverged,
        Outcome::Interrupted => RunStatus::Interrupted,
        Outcome::WorkersLost { .. } => RunStatus::WorkersLost,
        Outcome::Stopped(_) => RunStatus::OutputFailed,
        Outcome::Refused(_) | Outcome::DefinitionRefused { .. } | Outcome::CheckpointRefused(_) => RunStatus::Refused,
    }
}

/// Every counter of the fallbacks, by name.
fn fallbacks(statistics: &Statistics, pool: &PoolStatistics, inputs: &SummaryInputs) -> BTreeMap<String, u64> {
    let flags = &statistics.flags;
    let of_hosts = |name: &str| inputs.hosts.get(name).copied().unwrap_or(0);
    named([
        ("not_equilibrated", flags.not_equilibrated),
        ("unfinished_trials", statistics.unfinished_trials),
        ("tangent_fallback", flags.tangent_fallback),
        ("tangent_regularised", flags.tangent_regularised),
        ("large_overlap", flags.large_overlap),
        ("no_load_bearing_contacts", flags.no_load_bearing_contacts),
        ("damping_changed", flags.damping_changed),
        ("handed_over", flags.handed_over),
        ("tangent_floored", statistics.floored_tangents),
        ("secant_refused", statistics.secant_refusals),
        ("asymmetric_stresses", statistics.asymmetric_stresses),
        ("sub_steps_of_points", statistics.sub_steps),
        ("stagnated_steps", statistics.stagnated_steps),
        ("steps_with_noisy_corrections", statistics.steps_with_noisy_corrections),
        ("steps_stabilised", statistics.stabilised_steps),
        ("steps_with_committed_iterates", statistics.steps_with_committed_iterates),
        ("committed_iterates", statistics.committed_iterates),
        ("stabilisations_taken_back", statistics.stabilisations_taken_back),
        ("stabilisation_increments", statistics.stabilisation_increments),
        ("stabilisation_evaluations", statistics.stabilisation_evaluations),
        ("rejected_iterates", statistics.rejected),
        ("rejected_evaluations", statistics.rejected_evaluations),
        ("frozen_network_iterates", statistics.frozen_network_iterates),
        ("equations_solved_directly", statistics.direct_fallbacks),
        ("tangents_by_difference", inputs.differences.operators),
        ("difference_evaluations", inputs.differences.probes),
        ("differences_refused", inputs.differences.refused),
        ("replayed_trials", pool.replayed_trials),
        ("workers_left", pool.workers_left),
        ("workers_recycled", pool.workers_recycled),
        ("workers_lost", pool.workers_lost),
        ("workers_cut_off", pool.workers_cut_off),
        ("workers_hung", pool.workers_hung),
        ("workers_faulty", pool.workers_faulty),
        ("messages_refused", pool.refused_messages),
        ("late_replies", pool.late_replies),
        ("unknown_replies", pool.unknown_replies),
        ("agents_lost", of_hosts("agents_lost")),
        ("agents_faulty", of_hosts("agents_faulty")),
        ("agents_refused", of_hosts("agents_refused")),
        ("strangers_refused", of_hosts("strangers_refused")),
        ("error_above_wanted", statistics.accuracy.missed_steps),
        ("replicas_lost", inputs.replicas.lost),
        ("checkpoints_failed", inputs.checkpoints.failed),
        ("continued_by_another_build", u64::from(inputs.other_build)),
        ("packings_far_from_rest", inputs.packings.far_from_rest),
        ("packing_forces_changed", inputs.packings.forces_changed),
    ])
}

/// Estimated error and strain per ramp step; `None` if nothing was estimated.
fn accuracy(figures: &AccuracyFigures, inputs: &SummaryInputs, force_evaluations: u64) -> Option<AccuracySummary> {
    let last = &figures.last;
    (figures.estimated_steps > 0).then(|| AccuracySummary {
        estimated_error: last.rms,
        estimated_error_of_mean: last.of_mean,
        largest_of_a_point: last.largest,
        over_all_steps: figures.rms(),
        largest_of_a_step: figures.largest_rms,
        wanted: inputs.error,
        points: last.points,
        steps_without_estimate: figures.steps_since,
        smallest_strain_per_step: figures.strain_per_step[0],
        largest_strain_per_step: figures.strain_per_step[1],
        share_of_force_evaluations: inputs.replicas.force_evaluations as f64 / force_evaluations.max(1) as f64,
    })
}

/// Balance of forces in the accepted steps; `None` where no step knew its next correction.
fn balance(statistics: &Statistics) -> Option<BalanceSummary> {
    let figures = &statistics.accuracy;
    figures.balance.map(|last| BalanceSummary {
        largest_force_ratio: statistics.largest_force_ratio,
        largest_force_sum: statistics.largest_force_sum,
        largest_displacement_ratio: statistics.largest_displacement_ratio,
        error: last.rms,
        error_of_mean: last.of_mean,
        largest_of_a_step: figures.largest_balance.rms,
        largest_of_mean: figures.largest_balance.of_mean,
    })
}

fn prepared(cells: Option<CellPreparation>) -> BTreeMap<String, u64> {
    cells.map_or_else(BTreeMap::new, |cells| {
        named([
            ("cells", cells.cells as u64),
            ("in_smaller_steps", cells.in_smaller_steps as u64),
            ("next_to_stress", cells.next_to_stress as u64),
        ])
    })
}

fn named<const N: usize>(counts: [(&str, u64); N]) -> BTreeMap<String, u64> {
    counts.into_iter().map(|(name, count)| (name.to_owned(), count)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::closing_lines::closing_lines;
    use super::super::counters::COUNTERS;
    use super::*;
    use macro_solver::checkpoint::CheckpointError;
    use macro_solver::observer::BalanceError;
    use macro_solver::problem::ProblemError;

    fn inputs() -> SummaryInputs {
        SummaryInputs {
            gauss_points: 8,
            reason: None,
            workers: 2,
            wall_s: 1.0,
            starts_in_motion: false,
            engines: String::new(),
            differences: DifferenceCounts::default(),
            replicas: ReplicaFigures::default(),
            error: None,
            energy: BTreeMap::new(),
            dynamics: BTreeMap::new(),
            contents: Contents::default(),
            checkpoints: CheckpointFigures::default(),
            other_build: false,
            allowed: Allowed::everything(1e-3),
            hosts: BTreeMap::new(),
            prepared: None,
            packings: PackingCounts::default(),
        }
    }

    fn ended(outcome: Outcome, statistics: Statistics, pool: &PoolStatistics) -> (Summary, String) {
        ended_with(inputs(), outcome, statistics, pool)
    }

    fn ended_with(
        inputs: SummaryInputs,
        outcome: Outcome,
        statistics: Statistics,
        pool: &PoolStatistics,
    ) -> (Summary, String) {
        let run = Run { outcome, stage: 0, load: 1.0, step: 2, statistics };
        let summary = summary(&run, pool, inputs);
        let text = closing_lines(&summary, &run, 1, false, "out/a");
        (summary, text)
    }

    /// A counter that is added has to be put into a group and explained.
    #[test]
    fn every_counter_of_the_summary_has_its_group_and_there_is_no_other() {
        let (summary, _) = ended(Outcome::Completed, Statistics::default(), &PoolStatistics::default());
        let others = ["cutbacks", "reissued_jobs", "worker_restarts"].map(str::to_owned);
        let is_new = |name: &&String| !summary.deprecated_names.contains_key(&format!("fallbacks.{name}"));
        let mut found: Vec<String> = summary.fallbacks.keys().filter(is_new).cloned().chain(others).collect();
        let mut known: Vec<String> = COUNTERS.iter().map(|counter| counter.name.to_owned()).collect();
        found.sort();
        known.sort();
        assert_eq!(found, known);
    }

    /// A motion that has lost its energy balance is no good run, however short it was.
    #[test]
    fn a_motion_off_its_energy_balance_is_warned_of() {
        let statistics = Statistics { steps: 4, time_steps: 17, ..Statistics::default() };
        for (residual, warned) in [(0.05, false), (1.28, true)] {
            let dynamics = BTreeMap::from([("energy_residual".to_owned(), residual)]);
            let inputs = SummaryInputs { dynamics, ..inputs() };
            let (summary, text) =
                ended_with(inputs, Outcome::Completed, statistics.clone(), &PoolStatistics::default());
            assert_eq!(text.contains("energy balance of the motion off by up to 128 %"), warned, "{text}");
            assert_eq!(summary.warnings.len(), usize::from(warned), "{:?}", summary.warnings);
            assert!(text.contains("done: 4 steps, 0 iterations, 17 time steps in"), "{text}");
            assert_eq!((summary.steps, summary.time_steps), (4, 17));
        }
    }

    /// Of a stress that was off by its own size the closing lines said nothing among the warnings.
    #[test]
    fn stresses_far_from_balance_are_warned_of() {
        for (of_mean, warned) in [(0.04, false), (1.376, true)] {
            let balance = BalanceError { rms: 2.0 * of_mean, of_mean };
            let mut statistics = Statistics { steps: 4, ..Statistics::default() };
            statistics.accuracy.balance = Some(balance);
            statistics.accuracy.largest_balance = balance;
            let (_, text) = ended(Outcome::Completed, statistics, &PoolStatistics::default());
            assert_eq!(text.contains("an error of up to 138 % of the mean stress"), warned, "{text}");
        }
    }

    #[test]
    fn former_names_stand_next_to_the_new_ones() {
        let statistics = Statistics { stabilisation_increments: 5, ..Statistics::default() };
        let (summary, text) = ended(Outcome::Completed, statistics, &PoolStatistics::default());
        for (table, former, name) in DEPRECATED_NAMES {
            let counts = if table == "skipped" { &summary.skipped } else { &summary.fallbacks };
            assert_eq!(counts[former], counts[name], "{former}");
            assert_eq!(summary.deprecated_names[&format!("{table}.{former}")], format!("{table}.{name}"));
        }
        assert_eq!((summary.fallbacks["creep_increments"], text.matches("creep").count()), (5, 0));
        assert!(!summary.fallback_groups["look_at_this"].contains_key("creep_increments"));
    }

    /// A good run floors thousands of tangents without any effect on its result.
    #[test]
    fn only_counters_that_concern_the_result_are_warnings() {
        let good = Statistics { floored_tangents: 3531, cut_backs: 2, skipped: 1, ..Statistics::default() };
        let (_, text) = ended(Outcome::Completed, good, &PoolStatistics::default());
        assert!(text.contains("  warnings         none\n"), "{text}");
        let fallbacks =
            "  fallbacks        2 failed attempts, 3531 tangents with eigenvalue floor (no effect on accuracy, ";
        assert!(text.contains(fallbacks), "{text}");
        assert!(text.contains("  skipped          1 unchanged target\n"), "{text}");
        let mut doubtful = Statistics::default();
        doubtful.flags.not_equilibrated = 4;
        let (summary, text) = ended(Outcome::Completed, doubtful, &PoolStatistics::default());
        assert!(
            text.contains("  warnings         4 trials not equilibrated (see docs/reference/counters.md)"),
            "{text}"
        );
        assert_eq!(summary.fallback_groups["look_at_this"]["not_equilibrated"], 4);
    }

    #[test]
    fn a_refused_problem_or_checkpoint_is_not_an_output_that_failed() {
        let checkpoint = CheckpointError::unfit("solver", "another mesh");
        let definition = Outcome::DefinitionRefused { reason: "no cohesion".to_owned() };
        for outcome in [Outcome::Refused(ProblemError::NoStage), definition, Outcome::CheckpointRefused(checkpoint)] {
            let (summary, text) = ended(outcome, Statistics::default(), &PoolStatistics::default());
            assert_eq!(summary.status, RunStatus::Refused);
            assert!(text.starts_with("refused: "), "{text}");
        }
    }
}
