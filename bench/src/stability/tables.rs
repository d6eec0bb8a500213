//! What a campaign leaves: a row per case, and how cases of each kind ended.

use super::campaign::Campaign;
use super::case::Range;
use super::check::Checked;
use super::outcome::{Class, Outcome};
use super::path::Kind;
use crate::report::Report;
use crate::table::Table;
use rve_server::contact::{ContactTable, Rotations};
use rve_server::definition::{Accuracy, RveOptions};

/// Writes `cases.csv`: one row per case.
///
/// # Errors
/// The file cannot be written.
pub(super) fn cases(
    campaign: &Campaign,
    outcomes: &[Outcome],
    checks: &[Checked],
    report: &mut Report,
) -> anyhow::Result<()> {
    let mut table = Table::new([
        "case",
        "range",
        "kind",
        "packing",
        "dimension",
        "grains",
        "law",
        "stiffness_ratio",
        "friction",
        "rolling_friction",
        "cohesion_m",
        "viscosity",
        "rotations",
        "accuracy",
        "increments_planned",
        "increments",
        "not_at_rest",
        "not_at_rest_unloaded",
        "class",
        "reason",
        "force_evaluations",
        "slowest_increment",
        "error_over_pressure",
        "bound",
        "gap",
        "energy_open",
        "pressure_end_Pa",
        "seconds",
    ]);
    for ((case, outcome), checked) in campaign.cases.iter().zip(outcomes).zip(checks) {
        let (slot, contact) = (&campaign.slots[case.slot], &case.test.contact);
        let planned: u64 =
            case.test.path.iter().map(|segment| u64::from(segment.increments) * u64::from(segment.repeat)).sum();
        table.row([
            case.number.into(),
            case.range.name().into(),
            case.kind.name().into(),
            slot.name.as_str().into(),
            u64::from(slot.dimension).into(),
            slot.number.into(),
            contact.law.keyword().into(),
            ratio(contact).into(),
            contact.friction.into(),
            contact.rolling_friction.into(),
            contact.cohesion.into(),
            contact.damping.into(),
            (if contact.rotations == Rotations::Free { "free" } else { "blocked" }).into(),
            accuracy(&case.test.rve).as_str().into(),
            planned.into(),
            outcome.answered().into(),
            outcome.not_at_rest().into(),
            outcome.not_at_rest_unloaded(slot.dimension).into(),
            checked.class.name().into(),
            checked.reason.as_str().into(),
            outcome.evaluations().into(),
            outcome.slowest().into(),
            checked.error.into(),
            checked.bound.into(),
            checked.gap.into(),
            checked.open.into(),
            outcome.increments.last().map_or(f64::NAN, |last| last.pressure(slot.dimension)).into(),
            outcome.seconds.into(),
        ]);
    }
    Ok(report.raw("cases", &table)?)
}

/// k_t / k_n.
fn ratio(contact: &ContactTable) -> f64 {
    let of_poisson = contact.poisson_ratio.map(|ratio| 2.0 * (1.0 - ratio) / (2.0 - ratio));
    contact.stiffness_ratio.or(of_poisson).unwrap_or(f64::NAN)
}

/// Name of the accuracy, or the error that is asked for.
pub(super) fn accuracy(options: &RveOptions) -> String {
    match (options.error, options.accuracy) {
        (Some(error), _) => format!("error {error:.2e}"),
        (None, Accuracy::Draft) => "draft".to_owned(),
        (None, Accuracy::Default) => "default".to_owned(),
        (None, Accuracy::Tight) => "tight".to_owned(),
    }
}

/// Writes `packings.csv`: the packings that the cases use, and what making them took.
///
/// # Errors
/// The file cannot be written.
pub(super) fn packings(campaign: &Campaign, report: &mut Report) -> anyhow::Result<()> {
    let mut table =
        Table::new(["packing", "grains", "modulus_over_pressure", "made_with_friction", "made", "seconds"]);
    for ((slot, packing), seconds) in campaign.slots.iter().zip(&campaign.packings).zip(&campaign.seconds) {
        let Some(packing) = packing else { continue };
        let modulus = slot.contact.modulus.or(slot.contact.shear_modulus).unwrap_or(f64::NAN);
        table.row([
            slot.name.as_str().into(),
            slot.number.into(),
            (modulus / slot.pressure).into(),
            slot.contact.friction.into(),
            packing.as_ref().err().map_or("yes", String::as_str).into(),
            (*seconds).into(),
        ]);
    }
    Ok(report.raw("packings", &table)?)
}

/// How cases of each kind ended.
pub(super) fn classes(campaign: &Campaign, outcomes: &[Outcome], checks: &[Checked]) -> Table {
    let mut table = Table::new([
        "range",
        "kind",
        "cases",
        "right",
        "unchecked",
        "no_contacts",
        "over_budget",
        "refused",
        "not_at_rest",
        "wrong",
        "not_finite",
        "panicked",
        "increments",
        "at_rest_%",
        "restless_unloaded",
    ]);
    for range in Range::ALL {
        for kind in Kind::ALL.into_iter().map(Some).chain([None]) {
            let chosen: Vec<usize> = (0..outcomes.len())
                .filter(|place| {
                    let case = &campaign.cases[*place];
                    case.range == range && kind.is_none_or(|kind| kind == case.kind)
                })
                .collect();
            if chosen.is_empty() {
                continue;
            }
            let count = |class: Class| chosen.iter().filter(|place| checks[**place].class == class).count();
            let increments: usize = chosen.iter().map(|place| outcomes[*place].answered()).sum();
            let not_at_rest: usize = chosen.iter().map(|place| outcomes[*place].not_at_rest()).sum();
            let [right, unchecked, no_contacts, over_budget, refused, restless, wrong, not_finite, panicked] =
                Class::ALL.map(count);
            table.row([
                range.name().into(),
                kind.map_or("all", Kind::name).into(),
                chosen.len().into(),
                right.into(),
                unchecked.into(),
                no_contacts.into(),
                over_budget.into(),
                refused.into(),
                restless.into(),
                wrong.into(),
                not_finite.into(),
                panicked.into(),
                increments.into(),
                share(increments - not_at_rest, increments).into(),
                chosen.iter().map(|place| unloaded(campaign, outcomes, *place)).sum::<usize>().into(),
            ]);
        }
    }
    table
}

/// Increments of a case that are not at rest because there is no pressure left.
fn unloaded(campaign: &Campaign, outcomes: &[Outcome], place: usize) -> usize {
    outcomes[place].not_at_rest_unloaded(campaign.slots[campaign.cases[place].slot].dimension)
}

/// A share in per cent; nothing of nothing is not measured.
pub(super) fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { f64::NAN } else { 100.0 * part as f64 / whole as f64 }
}
