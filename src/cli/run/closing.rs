//! The end of a run: `summary.json`, and the same for people.

use super::counters::{Concern, grouped};
use crate::cli::start_state::MISMATCH;
use macro_solver::checkpoint::CheckpointFigures;
use macro_solver::difference::DifferenceCounts;
use macro_solver::observer::{Outcome, Run, Statistics};
use macro_solver::output::{CheckpointSummary, RunStatus, Summary, TimeShares};
use macro_solver::pool::PoolStatistics;
use protocol::PROTOCOL_VERSION;
use protocol::transport::shared_memory::ICEORYX2_VERSION;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Evaluations that were not needed.
pub(super) const SKIPPED: [&str; 3] = ["unchanged_targets", "equal_questions", "null_targets"];

/// Relative residual of the energy ledger that people are told of.
const LARGEST_RESIDUAL: f64 = 0.05;

/// What the summary needs beside the solver's and the pool's own figures.
pub(super) struct Circumstances {
    /// Gauss points of the mesh.
    pub(super) gauss_points: usize,
    /// Why the run did not reach its end.
    pub(super) reason: Option<String>,
    /// Workers asked for.
    pub(super) workers: usize,
    /// Wall time from the first worker's start to the end of the last step, s.
    pub(super) wall_s: f64,
    /// Engines with their versions and points.
    pub(super) engines: String,
    /// What finite differences have cost.
    pub(super) differences: DifferenceCounts,
    /// The energy ledger.
    pub(super) energy: BTreeMap<String, f64>,
    /// Figures of dynamic stages.
    pub(super) dynamics: BTreeMap<String, f64>,
    /// Content identity of the grains' definition.
    pub(super) definition: String,
    /// What checkpoints have cost.
    pub(super) checkpoints: CheckpointFigures,
    /// Whether a part of the run was made by another build of this program.
    pub(super) other_build: bool,
}

