//! A worker that is broken or means harm cannot make the macro believe anything; the long hunt is
//! `cargo run --release -p grainspan-macro-solver --example broken_replies`.

mod hostile;

use hostile::{Manner, hunt};

#[test]
fn damaged_replies_are_never_believed_and_each_is_counted_once() {
    let found = hunt(Manner::Damaged, 1, 20_000);
    assert_eq!(found.counted(), found.sent);
    assert!(found.refused > 1000 && found.faulty > 1000 && found.late + found.unknown > 50, "{found:?}");
}

#[test]
fn hostile_replies_neither_panic_the_macro_nor_pass_its_checks() {
    let found = hunt(Manner::Hostile, 2, 20_000);
    assert!(found.faulty > 5000 && found.missed > 100 && found.unknown > 100 && found.late > 100, "{found:?}");
}
