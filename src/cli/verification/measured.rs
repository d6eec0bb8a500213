//! What tests have measured: the committed table, and how records of tests become rows of it.

use super::pages::command;
use super::rows::{Entry, Row, Source, unusable};
use crate::exit::Failure;
use charts::short;
use claims::{Kind, Record};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// One quantity of an entry, at its worst.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Measured {
    entry: String,
    quantity: String,
    expected: String,
    measured: String,
    error: String,
    tolerance: String,
    met: String,
    /// How often tests have stated it.
    statements: usize,
    /// Source file of the test.
    file: String,
    date: String,
    commit: String,
    processor: String,
}

/// When and where a record was made.
pub(super) struct Occasion {
    pub(super) date: String,
    pub(super) commit: String,
    pub(super) processor: String,
}

/// The committed table.
pub(super) fn table(root: &Path) -> PathBuf {
    root.join("docs/reference/verification-measured.csv")
}

/// The rows of the committed table; none if there is no table.
///
/// # Errors
/// It cannot be read.
pub(super) fn read(root: &Path) -> Result<Vec<Measured>, Failure> {
    let file = table(root);
    if !file.exists() {
        return Ok(Vec::new());
    }
    let mut reader = csv::Reader::from_path(&file).map_err(|error| unusable(&file, error))?;
    reader.deserialize().map(|row| row.map_err(|error| unusable(&file, error))).collect()
}

/// The table as CSV.
///
/// # Errors
/// The rows cannot be encoded.
pub(super) fn encoded(rows: &[Measured]) -> Result<Vec<u8>, Failure> {
    let file = Path::new("the table");
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(|error| unusable(file, error))?;
    }
    writer.into_inner().map_err(|error| unusable(file, error))
}

/// The table with what was measured now: all rows of the files that occur in the records are new, those of others stay. In the order of the
/// catalogue.
pub(super) fn updated(
    old: Vec<Measured>,
    records: &[Record],
    entries: &[Entry],
    occasion: &Occasion,
) -> Vec<Measured> {
    let files: BTreeSet<&str> = records.iter().map(|record| record.file.as_str()).collect();
    let mut worst: BTreeMap<(&str, &str), (&Record, usize)> = BTreeMap::new();
    for record in records {
        let (kept, statements) = worst.entry((&record.entry, &record.quantity)).or_insert((record, 0));
        *statements += 1;
        // A miss is worse than any number that is met; equal ones by their text, so that the order of the records does not matter.
        let rank =
            |one: &Record| (!one.met, one.badness, one.measured.clone(), one.expected.clone(), one.file.clone());
        if rank(record).partial_cmp(&rank(kept)) == Some(std::cmp::Ordering::Greater) {
            *kept = record;
        }
    }
    // A quantity that has moved to another file is the new one.
    let is_new = |row: &Measured| worst.contains_key(&(row.entry.as_str(), row.quantity.as_str()));
    let is_known = |row: &Measured| entries.iter().any(|entry| entry.id == row.entry);
    let stay: Vec<Measured> =
        old.into_iter().filter(|row| !files.contains(row.file.as_str()) && !is_new(row) && is_known(row)).collect();
    let new = worst.into_values().map(|(record, statements)| Measured::of(record, statements, occasion));
    let mut rows: Vec<Measured> = stay.into_iter().chain(new).collect();
    let place = |row: &Measured| entries.iter().position(|entry| entry.id == row.entry);
    rows.sort_by_cached_key(|row| (place(row).unwrap_or(usize::MAX), row.quantity.clone()));
    rows
}

impl Measured {
    fn of(record: &Record, statements: usize, occasion: &Occasion) -> Self {
        let [expected, measured, error, tolerance] = match record.kind {
            Kind::Relative => [
                number(&record.expected),
                number(&record.measured),
                format!("relative {}", number(&record.error)),
                format!("relative {}", number(&record.tolerance)),
            ],
            Kind::Absolute if record.expected.is_empty() => {
                ["0".to_owned(), number(&record.error), number(&record.error), number(&record.tolerance)]
            }
            Kind::Absolute => {
                [&record.expected, &record.measured, &record.error, &record.tolerance].map(|text| number(text))
            }
            Kind::Range => [
                record.expected.split(' ').map(number).collect::<Vec<_>>().join(" "),
                number(&record.measured),
                String::new(),
                "range".to_owned(),
            ],
            Kind::Condition => [record.expected.clone(), record.measured.clone(), String::new(), "exact".to_owned()],
        };
        let met = if record.met { "yes" } else { "no" }.to_owned();
        let Occasion { date, commit, processor } = occasion;
        Self {
            entry: record.entry.clone(),
            quantity: record.quantity.clone(),
            expected,
            measured,
            error,
            tolerance,
            met,
            statements,
            file: record.file.clone(),
            date: date.clone(),
            commit: commit.clone(),
            processor: processor.clone(),
        }
    }

