//! Assertions of tests about entries of the verification catalogue, and a record of what they measured.
//!
//! A test that establishes an entry, such as `B-5`, states what it compares, with what and how closely:
//!
//! ```
//! use claims::Claim;
//!
//! let (computed, closed_form) = (2.718_281, std::f64::consts::E);
//! Claim::of("X-1", "base of the natural logarithm").value(computed, closed_form).within(1e-6);
//! Claim::of("X-1", "largest error of a field").error(3e-13).within(1e-12);
//! Claim::of("X-1", "order of convergence").value(1.97, 2.0).within_absolute(0.1);
//! Claim::of("X-1", "largest eigenvalue").number(0.4).between(f64::NEG_INFINITY, 1.0);
//! Claim::of("X-1", "the same bits in any order").holds(true);
//! ```
//!
//! A number outside its tolerance fails the test, as `assert!` does. Where the environment variable [`FOLDER`] names a folder, every
//! statement also leaves a line in a table there; `grainspan verification --measured FOLDER` makes the committed table of them.

mod record;

pub use record::{FOLDER, Kind, Record, read};

use std::panic::Location;

/// What a test states about one quantity of an entry.
#[derive(Clone, Copy, Debug)]
#[must_use = "a claim asserts nothing before it has a tolerance"]
pub struct Claim<'a> {
    entry: &'a str,
    quantity: &'a str,
}

impl<'a> Claim<'a> {
    /// A claim about `quantity` of the catalogue's `entry`. A quantity that is stated more than once is recorded at its worst, so that a
    /// loop over cases may state it in every turn.
    pub fn of(entry: &'a str, quantity: &'a str) -> Self {
        Self { entry, quantity }
    }

    /// A number and the one that it should be.
    pub fn value(self, measured: f64, expected: f64) -> Compared<'a> {
        self.compared(Some(measured), Some(expected), (measured - expected).abs(), expected.abs())
    }

    /// An error that the test has computed, such as a norm over a field or a relative difference.
    pub fn error(self, error: f64) -> Compared<'a> {
        self.compared(None, None, error.abs(), 1.0)
    }

    /// A number that should lie in a range.
    pub fn number(self, measured: f64) -> Ranged<'a> {
        Ranged { claim: self, measured, bound: 0.0 }
    }

    /// A condition that is exact, such as equal bits.
    ///
    /// # Panics
    /// It does not hold.
    #[track_caller]
    pub fn holds(self, holds: bool) {
        let place = Location::caller();
        self.record(place, Kind::Condition, ["yes".to_owned(), yes(holds), String::new(), String::new()], holds, 0.0);
        assert!(holds, "{}: {} does not hold", self.entry, self.quantity);
    }

    fn compared(self, measured: Option<f64>, expected: Option<f64>, error: f64, scale: f64) -> Compared<'a> {
        Compared { claim: self, measured, expected, error, scale, bound: None }
    }

    fn record(
        &self,
        place: &Location<'_>,
        kind: Kind,
        [expected, measured, error, tolerance]: [String; 4],
        met: bool,
        badness: f64,
    ) {
        record::append(&Record {
            entry: self.entry.to_owned(),
            quantity: self.quantity.to_owned(),
            kind,
            expected,
            measured,
            error,
            tolerance,
            met,
            badness,
            file: place.file().to_owned(),
        });
    }
}

fn yes(holds: bool) -> String {
    if holds { "yes" } else { "no" }.to_owned()
}

fn text(number: Option<f64>) -> String {
    number.map_or_else(String::new, |number| format!("{number:e}"))
}

/// A claim that has been compared and waits for its tolerance.
#[derive(Clone, Copy, Debug)]
#[must_use = "a claim asserts nothing before it has a tolerance"]
pub struct Compared<'a> {
    claim: Claim<'a>,
    measured: Option<f64>,
    expected: Option<f64>,
    error: f64,
    /// What a relative tolerance is a share of.
    scale: f64,
    /// Error that the test accepts in place of the tolerance.
    bound: Option<f64>,
}

