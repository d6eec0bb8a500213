//! Increments that end out of balance: each with its reason.
//!
//! The reason of a case is found by experiment: it is run again without one thing after the other until all its increments come to
//! rest. What the single increments end at is told beside it.

use super::campaign::Campaign;
use super::check::{ALLOWANCE, Checked, Subject};
use super::outcome::{Class, Increment, Outcome, VANISHED, run};
use crate::report::Report;
use crate::table::Table;
use protocol::TrialFlags;
use rve_server::definition::{Accuracy, Damping, RveOptions};
use rve_server::programs::rve_test::ElementTest;

/// What it shows if all increments come to rest with a change of the test, and the change.
type Experiment = (&'static str, Change);

/// `None` where the test has nothing to change.
type Change = fn(&ElementTest) -> Option<ElementTest>;

/// In the order in which they are tried.
const EXPERIMENTS: [Experiment; 7] = [
    ("contact viscosity throws grains to and fro; at rest without it", without_viscosity),
    ("cohesion pulls contacts shut that the rest pulls open; at rest without it", without_cohesion),
    ("a limit cycle of the damping; at rest with damping = \"adaptive\"", with_adaptive),
    ("a limit cycle of the damping; at rest with damping = \"viscous\"", with_viscous),
    ("the cell is on its way when the steps are used up; at rest with ten times max_steps", with_more_steps),
    ("contacts that open and close, or slide, at ten times the tolerance; at rest with that", with_ten_tolerances),
    ("slow modes that a tight tolerance waits for; at rest with the default tolerance", with_default_tolerance),
];

fn without_viscosity(test: &ElementTest) -> Option<ElementTest> {
    let mut changed = test.clone();
    changed.contact.damping = 0.0;
    (test.contact.damping > 0.0).then_some(changed)
}

fn without_cohesion(test: &ElementTest) -> Option<ElementTest> {
    let mut changed = test.clone();
    changed.contact.cohesion = 0.0;
    (test.contact.cohesion > 0.0).then_some(changed)
}

fn with_adaptive(test: &ElementTest) -> Option<ElementTest> {
    with_damping(test, Damping::Adaptive)
}

fn with_viscous(test: &ElementTest) -> Option<ElementTest> {
    with_damping(test, Damping::Viscous)
}

fn with_damping(test: &ElementTest, damping: Damping) -> Option<ElementTest> {
    let changed = ElementTest { rve: RveOptions { damping, ..test.rve.clone() }, ..test.clone() };
    (test.rve.damping != damping).then_some(changed)
}

fn with_more_steps(test: &ElementTest) -> Option<ElementTest> {
    let max_steps = Some(test.rve.max_steps().saturating_mul(10));
    Some(ElementTest { rve: RveOptions { max_steps, ..test.rve.clone() }, ..test.clone() })
}

fn with_ten_tolerances(test: &ElementTest) -> Option<ElementTest> {
    let rve = RveOptions {
        accuracy: Accuracy::Default,
        error: None,
        strain_per_step: Some(test.rve.strain_per_step()),
        tolerance: Some(10.0 * test.rve.tolerance()),
        ..test.rve.clone()
    };
    Some(ElementTest { rve, ..test.clone() })
}

fn with_default_tolerance(test: &ElementTest) -> Option<ElementTest> {
    let tolerance = RveOptions::default().tolerance();
    let rve = RveOptions {
        accuracy: Accuracy::Default,
        error: None,
        strain_per_step: Some(test.rve.strain_per_step()),
        tolerance: Some(tolerance),
        ..test.rve.clone()
    };
    (tolerance > 10.0 * test.rve.tolerance()).then(|| ElementTest { rve, ..test.clone() })
}

/// Why increments of a case are not at rest.
pub(super) fn reason(subject: &Subject<'_>) -> String {
    let Subject { test, slot, packing, outcome } = *subject;
    let restless = outcome.not_at_rest();
    let unloaded = outcome.not_at_rest_unloaded(slot.dimension);
    let worst = restless_of(outcome).map(|(_, one)| one.unbalanced).fold(0.0, f64::max) / test.rve.tolerance();
    let cause = if restless == unloaded {
        "no pressure is left: the forces are rounding".to_owned()
    } else {
        experiments(
            |change| {
                let outcome = run(&change(test)?, slot, packing, ALLOWANCE);
                let is_whole =
                    matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts | Class::NotAtRest);
                is_whole.then(|| outcome.not_at_rest())
            },
            restless,
        )
    };
    format!("{restless} increments up to {worst:.3} times the tolerance: {cause}")
}

/// The first experiment that leaves no increment out of balance, or the one that leaves the fewest if that is at most half. `left` says how
/// many one leaves.
fn experiments(left: impl Fn(Change) -> Option<usize>, restless: usize) -> String {
    let mut best: Option<(usize, &str)> = None;
    for (name, change) in EXPERIMENTS {
        match left(change) {
            Some(0) => return name.to_owned(),
            Some(count) if 2 * count <= restless && best.is_none_or(|(least, _)| count < least) => {
                best = Some((count, name));
            }
            _ => {}
        }
    }
    best.map_or_else(
        || "not found: none of the experiments halves their number".to_owned(),
        |(count, name)| format!("mostly {name} but for {count}"),
    )
}

/// Increments that are not at rest, with their numbers.
fn restless_of(outcome: &Outcome) -> impl Iterator<Item = (usize, &Increment)> {
    let is_restless = |(_, one): &(usize, &Increment)| one.flags.contains(TrialFlags::NOT_EQUILIBRATED);
    outcome.increments.iter().enumerate().filter(is_restless)
}

/// Writes `restless.csv`: a row per increment that is not at rest.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write(
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
        "increment",
        "unbalanced_over_tolerance",
        "pressure_over_first",
        "coordination",
        "force_evaluations",
        "ended_by",
        "reason",
    ]);
    for ((case, outcome), checked) in campaign.cases.iter().zip(outcomes).zip(checks) {
        let slot = &campaign.slots[case.slot];
        for (number, one) in restless_of(outcome) {
            let share = one.pressure(slot.dimension) / outcome.increments[0].pressure(slot.dimension);
            let is_capped = one.evaluations >= u64::from(case.test.rve.max_steps());
            let ended_by = match share.abs() <= VANISHED {
                true => "no pressure",
                false if is_capped => "step cap",
                false => "no progress with any damping",
            };
            table.row([
                case.number.into(),
                case.range.name().into(),
                case.kind.name().into(),
                slot.name.as_str().into(),
                number.into(),
                (one.unbalanced / case.test.rve.tolerance()).into(),
                share.into(),
                one.coordination.into(),
                one.evaluations.into(),
                ended_by.into(),
                checked.reason.as_str().into(),
            ]);
        }
    }
    Ok(report.table("restless", "increments that are not at rest", &table)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_experiment_that_brings_all_to_rest_is_the_reason() {
        let with = |counts: [Option<usize>; 7]| {
            experiments(
                |change| counts[EXPERIMENTS.iter().position(|one| std::ptr::fn_addr_eq(one.1, change)).unwrap()],
                4,
            )
        };
        assert_eq!(with([None, Some(2), Some(0), Some(0), Some(1), Some(0), None]), EXPERIMENTS[2].0);
        assert!(
            with([None, Some(2), Some(3), Some(4), Some(1), Some(4), None])
                .starts_with("mostly the cell is on its way")
        );
        assert!(with([None, None, Some(3), Some(4), Some(4), Some(4), None]).starts_with("not found"));
    }
}
