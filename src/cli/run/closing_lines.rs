//! The closing lines of a run: the summary for people.

use super::counters::{Concern, in_words};
use crate::cli::start_state::MISMATCH;
use macro_solver::observer::{Outcome, Run};
use macro_solver::output::{AccuracySummary, BalanceSummary, CheckpointSummary, Summary};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Sum of the out-of-balance forces along an axis over reactions and loads along it, above which the lines mention it.
const FORCE_SUM_TOLD: f64 = 0.01;

/// Where the counters are explained.
const EXPLAINED: &str = "see docs/reference/counters.md";

/// Error with the balance of forces over that without, from which on both are told.
const BALANCE_COUNTS: f64 = 1.1;

/// The estimated error in words; the part of the balance of forces, which has a line of its own, as independent of it.
fn accuracy(accuracy: &AccuracySummary, balance: Option<&BalanceSummary>) -> String {
    let AccuracySummary { points, smallest_strain_per_step: smallest, largest_strain_per_step: largest, .. } =
        accuracy;
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let wanted = accuracy.wanted.map_or(String::new(), |wanted| format!(", wanted {}", percent(wanted)));
    let strain = if smallest == largest {
        format!("strain per step {smallest:.1e}")
    } else {
        format!("strain per step {smallest:.1e} to {largest:.1e}")
    };
    let points = match points {
        1 => "1 point (error_estimate.share = 1 takes all)".to_owned(),
        points => format!("{points} points"),
    };
    let until = match accuracy.steps_without_estimate {
        0 => String::new(),
        steps => format!(" {steps} step(s) before the end, where the last followed cell lost its load"),
    };
    let [own, of_mean] = [accuracy.estimated_error, accuracy.estimated_error_of_mean];
    let [left, left_of_mean] = balance.map_or([0.0; 2], |balance| [balance.error, balance.error_of_mean]);
    let [all, all_of_mean] = [own.hypot(left), of_mean.hypot(left_of_mean)];
    // Only errors of one state add up.
    let is_of_the_end = accuracy.steps_without_estimate == 0;
    let with_balance = if is_of_the_end && (all > BALANCE_COUNTS * own || all_of_mean > BALANCE_COUNTS * of_mean) {
        format!(" ({} and {} with the balance)", percent(all), percent(all_of_mean))
    } else {
        String::new()
    };
    format!(
        "estimated error {} of the pressure at a point, {} of the mean stress{with_balance}{until}{wanted}; {strain}; {points} solved once \
         more, which adds {} to the work",
        percent(own),
        percent(of_mean),
        percent(accuracy.share_of_force_evaluations),
    )
}

/// How far forces were from balance, and what that leaves of an error.
fn balance(balance: &BalanceSummary) -> String {
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let sum = if balance.largest_force_sum > FORCE_SUM_TOLD {
        format!(", summed up along an axis {}", percent(balance.largest_force_sum))
    } else {
        String::new()
    };
    format!(
        "out-of-balance force up to {} of reactions and loads{sum}; it leaves {} of the pressure at a point, {} of the mean stress (at most {})",
        percent(balance.largest_force_ratio),
        percent(balance.error),
        percent(balance.error_of_mean),
        percent(balance.largest_of_mean),
    )
}