    /// A row of the page, with the command that repeats it and what its entry is compared with.
    pub(super) fn source(&self, entries: &[Entry]) -> Source {
        let reference = entries.iter().find(|entry| entry.id == self.entry).map(|entry| entry.reference.clone());
        let quantity = match self.statements {
            1 => self.quantity.clone(),
            count if self.tolerance == "exact" => format!("{}; {count} times", self.quantity),
            count => format!("{}; the worst of {count}", self.quantity),
        };
        Source {
            origin: "tests".to_owned(),
            command: command(&format!("`{}`", self.file)),
            date: self.date.clone(),
            processor: self.processor.clone(),
            commit: self.commit.clone(),
            rows: vec![Row {
                entries: vec![self.entry.clone()],
                quantity,
                theirs: self.expected.clone(),
                source: reference.unwrap_or_default(),
                ours: self.measured.clone(),
                difference: self.error.clone(),
                tolerance: self.tolerance.clone(),
                met: self.met.clone(),
            }],
        }
    }
}

/// A number with four digits; other text as it is.
fn number(text: &str) -> String {
    text.parse().map_or_else(|_| text.to_owned(), short)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(quantity: &str, badness: f64, met: bool, file: &str) -> Record {
        Record {
            entry: "X-2".to_owned(),
            quantity: quantity.to_owned(),
            kind: Kind::Relative,
            expected: "2e0".to_owned(),
            measured: format!("{:e}", 2.0 * (1.0 + badness)),
            error: format!("{badness:e}"),
            tolerance: "1e-2".to_owned(),
            met,
            badness,
            file: file.to_owned(),
        }
    }

    fn at(date: &str) -> Occasion {
        Occasion { date: date.to_owned(), commit: "abc".to_owned(), processor: "P".to_owned() }
    }

    #[test]
    fn a_quantity_is_recorded_at_its_worst_and_files_that_were_not_run_keep_their_rows() {
        let entry = |id: &str| Entry {
            id: id.to_owned(),
            claim: String::new(),
            reference: String::new(),
            tolerance: String::new(),
            tested_in: String::new(),
        };
        let entries = [entry("X-1"), entry("X-2")];
        let first = [
            record("force", 1e-3, true, "a/src/b.rs"),
            record("force", 5e-3, true, "a/src/b.rs"),
            record("speed", 1e-4, true, "a/src/b.rs"),
            record("wave", 2e-3, true, "a/src/c.rs"),
        ];
        let rows = updated(Vec::new(), &first, &entries, &at("2026-01-01"));
        let shown = |row: &Measured| (row.quantity.clone(), row.error.clone(), row.statements, row.date.clone());
        let old = "2026-01-01".to_owned();
        assert_eq!(
            rows.iter().map(shown).collect::<Vec<_>>(),
            [
                ("force".to_owned(), "relative 0.005000".to_owned(), 2, old.clone()),
                ("speed".to_owned(), "relative 1.000e-4".to_owned(), 1, old.clone()),
                ("wave".to_owned(), "relative 0.002000".to_owned(), 1, old.clone()),
            ]
        );
        let backwards: Vec<Record> = first.iter().rev().cloned().collect();
        assert_eq!(updated(Vec::new(), &backwards, &entries, &at("2026-01-01")), rows);
        // A quantity that its file no longer states goes; a miss is the worst whatever its number.
        let mut second = vec![record("force", 4e-3, true, "a/src/b.rs"), record("force", 1e-3, false, "a/src/b.rs")];
        second.push(Record { entry: "X-1".to_owned(), ..record("first", 0.0, true, "a/src/b.rs") });
        let rows = updated(rows, &second, &entries, &at("2026-02-02"));
        let shown: Vec<_> =
            rows.iter().map(|row| (row.quantity.as_str(), row.met.as_str(), row.date.as_str())).collect();
        assert_eq!(
            shown,
            [("first", "yes", "2026-02-02"), ("force", "no", "2026-02-02"), ("wave", "yes", "2026-01-01")]
        );
        let moved = updated(rows.clone(), &[record("force", 2e-3, true, "a/src/d.rs")], &entries, &at("2026-03-03"));
        let force: Vec<_> = moved.iter().filter(|row| row.quantity == "force").collect();
        assert_eq!((force.len(), force[0].file.as_str(), force[0].met.as_str()), (1, "a/src/d.rs", "yes"));
        let source = rows[1].source(&entries);
        assert_eq!(source.command, "cargo test --release -p grainspan-a b");
        assert_eq!(
            (source.rows[0].quantity.as_str(), source.rows[0].theirs.as_str()),
            ("force; the worst of 2", "2.000")
        );
    }

    #[test]
    fn ranges_errors_and_conditions_are_told_in_words() {
        let of = |kind, [expected, measured, error, tolerance]: [&str; 4]| {
            let texts = [expected, measured, error, tolerance].map(str::to_owned);
            let [expected, measured, error, tolerance] = texts;
            let record =
                Record { kind, expected, measured, error, tolerance, ..record("q", 0.0, true, "a/src/b.rs") };
            let row = Measured::of(&record, 1, &at("2026-01-01"));
            [row.expected, row.measured, row.error, row.tolerance]
        };
        assert_eq!(of(Kind::Range, ["1e0 to 2e0", "1.5e0", "0e0", ""]), ["1.000 to 2.000", "1.500", "", "range"]);
        assert_eq!(of(Kind::Range, ["at most 5e1", "4e0", "0e0", ""])[0], "at most 50.00");
        assert_eq!(of(Kind::Absolute, ["", "", "3e-13", "1e-12"]), ["0", "3.000e-13", "3.000e-13", "1.000e-12"]);
        assert_eq!(of(Kind::Condition, ["yes", "yes", "", ""]), ["yes", "yes", "", "exact"]);
    }
}