impl Compared<'_> {
    /// The entry's tolerance is known to be missed: the test fails only above `bound`, in the terms of the tolerance, and the record says
    /// that the claim is not met. The lab book has the reason.
    pub fn missed_up_to(self, bound: f64) -> Self {
        Self { bound: Some(bound), ..self }
    }

    /// States a tolerance relative to the expected number, or the tolerance of an error that the test has computed.
    ///
    /// # Panics
    /// The error is above it, or not a number.
    #[track_caller]
    pub fn within(self, tolerance: f64) {
        let kind = if self.expected.is_some() { Kind::Relative } else { Kind::Absolute };
        self.state(Location::caller(), kind, tolerance, self.scale);
    }

    /// States a tolerance in the unit of the quantity.
    ///
    /// # Panics
    /// The error is above it, or not a number.
    #[track_caller]
    pub fn within_absolute(self, tolerance: f64) {
        self.state(Location::caller(), Kind::Absolute, tolerance, 1.0);
    }

    #[track_caller]
    fn state(self, place: &Location<'_>, kind: Kind, tolerance: f64, scale: f64) {
        let Self { claim, measured, expected, error, bound, .. } = self;
        // Two infinite numbers are no agreement, whatever the tolerance.
        let met = error.is_finite() && error <= tolerance * scale;
        let shown = match (kind, measured, expected) {
            (Kind::Relative, ..) if scale > 0.0 => error / scale,
            (Kind::Absolute, Some(measured), Some(expected)) => measured - expected,
            _ => error,
        };
        // How near it is to failing, so that cases with other tolerances and expected numbers can be told apart.
        let badness = if tolerance * scale > 0.0 { error / (tolerance * scale) } else { error };
        let cells = [text(expected), text(measured), text(Some(shown)), text(Some(tolerance))];
        claim.record(place, kind, cells, met, if badness.is_nan() { f64::INFINITY } else { badness });
        let accepted = bound.unwrap_or(tolerance) * scale;
        assert!(
            error.is_finite() && error <= accepted,
            "{}: {}: error {error:e} is above {accepted:e}{}",
            claim.entry,
            claim.quantity,
            match (measured, expected) {
                (Some(measured), Some(expected)) => format!(": {measured:e} for {expected:e}"),
                _ => String::new(),
            }
        );
    }
}

/// A number that waits for its range.
#[derive(Clone, Copy, Debug)]
#[must_use = "a claim asserts nothing before it has a range"]
pub struct Ranged<'a> {
    claim: Claim<'a>,
    measured: f64,
    /// Distance from the range that the test accepts.
    bound: f64,
}

impl Ranged<'_> {
    /// The entry's range is known to be missed: the test fails only where the number is further from it than `bound`, and the record
    /// says that the claim is not met. The lab book has the reason.
    pub fn missed_up_to(self, bound: f64) -> Self {
        Self { bound, ..self }
    }

    /// States that the number is not above a limit.
    ///
    /// # Panics
    /// It is, or is not a number.
    #[track_caller]
    pub fn at_most(self, limit: f64) {
        self.state(Location::caller(), f64::NEG_INFINITY, limit);
    }

    /// States that the number is not below a limit.
    ///
    /// # Panics
    /// It is, or is not a number.
    #[track_caller]
    pub fn at_least(self, limit: f64) {
        self.state(Location::caller(), limit, f64::INFINITY);
    }

    /// States a range, its ends included.
    ///
    /// # Panics
    /// The number lies outside, or is not a number.
    #[track_caller]
    pub fn between(self, low: f64, high: f64) {
        self.state(Location::caller(), low, high);
    }

    #[track_caller]
    fn state(self, place: &Location<'_>, low: f64, high: f64) {
        let Self { claim, measured, bound } = self;
        let met = (low..=high).contains(&measured);
        let outside = if met { 0.0 } else { (low - measured).max(measured - high) };
        // Within the range the number that is nearest to its end is the worst.
        let badness = (low - measured).max(measured - high);
        let range = match (low.is_finite(), high.is_finite()) {
            (true, true) => format!("{low:e} to {high:e}"),
            (true, false) => format!("at least {low:e}"),
            _ => format!("at most {high:e}"),
        };
        let cells = [range.clone(), text(Some(measured)), text(Some(outside)), String::new()];
        claim.record(place, Kind::Range, cells, met, if badness.is_nan() { f64::INFINITY } else { badness });
        assert!(
            met || outside <= bound && bound > 0.0,
            "{}: {}: {measured:e} is not in the range: {range}",
            claim.entry,
            claim.quantity
        );
    }
}

#[cfg(test)]
mod tests;