/// A headline and one line per subject; `folder` is the output folder. `starts_in_motion`: the first stage is dynamic.
pub(super) fn closing_lines(
    summary: &Summary,
    run: &Run,
    force_evaluations: u64,
    starts_in_motion: bool,
    folder: &str,
) -> String {
    let per_step = summary.evaluations_per_gauss_point / (summary.steps.max(1) as f64);
    let slowest = &summary.slowest_trials;
    let done = match (starts_in_motion, run.has_no_start()) {
        (true, _) => "the motion begins with it",
        (false, true) => "step 0 found no equilibrium",
        (false, false) => "step 0 equilibrated it",
    };
    let in_accuracy = |found: &AccuracySummary| accuracy(found, summary.balance.as_ref());
    let mut lines = vec![
        (
            "evaluations",
            format!(
                "{} of {} Gauss points: {:.1} per point, {per_step:.1} per point and step; {} with tangents",
                summary.rve_evaluations, summary.gauss_points, summary.evaluations_per_gauss_point, summary.tangents
            ),
        ),
        (
            "grain solver",
            format!(
                "{force_evaluations} force evaluations, {:.0} per evaluation",
                force_evaluations as f64 / summary.rve_evaluations.max(1) as f64
            ),
        ),
        (
            "slowest 1 %",
            format!(
                "{} trials of {} to {} force evaluations, {:.1} % of all",
                slowest.trials,
                slowest.from_force_evaluations,
                slowest.largest_force_evaluations,
                100.0 * slowest.share_of_force_evaluations
            ),
        ),
        ("accuracy", summary.accuracy.as_ref().map_or_else(|| "error not estimated".to_owned(), in_accuracy)),
        ("balance", summary.balance.as_ref().map_or_else(|| "not known".to_owned(), balance)),
        ("worker time", worker_time(summary)),
        (
            "macro time",
            format!("assembly {:.2} s, linear solver {:.2} s", summary.time.assembly_s, summary.time.linear_solver_s),
        ),
        ("checkpoints", checkpoints(&summary.checkpoint)),
        ("initial residual", initial_residual(summary.initial_imbalance, done)),
    ];
    if let Some(cells) = summary.prepared.get("cells") {
        let [smaller, missed] =
            ["in_smaller_steps", "next_to_stress"].map(|name| summary.prepared.get(name).copied().unwrap_or(0));
        let missed = match missed {
            0 => String::new(),
            _ => format!(", {missed} of them up to 1e-4 of the pressure off"),
        };
        let seconds = summary.time.preparation_s;
        lines.push((
            "initial stress",
            format!(
                "{cells} cells brought to it before the run in {seconds:.1} s, {smaller} of them in smaller steps{missed}"
            ),
        ));
    }
    lines.push(("warnings", warnings(summary)));
    lines.push(match listed(&summary.fallback_groups, Concern::Harmless) {
        found if found.is_empty() => ("fallbacks", "none".to_owned()),
        found => ("fallbacks", format!("{found} (no effect on accuracy, {EXPLAINED})")),
    });
    let skipped = super::counters::SKIPPED.map(|(name, _)| (name, summary.skipped.get(name).copied().unwrap_or(0)));
    lines.push(match nonzero(skipped.into_iter()) {
        found if found.is_empty() => ("skipped", "none".to_owned()),
        found => ("skipped", found + &saved(summary)),
    });
    lines.extend(super::shortcuts::lines(summary));
    lines.push(("written to", folder.to_owned()));
    let mut text = headline(summary, &run.outcome) + "\n";
    for (label, value) in lines {
        writeln!(text, "  {label:<16} {value}").expect("writing to a String cannot fail");
    }
    text
}

/// What may have cost accuracy: the counters of that group, then what is more than a count.
fn warnings(summary: &Summary) -> String {
    let counted = listed(&summary.fallback_groups, Concern::LookAtThis);
    let counted = (!counted.is_empty()).then(|| format!("{counted} ({EXPLAINED})"));
    let all: Vec<String> = counted.into_iter().chain(summary.warnings.iter().cloned()).collect();
    if all.is_empty() { "none".to_owned() } else { all.join("; ") }
}

/// What the shortcuts have saved of all force evaluations, the least that is known.
fn saved(summary: &Summary) -> String {
    let saved: u64 = summary.economy.values().map(|shortcut| shortcut.force_evaluations_saved).sum();
    if saved == 0 { String::new() } else { format!(" ({saved} force evaluations saved)") }
}

fn headline(summary: &Summary, outcome: &Outcome) -> String {
    let time_steps =
        if summary.time_steps > 0 { format!(", {} time steps", summary.time_steps) } else { String::new() };
    let figures = format!(
        "{} steps, {} iterations{time_steps} in {:.1} s with {} workers",
        summary.steps, summary.newton_iterations, summary.time.wall_s, summary.workers
    );
    match outcome {
        Outcome::Completed => format!("done: {figures}"),
        Outcome::DidNotConverge { .. } => format!("did not converge: {figures}"),
        Outcome::Unstable { .. } => format!("unstable: {figures}"),
        Outcome::Interrupted => format!("interrupted: {figures}"),
        Outcome::WorkersLost { .. } => format!("workers lost: {figures}"),
        Outcome::Stopped(_) => format!("stopped: {figures}"),
        Outcome::Refused(_) | Outcome::DefinitionRefused { .. } | Outcome::CheckpointRefused(_) => {
            format!("refused: {figures}")
        }
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
        0 => format!("none written; collecting the state took {:.3} s ({share:.2} %){resumed}", figures.seconds),
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

/// Out-of-balance force of the state that the run began with.
/// `done`: what became of it.
fn initial_residual(imbalance: f64, done: &str) -> String {
    let text = format!("{imbalance:.1e} (relative to applied loads)");
    if imbalance > MISMATCH {
        format!("{text}: the packing was not prepared under these loads; {done} (see `grainspan check`)")
    } else {
        text
    }
}

/// The counters of a group in words, in the order of their names.
fn listed(groups: &BTreeMap<String, BTreeMap<String, u64>>, concern: Concern) -> String {
    let group = groups.get(concern.keyword()).into_iter().flatten();
    nonzero(group.map(|(name, count)| (name.as_str(), *count)))
}

fn nonzero<'a>(counts: impl Iterator<Item = (&'a str, u64)>) -> String {
    counts.filter(|(_, count)| *count > 0).map(|(name, count)| in_words(name, count)).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_that_the_packing_was_not_prepared_for_is_named() {
        assert_eq!(initial_residual(9.4e-7, ""), "9.4e-7 (relative to applied loads)");
        let text = initial_residual(0.49, "step 0 equilibrated it");
        assert!(text.contains("not prepared under these loads; step 0 equilibrated it"), "{text}");
    }
}