/// Puts the figures of solver and pool together.
pub(super) fn summary(run: &Run, pool: &PoolStatistics, about: Circumstances) -> Summary {
    let statistics = &run.statistics;
    let fallbacks = fallbacks(statistics, pool, &about);
    let beside = [
        ("cutbacks", statistics.cut_backs),
        ("worker_restarts", pool.worker_restarts),
        ("reissued_jobs", pool.reissued),
    ];
    let all = fallbacks.iter().map(|(name, count)| (name.as_str(), *count)).chain(beside);
    let fallback_groups = grouped(all);
    let seconds = |nanoseconds: u64| nanoseconds as f64 * 1e-9;
    Summary {
        status: status(&run.outcome),
        reason: about.reason,
        steps: statistics.steps,
        gauss_points: about.gauss_points as u64,
        newton_iterations: statistics.iterations,
        rve_evaluations: statistics.evaluations,
        evaluations_per_gauss_point: statistics.evaluations as f64 / about.gauss_points as f64,
        workers: about.workers as u64,
        worker_restarts: pool.worker_restarts,
        reissued_jobs: pool.reissued,
        cutbacks: statistics.cut_backs,
        initial_imbalance: statistics.initial_imbalance,
        initial_deviation: statistics.initial_deviation,
        slowest_trials: statistics.trial_costs.slowest(0.01),
        fallbacks,
        fallback_groups,
        skipped: named([
            (SKIPPED[0], statistics.skipped),
            (SKIPPED[1], pool.duplicates_skipped),
            (SKIPPED[2], statistics.flags.null_targets),
        ]),
        time: TimeShares {
            wall_s: about.wall_s,
            rve_s: pool.rve_s,
            tangent_s: pool.tangent_s,
            transport_s: pool.transport_s,
            assembly_s: seconds(statistics.assembly_nanoseconds),
            linear_solver_s: seconds(statistics.linear_solver_nanoseconds),
            // A worker waits while an evaluation is under way, and all of them while the macro does anything else.
            idle_s: pool.idle_s + (about.wall_s - pool.wall_s).max(0.0) * about.workers as f64,
        },
        checkpoint: CheckpointSummary {
            written: about.checkpoints.written,
            failed: about.checkpoints.failed,
            bytes: about.checkpoints.bytes,
            seconds: about.checkpoints.seconds,
            share_of_wall: about.checkpoints.seconds / about.wall_s.max(f64::MIN_POSITIVE),
            resumed: about.checkpoints.resumed,
        },
        energy: about.energy,
        dynamics: about.dynamics,
        versions: BTreeMap::from([
            ("grainspan".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("protocol".to_owned(), PROTOCOL_VERSION.to_string()),
            ("engines".to_owned(), about.engines),
            ("iceoryx2".to_owned(), ICEORYX2_VERSION.to_owned()),
            ("compiler".to_owned(), env!("GRAINSPAN_COMPILER").to_owned()),
            ("definition".to_owned(), about.definition),
        ]),
    }
}

fn status(outcome: &Outcome) -> RunStatus {
    match outcome {
        Outcome::Completed => RunStatus::Done,
        Outcome::DidNotConverge { .. } | Outcome::Unstable { .. } => RunStatus::NotConverged,
        Outcome::Interrupted => RunStatus::Interrupted,
        Outcome::WorkersLost { .. } => RunStatus::WorkersLost,
        Outcome::Stopped(_) => RunStatus::OutputFailed,
        Outcome::Refused(_) => RunStatus::Refused,
    }
}

fn fallbacks(statistics: &Statistics, pool: &PoolStatistics, about: &Circumstances) -> BTreeMap<String, u64> {
    let flags = &statistics.flags;
    named([
        ("not_equilibrated", flags.not_equilibrated),
        ("unfinished_trials", statistics.unfinished_trials),
        ("tangent_fallback", flags.tangent_fallback),
        ("tangent_regularised", flags.tangent_regularised),
        ("large_overlap", flags.large_overlap),
        ("no_contacts", flags.fluid),
        ("damping_changed", flags.damping_changed),
        ("tangent_floored", statistics.floored_tangents),
        ("secant_refused", statistics.secant_refusals),
        ("asymmetric_stresses", statistics.asymmetric_stresses),
        ("sub_steps_of_points", statistics.sub_steps),
        ("steps_stabilised", statistics.stabilised_steps),
        ("creep_increments", statistics.creep_increments),
        ("evaluations_in_creep", statistics.creep_evaluations),
        ("iterates_turned_down", statistics.turned_down),
        ("evaluations_turned_down", statistics.turned_down_evaluations),
        ("equations_solved_directly", statistics.direct_fallbacks),
        ("tangents_by_difference", about.differences.operators),
        ("difference_evaluations", about.differences.probes),
        ("replayed_trials", pool.replayed_trials),
        ("workers_left", pool.workers_left),
        ("workers_recycled", pool.workers_recycled),
        ("workers_lost", pool.workers_lost),
        ("workers_hung", pool.workers_hung),
        ("workers_faulty", pool.workers_faulty),
        ("messages_refused", pool.refused_messages),
        ("checkpoints_failed", about.checkpoints.failed),
        ("continued_by_another_build", u64::from(about.other_build)),
    ])
}

fn named<const N: usize>(counts: [(&str, u64); N]) -> BTreeMap<String, u64> {
    counts.into_iter().map(|(name, count)| (name.to_owned(), count)).collect()
}

/// The closing lines of a run.
pub(super) fn text(summary: &Summary, outcome: &Outcome, force_evaluations: u64, folder: &str) -> String {
    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        writeln!(text, "  {label:<14} {value}").expect("writing to a String cannot fail");
    };
    let per_step = summary.evaluations_per_gauss_point / (summary.steps.max(1) as f64);
    line(
        "evaluations",
        format!(
            "{} of {} Gauss points: {:.1} per point, {per_step:.1} per point and step",
            summary.rve_evaluations, summary.gauss_points, summary.evaluations_per_gauss_point
        ),
    );
    line(
        "grain solver",
        format!(
            "{force_evaluations} force evaluations, {:.0} per evaluation",
            force_evaluations as f64 / summary.rve_evaluations.max(1) as f64
        ),
    );
    let slowest = &summary.slowest_trials;
    line(
        "slowest 1 %",
        format!(
            "{} trials of {} to {} force evaluations, {:.1} % of all",
            slowest.trials,
            slowest.from_force_evaluations,
            slowest.largest_force_evaluations,
            100.0 * slowest.share_of_force_evaluations
        ),
    );
    line("worker time", worker_time(summary));
    line(
        "macro time",
        format!("assembly {:.2} s, linear solver {:.2} s", summary.time.assembly_s, summary.time.linear_solver_s),
    );
    line("checkpoints", checkpoints(&summary.checkpoint));
    line("at the start", at_the_start(summary.initial_imbalance));
    let explained = "see docs/reference/counters.md";
    match listed(&summary.fallback_groups, Concern::LookAtThis) {
        found if found.is_empty() => line("accuracy", "nothing fell short".to_owned()),
        found => line("fell short", format!("{found} ({explained})")),
    }
    let open = summary.energy.get("relative_residual").copied().unwrap_or(0.0);
    if open > LARGEST_RESIDUAL {
        let percent = 100.0 * open;
        line(
            "fell short",
            format!("energy ledger open by {percent:.0} %: steps too large to tell where the work went"),
        );
    }
    match listed(&summary.fallback_groups, Concern::Harmless) {
        found if found.is_empty() => {}
        found => line("harmless", format!("{found} (guides the solver only, {explained})")),
    }
    let saved: Vec<String> = nonzero(&summary.skipped);
    line("saved", if saved.is_empty() { "nothing".to_owned() } else { saved.join(", ") });
    line("written to", folder.to_owned());
    format!("{}\n{text}", headline(summary, outcome))
}

