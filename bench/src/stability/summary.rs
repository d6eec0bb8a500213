//! The headline, as JSON for programs and as markdown for people.

use super::campaign::Campaign;
use super::case::Range;
use super::check::{Checked, SHARE};
use super::ledger;
use super::outcome::{Class, Outcome};
use crate::repeat::quantile;
use crate::report::Report;
use crate::table::Table;
use charts::short;
use grainspan::machine::Machine;
use serde::Serialize;
use std::collections::BTreeMap;

/// What `summary.json` holds.
#[derive(Debug, Serialize)]
struct Summary {
    machine: Machine,
    seed: u64,
    cases: usize,
    /// Number of finer runs.
    checked: usize,
    /// Cases by class.
    classes: BTreeMap<&'static str, usize>,
    /// Increments of everyday cases, and those of them that are not at rest.
    everyday_increments: usize,
    everyday_not_at_rest: usize,
    /// Of these, increments of cells that have lost their pressure.
    everyday_not_at_rest_unloaded: usize,
    hard_increments: usize,
    hard_not_at_rest: usize,
    hard_not_at_rest_unloaded: usize,
    force_evaluations: u64,
    /// Wall time of all cases without their checks, s, summed over the threads.
    seconds: f64,
}

/// Writes `summary.json` and `stability.md`, and says the headline.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write(
    campaign: &Campaign,
    outcomes: &[Outcome],
    checks: &[Checked],
    parts: &[(&str, Table)],
    report: &mut Report,
) -> anyhow::Result<()> {
    let of = |range: Range, count: fn(&Outcome, u32) -> usize| -> usize {
        let chosen = campaign.cases.iter().zip(outcomes).filter(|(case, _)| case.range == range);
        chosen.map(|(case, outcome)| count(outcome, campaign.slots[case.slot].dimension)).sum()
    };
    let summary = Summary {
        machine: Machine::here(),
        seed: campaign.seed,
        cases: outcomes.len(),
        checked: checks.iter().filter(|checked| !checked.error.is_nan()).count(),
        classes: Class::ALL
            .map(|class| (class.name(), checks.iter().filter(|checked| checked.class == class).count()))
            .into(),
        everyday_increments: of(Range::Everyday, |outcome, _| outcome.answered()),
        everyday_not_at_rest: of(Range::Everyday, |outcome, _| outcome.not_at_rest()),
        everyday_not_at_rest_unloaded: of(Range::Everyday, Outcome::not_at_rest_unloaded),
        hard_increments: of(Range::Hard, |outcome, _| outcome.answered()),
        hard_not_at_rest: of(Range::Hard, |outcome, _| outcome.not_at_rest()),
        hard_not_at_rest_unloaded: of(Range::Hard, Outcome::not_at_rest_unloaded),
        force_evaluations: outcomes.iter().map(Outcome::evaluations).sum(),
        seconds: outcomes.iter().map(|outcome| outcome.seconds).sum(),
    };
    let headline = headline(&summary, checks);
    for sentence in &headline {
        report.note(sentence)?;
    }
    report.file("summary.json", &serde_json::to_vec_pretty(&summary)?)?;
    let parts: String =
        parts.iter().map(|(title, table)| format!("## {title}\n\n{}\n", table.to_markdown())).collect();
    let text = format!(
        "# Stability campaign, seed {}\n\n{}\n\n{}\n\n{}",
        campaign.seed,
        summary.machine.line(),
        headline.join("\n"),
        parts.trim_end().to_owned() + "\n"
    );
    Ok(report.file("stability.md", text.as_bytes())?)
}

fn headline(summary: &Summary, checks: &[Checked]) -> Vec<String> {
    let at_rest = |increments: usize, not: usize| {
        let share = super::tables::share(increments.saturating_sub(not), increments);
        if share.is_nan() { "none".to_owned() } else { format!("{share:.3} % of {increments}") }
    };
    let sizes: Vec<f64> = checks.iter().map(|checked| checked.open.abs()).filter(|open| !open.is_nan()).collect();
    let errors: Vec<f64> = checks.iter().map(|checked| checked.error).filter(|error| !error.is_nan()).collect();
    vec![
        format!(
            "increments at rest: {} in everyday cases, {} in hard ones; of the others {} and {} are of cells without pressure",
            at_rest(summary.everyday_increments, summary.everyday_not_at_rest),
            at_rest(summary.hard_increments, summary.hard_not_at_rest),
            summary.everyday_not_at_rest_unloaded,
            summary.hard_not_at_rest_unloaded
        ),
        format!(
            "compared with finer runs: {} of {} cases (all cheap ones, {:.0} % of the others); difference at the end over the mean \
             pressure: median {}, 99th percentile {}",
            summary.checked,
            summary.cases,
            100.0 * SHARE,
            short(quantile(&errors, 0.5)),
            short(quantile(&errors, 0.99))
        ),
        format!(
            "energy ledger (stored, friction, damping, work) open by, over the largest energy: median {}, 99th percentile {}, at most {}; \
             closed within {:.0} % in {} of {} cases",
            short(quantile(&sizes, 0.5)),
            short(quantile(&sizes, 0.99)),
            short(quantile(&sizes, 1.0)),
            100.0 * ledger::LIMIT,
            sizes.iter().filter(|size| **size <= ledger::LIMIT).count(),
            sizes.len()
        ),
    ]
}
