//! Their number, ours, the difference, and whether it is within the tolerance: the table that figures and studies share.

use crate::exit::{Exit, Failure};
use charts::short;
use std::borrow::Cow;

/// What a number of ours is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Theirs {
    /// A number.
    Value(f64),
    /// Any number between two.
    Between(f64, f64),
    /// Nothing: the source gives a trend or no number.
    Nothing,
}

/// Largest difference that counts as agreement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tolerance {
    /// In the unit of the quantity.
    Absolute(f64),
    /// As a share of their number.
    Relative(f64),
    /// None: the quantity is reported.
    Nothing,
}

/// One row of the comparison.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Comparison {
    quantity: String,
    unit: &'static str,
    theirs: Theirs,
    source: Cow<'static, str>,
    ours: f64,
    tolerance: Tolerance,
}

impl Comparison {
    /// A row; `source` says where their number comes from.
    pub(super) fn new(
        quantity: impl Into<String>,
        unit: &'static str,
        theirs: Theirs,
        source: impl Into<Cow<'static, str>>,
        ours: f64,
        tolerance: Tolerance,
    ) -> Self {
        Self { quantity: quantity.into(), unit, theirs, source: source.into(), ours, tolerance }
    }

    /// A condition of ours that has to hold, such as an order of curves: 1 if it does.
    pub(super) fn holds(quantity: impl Into<String>, source: &'static str, holds: bool) -> Self {
        let ours = if holds { 1.0 } else { 0.0 };
        Self::new(quantity, "yes = 1", Theirs::Value(1.0), source, ours, Tolerance::Absolute(0.0))
    }

    /// A number of ours that is reported without a published one.
    pub(super) fn reported(quantity: impl Into<String>, unit: &'static str, ours: f64) -> Self {
        Self::new(quantity, unit, Theirs::Nothing, "", ours, Tolerance::Nothing)
    }

    /// What is compared.
    pub(super) fn quantity(&self) -> &str {
        &self.quantity
    }

    /// Ours minus theirs; from a range the distance to it; NaN without a number of theirs.
    fn difference(&self) -> f64 {
        match self.theirs {
            Theirs::Value(value) => self.ours - value,
            Theirs::Between(low, high) => self.ours - nearest(self.ours, low, high),
            Theirs::Nothing => f64::NAN,
        }
    }

    /// Whether the difference is within the tolerance; `None` where there is none.
    fn met(&self) -> Option<bool> {
        let largest = match (self.tolerance, self.theirs) {
            (Tolerance::Nothing, _) | (_, Theirs::Nothing) => return None,
            (Tolerance::Absolute(largest), _) => largest,
            (Tolerance::Relative(share), Theirs::Value(value)) => share * value.abs(),
            // Of the end of the range that is passed.
            (Tolerance::Relative(share), Theirs::Between(low, high)) => share * nearest(self.ours, low, high).abs(),
        };
        Some(self.ours.is_finite() && self.difference().abs() <= largest)
    }

    fn theirs_text(&self) -> String {
        match self.theirs {
            Theirs::Value(value) => short(value),
            Theirs::Between(low, high) => format!("{} to {}", short(low), short(high)),
            Theirs::Nothing => String::new(),
        }
    }

    fn tolerance_text(&self) -> String {
        match self.tolerance {
            Tolerance::Absolute(largest) => short(largest),
            Tolerance::Relative(share) => format!("{} %", short(100.0 * share)),
            Tolerance::Nothing => String::new(),
        }
    }

    fn cells(&self) -> [String; 8] {
        let met = self.met().map_or("", |met| if met { "yes" } else { "no" });
        let difference =
            if matches!(self.theirs, Theirs::Nothing) { String::new() } else { short(self.difference()) };
        [
            self.quantity.clone(),
            self.unit.to_owned(),
            self.theirs_text(),
            self.source.clone().into_owned(),
            short(self.ours),
            difference,
            self.tolerance_text(),
            met.to_owned(),
        ]
    }
}

/// The number between two bounds, in either order, that is next to a value; NaN where one of the bounds is.
fn nearest(value: f64, one: f64, other: f64) -> f64 {
    if one.is_nan() || other.is_nan() { f64::NAN } else { value.clamp(one.min(other), one.max(other)) }
}

/// Columns of the table.
pub(super) const HEADER: [&str; 8] =
    ["quantity", "unit", "theirs", "source", "ours", "difference", "tolerance", "met"];

/// The rows as CSV.
///
/// # Errors
/// The rows cannot be encoded.
pub(super) fn comparison_csv(rows: &[Comparison]) -> Result<Vec<u8>, Failure> {
    let unusable = |problem: String| Failure::new(Exit::BadInput, format!("the table cannot be written: {problem}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(HEADER).map_err(|error| unusable(error.to_string()))?;
    for row in rows {
        writer.write_record(row.cells()).map_err(|error| unusable(error.to_string()))?;
    }
    writer.into_inner().map_err(|error| unusable(error.to_string()))
}

/// The rows for the screen.
pub(super) fn comparison_text(rows: &[Comparison]) -> String {
    let cells: Vec<[String; 8]> =
        std::iter::once(HEADER.map(str::to_owned)).chain(rows.iter().map(Comparison::cells)).collect();
    let shown = [0, 1, 2, 4, 5, 6, 7];
    let widths = shown.map(|column| cells.iter().map(|row| row[column].chars().count()).max().unwrap_or(0));
    let mut text = String::new();
    for row in &cells {
        for (column, width) in shown.iter().zip(widths) {
            text.push_str(&format!("{:<width$}  ", row[*column]));
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_tell_difference_and_whether_the_tolerance_is_met() {
        let row = |theirs, ours, tolerance| Comparison::new("peak", "-", theirs, "[Liu2018]", ours, tolerance);
        let near = row(Theirs::Value(0.39), 0.40, Tolerance::Absolute(0.03));
        assert_eq!((near.met(), short(near.difference())), (Some(true), "0.01000".to_owned()));
        assert_eq!(row(Theirs::Value(0.39), 0.45, Tolerance::Relative(0.1)).met(), Some(false));
        let outside = row(Theirs::Between(13.0, 16.0), 18.0, Tolerance::Absolute(1.0));
        assert_eq!((outside.met(), outside.difference()), (Some(false), 2.0));
        assert_eq!(row(Theirs::Between(13.0, 16.0), 14.0, Tolerance::Absolute(0.0)).met(), Some(true));
        assert_eq!(row(Theirs::Between(1.0, 16.0), 0.8, Tolerance::Relative(0.1)).met(), Some(false));
        assert_eq!(row(Theirs::Value(1.0), f64::NAN, Tolerance::Absolute(9.0)).met(), Some(false));
        // Computed bounds may come in either order, or not at all.
        assert_eq!(row(Theirs::Between(16.0, 13.0), 18.0, Tolerance::Absolute(1.0)).difference(), 2.0);
        assert_eq!(row(Theirs::Between(f64::NAN, 1.0), 0.5, Tolerance::Absolute(9.0)).met(), Some(false));
        assert_eq!(row(Theirs::Between(1.0, f64::NAN), 0.5, Tolerance::Relative(9.0)).met(), Some(false));
        assert_eq!(Comparison::reported("wall time", "s", 3.0).met(), None);
        let csv = String::from_utf8(comparison_csv(&[near]).unwrap()).unwrap();
        assert_eq!(csv.lines().nth(1).unwrap(), "peak,-,0.3900,[Liu2018],0.4000,0.01000,0.03000,yes");
    }
}
