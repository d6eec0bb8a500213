//! The same cases with each damping: increments not at rest, and the work.

use super::campaign::Campaign;
use super::case::Range;
use super::outcome::{Class, Outcome};
use super::outcomes;
use super::tables::share;
use crate::cli::bench::repeat::quantile;
use crate::cli::bench::report::Report;
use crate::cli::bench::table::Table;
use rve_server::definition::Damping;

/// Runs all cases with each damping and compares.
///
/// # Errors
/// An override that a case does not take, or a report that cannot be written.
pub(super) fn run(campaign: &Campaign, dampings: &[Damping], report: &mut Report) -> anyhow::Result<()> {
    let mut all: Vec<Vec<Outcome>> = Vec::new();
    for damping in dampings {
        all.push(outcomes(campaign, &[format!("rve.damping=\"{}\"", damping.keyword())])?);
    }
    each(campaign, dampings, &all, report)?;
    for range in Range::ALL {
        for dimension in [2, 3] {
            let chosen: Vec<usize> = (0..campaign.cases.len())
                .filter(|place| {
                    let case = &campaign.cases[*place];
                    case.range == range && campaign.slots[case.slot].dimension == dimension
                })
                .collect();
            if !chosen.is_empty() {
                let name = format!("dampings-{}-{dimension}d", range.name());
                let heading = format!("{} cases, {dimension}D: work by damping", range.name());
                report.table(&name, &heading, &work(&chosen, dampings, &all))?;
            }
        }
    }
    Ok(())
}

/// One row per case and damping.
fn each(campaign: &Campaign, dampings: &[Damping], all: &[Vec<Outcome>], report: &mut Report) -> anyhow::Result<()> {
    let mut table = Table::new([
        "case",
        "range",
        "kind",
        "packing",
        "damping",
        "class",
        "increments",
        "not_at_rest",
        "force_evaluations",
        "slowest_increment",
        "seconds",
        "reason",
    ]);
    for (place, case) in campaign.cases.iter().enumerate() {
        for (damping, outcomes) in dampings.iter().zip(all) {
            let outcome = &outcomes[place];
            table.row([
                case.number.into(),
                case.range.name().into(),
                case.kind.name().into(),
                campaign.slots[case.slot].name.as_str().into(),
                damping.keyword().into(),
                outcome.class.name().into(),
                outcome.answered().into(),
                outcome.not_at_rest().into(),
                outcome.evaluations().into(),
                outcome.slowest().into(),
                outcome.seconds.into(),
                outcome.reason.as_str().into(),
            ]);
        }
    }
    Ok(report.raw("cases", &table)?)
}

/// What each damping took for the chosen cases. Work is compared over the increments that all dampings have brought to rest:
/// an increment that ends at the step cap costs what the cap allows.
fn work(chosen: &[usize], dampings: &[Damping], all: &[Vec<Outcome>]) -> Table {
    let mut table = Table::new([
        "damping",
        "cases",
        "not_plain",
        "increments",
        "not_at_rest",
        "at_rest_%",
        "Mevaluations",
        "Mevaluations_shared",
        "median_per_increment",
        "p99_per_increment",
        "slowest",
        "seconds",
    ]);
    let is_whole = |place: &usize| all.iter().all(|outcomes| is_plain(outcomes[*place].class));
    let shared: Vec<usize> = chosen.iter().copied().filter(is_whole).collect();
    for (damping, outcomes) in dampings.iter().zip(all) {
        let of = |places: &[usize]| -> Vec<f64> {
            let increments = places.iter().flat_map(|place| outcomes[*place].increments.iter().skip(1));
            increments.map(|one| one.evaluations as f64).collect()
        };
        let (every, together) = (of(chosen), of(&shared));
        let not_at_rest: usize = chosen.iter().map(|place| outcomes[*place].not_at_rest()).sum();
        table.row([
            damping.keyword().into(),
            chosen.len().into(),
            chosen.iter().filter(|place| !is_plain(outcomes[**place].class)).count().into(),
            every.len().into(),
            not_at_rest.into(),
            share(every.len() - not_at_rest, every.len()).into(),
            (1e-6 * every.iter().sum::<f64>()).into(),
            (1e-6 * together.iter().sum::<f64>()).into(),
            quantile(&together, 0.5).into(),
            quantile(&together, 0.99).into(),
            every.iter().copied().fold(0.0, f64::max).into(),
            chosen.iter().map(|place| outcomes[*place].seconds).sum::<f64>().into(),
        ]);
    }
    table
}

/// Whether all increments were answered and are at rest.
fn is_plain(class: Class) -> bool {
    matches!(class, Class::Right | Class::Unchecked | Class::NoContacts)
}
