//! The worst cases, with the commands that repeat them.

use super::campaign::Campaign;
use super::check::Checked;
use super::outcome::{Class, Outcome};
use crate::table::Table;
use std::cmp::Ordering;

/// How many are shown.
const SHOWN: usize = 20;

/// The worst cases, the worst first: broken ones, then wrong ones, then those that are not at rest, then refused ones, then the
/// slowest of the rest.
pub(super) fn table(campaign: &Campaign, outcomes: &[Outcome], checks: &[Checked], options: &str) -> Table {
    let mut order: Vec<usize> = (0..outcomes.len()).collect();
    order.sort_by(|one, other| {
        let classes = severity(checks[*other].class).cmp(&severity(checks[*one].class));
        classes.then_with(|| badness(&outcomes[*other], &checks[*other], &outcomes[*one], &checks[*one]))
    });
    let mut table = Table::new(["class", "range", "kind", "packing", "not_at_rest", "slowest", "again", "what"]);
    for place in order.into_iter().take(SHOWN) {
        let (case, outcome, checked) = (&campaign.cases[place], &outcomes[place], &checks[place]);
        table.row([
            checked.class.name().into(),
            case.range.name().into(),
            case.kind.name().into(),
            campaign.slots[case.slot].name.as_str().into(),
            outcome.not_at_rest().into(),
            outcome.slowest().into(),
            format!("grainspan bench stability --seed {} --case {}{options}", campaign.seed, case.number).into(),
            checked.reason.lines().next().unwrap_or("").into(),
        ]);
    }
    table
}

fn severity(class: Class) -> u32 {
    match class {
        Class::Panicked => 6,
        Class::NotFinite => 5,
        Class::Wrong => 4,
        Class::NotAtRest => 3,
        Class::OverBudget => 2,
        Class::Refused => 1,
        Class::Right | Class::Unchecked | Class::NoLoadBearingContacts => 0,
    }
}

/// Compares two cases of one severity.
fn badness(one: &Outcome, checked: &Checked, other: &Outcome, other_checked: &Checked) -> Ordering {
    let gap = |checked: &Checked| if checked.gap.is_nan() { 0.0 } else { checked.gap };
    let by_gap =
        if checked.class == Class::Wrong { gap(checked).total_cmp(&gap(other_checked)) } else { Ordering::Equal };
    by_gap.then(one.not_at_rest().cmp(&other.not_at_rest())).then(one.slowest().cmp(&other.slowest()))
}