fn headline(summary: &Summary, outcome: &Outcome) -> String {
    let figures = format!(
        "{} steps, {} iterations in {:.1} s with {} workers",
        summary.steps, summary.newton_iterations, summary.time.wall_s, summary.workers
    );
    match outcome {
        Outcome::Completed => format!("done: {figures}"),
        Outcome::DidNotConverge { .. } => format!("did not converge: {figures}"),
        Outcome::Unstable { .. } => format!("unstable: {figures}"),
        Outcome::Interrupted => format!("interrupted: {figures}"),
        Outcome::WorkersLost { .. } => format!("workers lost: {figures}"),
        Outcome::Stopped(_) => format!("stopped: {figures}"),
        Outcome::Refused(_) => format!("refused: {figures}"),
    }
}

fn checkpoints(figures: &CheckpointSummary) -> String {
    let share = 100.0 * figures.share_of_wall;
    let size = figures.bytes as f64 / 1e6;
    let resumed = match figures.resumed {
        0 => String::new(),
        count => format!(", continued {count} times"),
    };
    match figures.written {
        0 => format!("none written, {:.3} s ({share:.2} %){resumed}", figures.seconds),
        count => format!("{count} of {size:.2} MB, {:.3} s ({share:.2} %){resumed}", figures.seconds),
    }
}

fn worker_time(summary: &Summary) -> String {
    let time = &summary.time;
    let parts =
        [("grains", time.rve_s), ("tangent", time.tangent_s), ("transport", time.transport_s), ("idle", time.idle_s)];
    let total: f64 = parts.iter().map(|(_, seconds)| seconds).sum();
    let share = |seconds: f64| if total > 0.0 { 100.0 * seconds / total } else { 0.0 };
    parts.map(|(name, seconds)| format!("{name} {seconds:.1} s ({:.1} %)", share(seconds))).join(", ")
}

