//! A campaign of seeded random cases that tests the grain solver and the coupled solver outside the range they were tuned for.

mod campaign;
pub(crate) mod case;
pub(crate) mod check;
mod dampings;
mod groups;
mod ledger;
mod outcome;
pub(crate) mod packings;
mod path;
pub(crate) mod random_stream;
mod restless;
mod scenes;
mod single;
mod summary;
mod tables;
mod worst;

use super::report::Report;
use crate::effort::Effort;
use campaign::Campaign;
use case::{Case, Range};
use check::{Checked, Subject};
use indicatif::{ProgressBar, ProgressStyle};
use outcome::{Class, Outcome};
use path::Kind;
use rayon::prelude::*;
use rve_server::programs::rve_test::ElementTest;

/// Small scenes, thorough and quick.
const SCENES: [u64; 2] = [12, 2];

/// What `--only` may name.
pub(super) fn parts(_: &Effort) -> Vec<String> {
    Kind::ALL
        .iter()
        .map(|kind| kind.name())
        .chain(Range::ALL.iter().map(|range| range.name()))
        .map(str::to_owned)
        .collect()
}

/// Runs the campaign that the command line asks for.
///
/// # Errors
/// An override that no case takes, a filter that lets nothing through, or a report that cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let options = &effort.stability;
    let campaign = Campaign::new(options, effort)?;
    if options.case.is_some() {
        return single::run(&campaign, options, report);
    }
    if let Some(number) = options.scene {
        return scenes::run_one(campaign.seed, number, &campaign.slots, !options.unchecked, report);
    }
    report.note(&format!(
        "seed {}, {} cases, {} packings",
        campaign.seed,
        campaign.cases.len(),
        campaign.packings.iter().flatten().count()
    ))?;
    tables::packings(&campaign, report)?;
    if !options.dampings.is_empty() {
        return dampings::run(&campaign, &options.dampings, options.unchecked, report);
    }
    let (outcomes, checks) = checked_outcomes(&campaign, options.unchecked)?;
    tables::cases(&campaign, &outcomes, &checks, report)?;
    let classes = tables::classes(&campaign, &outcomes, &checks);
    report.table("classes", "how cases ended, and the share of increments at rest", &classes)?;
    restless::write(&campaign, &outcomes, &checks, report)?;
    let overrides: String = options.overrides.iter().map(|given| format!(" --set '{given}'")).collect();
    let long = if options.long_cycles { " --long-cycles" } else { "" };
    let worst = worst::table(&campaign, &outcomes, &checks, &format!("{long}{overrides}"));
    report.table("worst", "the worst cases", &worst)?;
    let count = options.small.unwrap_or_else(|| small_scenes(effort));
    let scenes = scenes::run(campaign.seed, count, &campaign.slots, !options.unchecked, report)?;
    let parts = [("How cases ended", classes), ("The worst cases", worst), ("How small scenes ended", scenes)];
    summary::write(&campaign, &outcomes, &checks, &parts, report)
}

/// Small scenes if the command line names no number: none where it filters or changes the cases of one cell, as scenes obey neither.
fn small_scenes(effort: &Effort) -> u64 {
    let options = &effort.stability;
    let asks_for_cells = options.dimension.is_some()
        || options.largest.is_some()
        || !options.overrides.is_empty()
        || !effort.only.is_empty();
    if asks_for_cells { 0 } else { effort.choose(SCENES[0], SCENES[1]) }
}

/// Runs all cases and checks those that are to be checked.
///
/// # Errors
/// An override that a case does not take.
fn checked_outcomes(campaign: &Campaign, unchecked: bool) -> anyhow::Result<(Vec<Outcome>, Vec<Checked>)> {
    let all: Vec<(Outcome, Checked)> = over_cases(campaign, |case| {
        let (test, _) = campaign.test(case, &[])?;
        let slot = &campaign.slots[case.slot];
        let outcome = answered(campaign, case, &test);
        let checked = match campaign.packing(case) {
            Ok(packing) => {
                let subject = Subject { test: &test, slot, packing, outcome: &outcome };
                subject.checked(!unchecked && subject.is_chosen(campaign.seed, case.number))
            }
            Err(_) => Checked::without_runs(&outcome),
        };
        Ok((outcome, checked))
    })?;
    Ok(all.into_iter().unzip())
}

/// Runs all cases with some more overrides, in the order of the cases.
///
/// # Errors
/// An override that a case does not take.
fn outcomes(campaign: &Campaign, more: &[String]) -> anyhow::Result<Vec<Outcome>> {
    over_cases(campaign, |case| Ok(answered(campaign, case, &campaign.test(case, more)?.0)))
}

fn answered(campaign: &Campaign, case: &Case, test: &ElementTest) -> Outcome {
    match campaign.packing(case) {
        Ok(packing) => outcome::run(test, &campaign.slots[case.slot], packing, 1.0),
        Err(reason) => Outcome {
            class: Class::Refused,
            reason: format!("no packing: {reason}"),
            increments: Vec::new(),
            seconds: 0.0,
        },
    }
}

/// Does something with every case, several at a time, and returns what it gave in the order of the cases.
fn over_cases<T: Send>(
    campaign: &Campaign,
    work: impl Fn(&Case) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let bar = progress(campaign.cases.len());
    let results = campaign
        .cases
        .par_iter()
        .with_max_len(1)
        .map(|case| {
            let result = work(case);
            bar.inc(1);
            result
        })
        .collect();
    bar.finish_and_clear();
    results
}

fn progress(count: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{elapsed} {wide_bar} {pos} of {len}, {eta} left");
    ProgressBar::new(count as u64).with_style(style.expect("the template is a constant"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability_options::Options;

    #[test]
    fn filters_and_overrides_of_cases_leave_small_scenes_out() {
        let effort = |stability: Options, only: &[&str]| Effort {
            stability,
            only: only.iter().map(|&name| name.to_owned()).collect(),
            ..Effort::default()
        };
        assert_eq!(small_scenes(&effort(Options::default(), &[])), 12);
        assert_eq!(small_scenes(&Effort { quick: true, ..Effort::default() }), 2);
        assert_eq!(small_scenes(&effort(Options { seed: Some(7), cases: Some(500), ..Options::default() }, &[])), 12);
        assert_eq!(small_scenes(&effort(Options::default(), &["everyday"])), 0);
        assert_eq!(small_scenes(&effort(Options { dimension: Some(2), ..Options::default() }, &[])), 0);
        assert_eq!(small_scenes(&effort(Options { largest: Some(100), ..Options::default() }, &[])), 0);
        let overrides = vec!["rve.damping=viscous".to_owned()];
        assert_eq!(small_scenes(&effort(Options { overrides, ..Options::default() }, &[])), 0);
    }
}
