use super::Claim;
use std::panic::catch_unwind;

/// The message of the assertion that fails; empty if none does.
fn failure(statement: impl FnOnce() + std::panic::UnwindSafe) -> String {
    match catch_unwind(statement) {
        Ok(()) => String::new(),
        Err(panic) => panic.downcast_ref::<String>().cloned().unwrap_or_else(|| "?".to_owned()),
    }
}

fn claim() -> Claim<'static> {
    Claim::of("X-1", "quantity")
}

#[test]
fn numbers_within_their_tolerance_pass_and_others_fail() {
    claim().value(1.01, 1.0).within(0.02);
    claim().value(-101.0, -100.0).within(0.02);
    claim().value(0.0, 0.0).within(0.0);
    claim().value(101.0, 100.0).within_absolute(1.5);
    claim().error(1e-3).within(1e-3);
    claim().value(1.03, 1.0).missed_up_to(0.04).within(0.02);
    assert!(failure(|| claim().value(1.03, 1.0).within(0.02)).contains("X-1: quantity: error"));
    assert!(!failure(|| claim().value(101.0, 100.0).within_absolute(0.5)).is_empty());
    assert!(!failure(|| claim().error(-2e-3).within(1e-3)).is_empty());
    assert!(!failure(|| claim().value(1.05, 1.0).missed_up_to(0.04).within(0.02)).is_empty());
    // A relative tolerance about zero accepts nothing else.
    assert!(!failure(|| claim().value(1e-300, 0.0).within(0.5)).is_empty());
}

#[test]
fn ranges_and_conditions() {
    claim().number(1.0).between(1.0, 2.0);
    claim().number(2.0).at_most(2.0);
    claim().number(2.0).at_least(2.0);
    claim().number(2.1).missed_up_to(0.2).between(1.0, 2.0);
    claim().holds(true);
    assert!(failure(|| claim().number(2.1).between(1.0, 2.0)).contains("1e0 to 2e0"));
    assert!(failure(|| claim().number(2.1).at_most(2.0)).contains("at most 2e0"));
    assert!(failure(|| claim().number(1.9).at_least(2.0)).contains("at least 2e0"));
    assert!(!failure(|| claim().number(2.3).missed_up_to(0.2).between(1.0, 2.0)).is_empty());
    assert!(!failure(|| claim().number(f64::NAN).missed_up_to(0.2).between(1.0, 2.0)).is_empty());
    assert!(!failure(|| claim().holds(false)).is_empty());
}

#[test]
fn what_is_not_a_number_fails_whatever_the_tolerance() {
    assert!(!failure(|| claim().value(f64::NAN, 1.0).within(f64::INFINITY)).is_empty());
    assert!(!failure(|| claim().error(f64::NAN).within(f64::INFINITY)).is_empty());
    assert!(!failure(|| claim().value(1.0, f64::INFINITY).within(0.5)).is_empty());
    assert!(!failure(|| claim().number(f64::NAN).between(f64::NEG_INFINITY, f64::INFINITY)).is_empty());
    assert!(!failure(|| claim().number(f64::NAN).at_most(1.0)).is_empty());
}