/// How far the state that the run began with was from balance.
fn at_the_start(imbalance: f64) -> String {
    let text = format!("out of balance by {imbalance:.1e} of the loads");
    if imbalance > MISMATCH {
        format!(
            "{text}: the packing was not prepared under these loads, step 0 brought it there (see `grainspan check`)"
        )
    } else {
        text
    }
}

/// The counters of a group for people.
fn listed(groups: &BTreeMap<String, BTreeMap<String, u64>>, concern: Concern) -> String {
    groups.get(concern.keyword()).map_or_else(String::new, |group| nonzero(group).join(", "))
}

fn nonzero(counts: &BTreeMap<String, u64>) -> Vec<String> {
    counts
        .iter()
        .filter(|(_, count)| **count > 0)
        .map(|(name, count)| format!("{} {count}", name.replace('_', " ")))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::counters::COUNTERS;
    use super::*;
    use macro_solver::problem::ProblemError;

    fn ended(outcome: Outcome, statistics: Statistics, pool: &PoolStatistics) -> (Summary, String) {
        let about = Circumstances {
            gauss_points: 8,
            reason: None,
            workers: 2,
            wall_s: 1.0,
            engines: String::new(),
            differences: DifferenceCounts::default(),
            energy: BTreeMap::new(),
            dynamics: BTreeMap::new(),
            definition: String::new(),
            checkpoints: CheckpointFigures::default(),
            other_build: false,
        };
        let run = Run { outcome, stage: 0, load: 1.0, statistics };
        let summary = summary(&run, pool, about);
        let text = text(&summary, &run.outcome, 1, "out/a");
        (summary, text)
    }

    /// A counter that is added has to be put into a group and explained.
    #[test]
    fn every_counter_of_the_summary_has_its_group_and_there_is_no_other() {
        let (summary, _) = ended(Outcome::Completed, Statistics::default(), &PoolStatistics::default());
        let beside = ["cutbacks", "reissued_jobs", "worker_restarts"].map(str::to_owned);
        let mut found: Vec<String> = summary.fallbacks.keys().cloned().chain(beside).collect();
        let mut known: Vec<String> = COUNTERS.iter().map(|(name, _)| (*name).to_owned()).collect();
        found.sort();
        known.sort();
        assert_eq!(found, known);
    }

    /// A good run floors thousands of tangents; nobody should fear for the result.
    #[test]
    fn a_good_run_does_not_frighten_and_a_doubtful_one_does() {
        let good = Statistics { floored_tangents: 3531, cut_backs: 2, ..Statistics::default() };
        let (_, text) = ended(Outcome::Completed, good, &PoolStatistics::default());
        assert!(text.contains("accuracy       nothing fell short\n"), "{text}");
        assert!(text.contains("harmless       cutbacks 2, tangent floored 3531 (guides the solver only"), "{text}");
        assert!(!text.contains("LOOK"), "{text}");
        let mut doubtful = Statistics::default();
        doubtful.flags.not_equilibrated = 4;
        let (summary, text) = ended(Outcome::Completed, doubtful, &PoolStatistics::default());
        assert!(text.contains("fell short     not equilibrated 4 (see docs/reference/counters.md)"), "{text}");
        assert_eq!(summary.fallback_groups["look_at_this"]["not_equilibrated"], 4);
    }

    #[test]
    fn a_start_that_the_packing_was_not_prepared_for_is_named() {
        assert_eq!(at_the_start(9.4e-7), "out of balance by 9.4e-7 of the loads");
        assert!(at_the_start(0.49).contains("the packing was not prepared under these loads"));
    }

    #[test]
    fn a_refused_problem_is_not_an_output_that_failed() {
        let (summary, text) =
            ended(Outcome::Refused(ProblemError::NoStage), Statistics::default(), &PoolStatistics::default());
        assert_eq!(summary.status, RunStatus::Refused);
        assert!(text.starts_with("refused: "), "{text}");
    }
}
