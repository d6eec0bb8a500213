//! The same cases with each damping: increments not at rest, the work, and how far the end is from that of a finer run.
//!
//! There is one finer run per case, with the first of the dampings that comes to rest everywhere: all are measured by the same.

use super::campaign::Campaign;
use super::case::Range;
use super::check::Subject;
use super::outcome::{Class, Outcome};
use super::tables::share;
use super::{outcomes, over_cases};
use crate::repeat::quantile;
use crate::report::Report;
use crate::table::Table;
use rve_server::definition::Damping;

/// Runs all cases with each damping and compares.
///
/// # Errors
/// An override that a case does not take, or a report that cannot be written.
pub(super) fn run(
    campaign: &Campaign,
    dampings: &[Damping],
    unchecked: bool,
    report: &mut Report,
) -> anyhow::Result<()> {
    let set = |damping: &Damping| [format!("rve.damping=\"{}\"", damping.keyword())];
    let mut all: Vec<Vec<Outcome>> = Vec::new();
    for damping in dampings {
        all.push(outcomes(campaign, &set(damping))?);
    }
    let finer = over_cases(campaign, |case| {
        let Ok(packing) = campaign.packing(case) else { return Ok(None) };
        let slot = &campaign.slots[case.slot];
        let place = campaign.cases.partition_point(|other| other.number < case.number);
        for (damping, outcomes) in dampings.iter().zip(&all) {
            let (test, _) = campaign.test(case, &set(damping))?;
            let subject = Subject { test: &test, slot, packing, outcome: &outcomes[place] };
            if !unchecked
                && subject.is_chosen(campaign.seed, case.number)
                && let Some(finer) = subject.finer()
            {
                return Ok(Some(finer));
            }
        }
        Ok(None)
    })?;
    let errors: Vec<Vec<f64>> = all
        .iter()
        .map(|outcomes| {
            let error = |place: usize| match (&finer[place], campaign.packing(&campaign.cases[place])) {
                (Some(finer), Ok(packing)) if is_plain(outcomes[place].class) => {
                    let case = &campaign.cases[place];
                    let slot = &campaign.slots[case.slot];
                    Subject { test: &case.test, slot, packing, outcome: finer }.difference(&outcomes[place])
                }
                _ => f64::NAN,
            };
            (0..outcomes.len()).map(error).collect()
        })
        .collect();
    each(campaign, dampings, &all, &errors, report)?;
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
                report.table(&name, &heading, &work(&chosen, dampings, &all, &errors))?;
            }
        }
    }
    Ok(())
}

/// One row per case and damping.
fn each(
    campaign: &Campaign,
    dampings: &[Damping],
    all: &[Vec<Outcome>],
    errors: &[Vec<f64>],
    report: &mut Report,
) -> anyhow::Result<()> {
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
        "error_over_pressure",
        "seconds",
        "reason",
    ]);
    for (place, case) in campaign.cases.iter().enumerate() {
        for ((damping, outcomes), errors) in dampings.iter().zip(all).zip(errors) {
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
                errors[place].into(),
                outcome.seconds.into(),
                outcome.reason.as_str().into(),
            ]);
        }
    }
    Ok(report.raw("cases", &table)?)
}

/// What each damping took for the chosen cases. Work is compared over the increments that all dampings have brought to rest:
/// an increment that ends at the step cap costs what the cap allows.
fn work(chosen: &[usize], dampings: &[Damping], all: &[Vec<Outcome>], errors: &[Vec<f64>]) -> Table {
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
        "compared",
        "error_median",
        "error_p99",
        "seconds",
    ]);
    let is_whole = |place: &usize| all.iter().all(|outcomes| is_plain(outcomes[*place].class));
    let shared: Vec<usize> = chosen.iter().copied().filter(is_whole).collect();
    for ((damping, outcomes), errors) in dampings.iter().zip(all).zip(errors) {
        let differences: Vec<f64> =
            shared.iter().map(|place| errors[*place]).filter(|error| !error.is_nan()).collect();
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
            differences.len().into(),
            quantile(&differences, 0.5).into(),
            quantile(&differences, 0.99).into(),
            chosen.iter().map(|place| outcomes[*place].seconds).sum::<f64>().into(),
        ]);
    }
    table
}

/// Whether all increments were answered and are at rest.
fn is_plain(class: Class) -> bool {
    matches!(class, Class::Right | Class::Unchecked | Class::NoLoadBearingContacts)
}
