//! A campaign of seeded random cases that tries the grain solver and the coupled solver away from what they were tuned on.

mod campaign;
mod case;
mod dampings;
mod draw;
mod options;
mod outcome;
mod path;
mod shelf;
mod single;
mod tables;

use super::Effort;
use super::report::Report;
use campaign::Campaign;
use indicatif::{ProgressBar, ProgressStyle};
pub(crate) use options::Options;
use outcome::{Class, Outcome};
use rayon::prelude::*;

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
    report.note(&format!(
        "seed {}, {} cases, {} packings",
        campaign.seed,
        campaign.cases.len(),
        campaign.packings.iter().flatten().count()
    ))?;
    if !options.dampings.is_empty() {
        return dampings::run(&campaign, &options.dampings, report);
    }
    let outcomes = outcomes(&campaign, &[])?;
    tables::cases(&campaign, &outcomes, report)?;
    tables::classes(&campaign, &outcomes, report)?;
    Ok(())
}

/// Runs all cases with some more overrides, in the order of the cases.
///
/// # Errors
/// An override that a case does not take.
fn outcomes(campaign: &Campaign, more: &[String]) -> anyhow::Result<Vec<Outcome>> {
    let bar = progress(campaign.cases.len());
    let outcomes = campaign
        .cases
        .par_iter()
        .with_max_len(1)
        .map(|case| {
            let (test, _) = campaign.test(case, more)?;
            let outcome = match campaign.packings[case.slot].as_ref().expect("packings of all cases have been made") {
                Ok(packing) => outcome::run(&test, &campaign.slots[case.slot], packing, 1.0),
                Err(reason) => Outcome {
                    class: Class::Refused,
                    reason: format!("no packing: {reason}"),
                    increments: Vec::new(),
                    seconds: 0.0,
                },
            };
            bar.inc(1);
            Ok(outcome)
        })
        .collect();
    bar.finish_and_clear();
    outcomes
}

fn progress(count: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{elapsed} {wide_bar} {pos} of {len}, {eta} left");
    ProgressBar::new(count as u64).with_style(style.expect("the template is a constant"))
}
