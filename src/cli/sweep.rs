//! `grainspan element --sweep KEY=VALUES`: one test with many values of its keys, side by side on the cores, into one table.
//!
//! The rows come in the order of the values whatever ends first, so the table has the same bytes for any number of jobs.

use super::rve_test::{rows_in_words, shortfalls};
use crate::exit::{Exit, Failure};
use crate::side_by_side::{cores, side_by_side};
use crate::stderr::tell;
use crate::stdout::{deliver, expect_place};
use crate::workers::SignalWatch;
use macro_solver::pool::Interrupt;
use protocol::TangentKind;
use rve_server::definition::Packing;
use rve_server::programs::rve_test::{ElementTest, element_table};
use scene_reader::{Document, Kind, read_element_test};
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::Path;
use std::str::FromStr;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most tests of one sweep.
const MOST_TESTS: usize = 100_000;

/// One key and its values, as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sweep {
    key: String,
    values: Vec<String>,
}

impl FromStr for Sweep {
    type Err = String;

    /// `KEY=FIRST:LAST:COUNT` with evenly spaced numbers, or `KEY=VALUE,VALUE,...`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, values) = text
            .split_once('=')
            .filter(|(key, values)| !key.is_empty() && !values.is_empty())
            .ok_or("give KEY=FIRST:LAST:COUNT or KEY=VALUE,VALUE,..., such as contact.friction=0.1:0.7:7")?;
        let values = match values.split(':').collect::<Vec<_>>()[..] {
            [first, last, count] => spaced(first, last, count)?,
            [first, last] if [first, last].iter().all(|text| text.trim().parse::<f64>().is_ok()) => {
                return Err(format!(
                    "'{values}' lacks a number of values: give FIRST:LAST:COUNT, such as {values}:7"
                ));
            }
            // A text may be written as in the file; the table has what it says.
            _ => values.split(',').map(|value| value.trim().trim_matches(['"', '\'']).to_owned()).collect(),
        };
        if values.iter().any(String::is_empty) {
            return Err("a value is missing between two commas".to_owned());
        }
        if let Some(twice) =
            values.iter().enumerate().find_map(|(place, value)| values[..place].contains(value).then_some(value))
        {
            return Err(format!("the value {twice} is given twice"));
        }
        Ok(Self { key: key.trim().to_owned(), values })
    }
}

fn spaced(first: &str, last: &str, count: &str) -> Result<Vec<String>, String> {
    let number = |text: &str| {
        text.trim().parse::<f64>().ok().filter(|value| value.is_finite()).ok_or(format!("'{text}' is not a number"))
    };
    let (first, last) = (number(first)?, number(last)?);
    let count: usize = count.trim().parse().map_err(|_| format!("'{count}' is not a number of values"))?;
    match count {
        0 => Err("a sweep needs at least one value".to_owned()),
        1 if first != last => Err("one value cannot reach from one number to another".to_owned()),
        1 => Ok(vec![first.to_string()]),
        2..=MOST_TESTS => {
            // Rounded, so that 0.1 to 0.7 in steps of 0.1 reads like that.
            let value = |place: usize| first + (last - first) * place as f64 / (count - 1) as f64;
            let tidy = |value: f64| format!("{value:.12e}").parse::<f64>().unwrap_or(value).to_string();
            Ok((0..count).map(|place| tidy(value(place))).collect())
        }
        _ => Err(format!("at most {MOST_TESTS} values are taken")),
    }
}

/// What is the same for all tests of a sweep.
pub(super) struct Common<'a> {
    pub(super) path: &'a Path,
    pub(super) size: Option<&'a str>,
    pub(super) overrides: &'a [String],
    pub(super) tangent: TangentKind,
    pub(super) out: Option<&'a Path>,
    pub(super) units: bool,
    pub(super) jobs: Option<NonZeroUsize>,
    pub(super) quiet: bool,
}

/// How one test ended: its rows as CSV, in how many of them it fell short and how, and why it did not reach its end.
struct Ended {
    csv: Vec<u8>,
    warnings: Vec<(&'static str, u64)>,
    fallbacks: Vec<(&'static str, u64)>,
    stopped: Option<String>,
    /// Forces and moments of its packing that were not taken over, in words.
    listed_forces: Option<String>,
    /// A remark on its first segment.
    note: Option<String>,
}

/// Runs every combination of the values and writes one table: a column for each key, then those of the test.
///
/// # Errors
/// A test that is not sound (exit code 2; before any test has run where that can be seen, and then nothing is written); tests that stopped
/// before their end (exit code 1, all rows are written); a stop that was requested (exit code 130, likewise).
pub(super) fn run(common: &Common<'_>, sweeps: &[Sweep]) -> Result<Exit, Failure> {
    let combinations = combinations(sweeps);
    if combinations.len() > MOST_TESTS {
        return Err(Failure::new(
            Exit::BadInput,
            format!("{} tests are too many: at most {MOST_TESTS}", combinations.len()),
        ));
    }
    let mut keys = BTreeSet::new();
    if let Some(twice) = sweeps.iter().find(|sweep| !keys.insert(sweep.key.as_str())) {
        let text = format!("--sweep {}: the key is swept twice", twice.key);
        return Err(Failure::new(Exit::BadInput, format!("{text}\nhint: give all its values in one --sweep")));
    }
    check(common, sweeps, &combinations)?;
    let interrupt = SignalWatch::flag("the rows so far are written")?;
    let results = run_side_by_side(common, sweeps, &combinations, &interrupt);
    let found = Findings::of(sweeps, &combinations, results)?;
    let listed_forces = first_of(&found.listed_forces);
    let is_clean = found.warnings.is_empty() && found.fallbacks.is_empty() && listed_forces.is_none();
    if !(common.quiet || is_clean) {
        let in_words = |counts: &BTreeMap<&str, u64>| -> Vec<String> {
            counts.iter().map(|(what, rows)| format!("{what}: {}", rows_in_words(*rows))).collect()
        };
        let warnings = in_words(&found.warnings).into_iter().chain(listed_forces).collect();
        tell(shortfalls(warnings, in_words(&found.fallbacks)));
    }
    if let (Some(note), false) = (first_of(&found.notes), common.quiet) {
        tell(format_args!("note: {note}"));
    }
    // Tests none of which could begin have no table, and leave an earlier one alone.
    if found.started > 0 {
        deliver(common.out, &found.table)?;
    }
    let stopped = &found.stopped;
    if interrupt.is_raised() {
        let kept = stopped.iter().map(|reason| format!("\n{reason}")).collect::<String>();
        let text =
            format!("interrupted; the rows of {} of {} tests are written{kept}", found.started, combinations.len());
        return Err(Failure::new(Exit::Interrupted, text));
    }
    if stopped.is_empty() {
        return Ok(Exit::Done);
    }
    let (count, all) = (stopped.len(), combinations.len());
    let text = format!("{count} of {all} tests stopped before their end:\n{}", stopped.join("\n"));
    Err(Failure::new(found.exit, text))
}

/// The first of remarks of one kind, and how many tests more have one.
fn first_of(remarks: &[String]) -> Option<String> {
    let others =
        if remarks.len() > 1 { format!(" (so too in {} more tests)", remarks.len() - 1) } else { String::new() };
    remarks.first().map(|first| format!("{first}{others}"))
}

/// Runs the tests, as many at a time as there are jobs; `None` of those that a stop came before. Results in the order of the combinations.
fn run_side_by_side(
    common: &Common<'_>,
    sweeps: &[Sweep],
    combinations: &[Vec<&str>],
    interrupt: &Interrupt,
) -> Vec<Option<Result<Ended, Failure>>> {
    let order: Vec<usize> = (0..combinations.len()).collect();
    let done = AtomicUsize::new(0);
    side_by_side(&order, common.jobs.unwrap_or_else(cores), &|| !interrupt.is_raised(), &|place| {
        let ended = one(common, sweeps, &combinations[place], interrupt);
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if !common.quiet {
            tell(format_args!("{done} of {}: {}", combinations.len(), described(sweeps, &combinations[place])));
        }
        ended
    })
}

/// What all tests of a sweep have left.
struct Findings {
    /// One table as CSV: a column for each key, then those of the tests.
    table: Vec<u8>,
    /// Rows that fell short, by how.
    warnings: BTreeMap<&'static str, u64>,
    /// Rows that met their tolerances by a detour, by which.
    fallbacks: BTreeMap<&'static str, u64>,
    /// Which tests stopped before their end, and why.
    stopped: Vec<String>,
    /// Tests that have left their rows.
    started: usize,
    /// Remarks on first segments, each with its test.
    notes: Vec<String>,
    /// The same of forces and moments of packings that were not taken over.
    listed_forces: Vec<String>,
    /// How the program ends if some stopped.
    exit: Exit,
}

impl Findings {
    /// Puts the rows of all tests together.
    ///
    /// # Errors
    /// The table cannot be written.
    fn of(
        sweeps: &[Sweep],
        combinations: &[Vec<&str>],
        results: Vec<Option<Result<Ended, Failure>>>,
    ) -> Result<Self, Failure> {
        let unwritable = |error: &dyn std::fmt::Display| {
            Failure::new(Exit::BadInput, format!("the table cannot be written: {error}"))
        };
        let mut table = csv::Writer::from_writer(Vec::new());
        let mut found = Self {
            table: Vec::new(),
            warnings: BTreeMap::new(),
            fallbacks: BTreeMap::new(),
            stopped: Vec::new(),
            started: 0,
            notes: Vec::new(),
            listed_forces: Vec::new(),
            exit: Exit::NotConverged,
        };
        let mut has_header = false;
        for (values, ended) in combinations.iter().zip(results) {
            let ended = match ended {
                None => continue,
                Some(Ok(ended)) => ended,
                // What the other tests have found is not lost with this one.
                Some(Err(failure)) => {
                    found.exit = failure.exit;
                    found.stopped.push(format!("{}: {}", described(sweeps, values), failure.message));
                    continue;
                }
            };
            found.started += 1;
            for (what, rows) in ended.warnings {
                *found.warnings.entry(what).or_default() += rows;
            }
            for (what, rows) in ended.fallbacks {
                *found.fallbacks.entry(what).or_default() += rows;
            }
            let named = |text: String| format!("{}: {text}", described(sweeps, values));
            found.notes.extend(ended.note.map(named));
            found.listed_forces.extend(ended.listed_forces.map(named));
            if let Some(reason) = ended.stopped {
                found.stopped.push(format!("{}: {reason}", described(sweeps, values)));
            }
            let mut rows = csv::ReaderBuilder::new().has_headers(false).from_reader(&ended.csv[..]);
            for (number, row) in rows.records().enumerate() {
                let row = row.map_err(|error| unwritable(&error))?;
                let keys: Vec<&str> = match number {
                    0 if has_header => continue,
                    0 => sweeps.iter().map(|sweep| sweep.key.as_str()).collect(),
                    _ => values.clone(),
                };
                has_header = true;
                table.write_record(keys.into_iter().chain(row.iter())).map_err(|error| unwritable(&error))?;
            }
        }
        found.table = table.into_inner().map_err(|error| unwritable(&error))?;
        Ok(found)
    }
}

/// Combinations that are all read before any test runs.
const MOST_CHECKED: usize = 200;

/// Reads the tests before any of them runs: all combinations of a few, otherwise every value once. One that is not sound would cost time that
/// the others need not have waited for.
///
/// # Errors
/// A test that is not sound, or whose rows have other columns than those of the first.
fn check(common: &Common<'_>, sweeps: &[Sweep], combinations: &[Vec<&str>]) -> Result<(), Failure> {
    let each_value = sweeps.iter().enumerate().flat_map(|(key, sweep)| {
        let with = move |value| {
            let mut values = combinations[0].clone();
            values[key] = value;
            values
        };
        sweep.values.iter().map(move |value| with(value.as_str()))
    });
    let chosen: Vec<Vec<&str>> =
        if combinations.len() <= MOST_CHECKED { combinations.to_vec() } else { each_value.collect() };
    let mut first = None;
    let mut warned = BTreeSet::new();
    for values in &chosen {
        let (document, test, packing) = read(common, sweeps, values)?;
        if let Some(remark) = packing.narrow_cell().map(|remark| format!("{}: {remark}", test.packing.display()))
            && warned.insert(remark.clone())
        {
            tell(format_args!("warning: {remark}"));
        }
        expect_place(common.out, &[common.path, &document.resolve(Path::new(&test.packing))])?;
        let dimension = packing.dimension();
        for warning in document.warnings().iter().map(|warning| as_swept(warning.clone(), sweeps)) {
            if warned.insert(warning.clone()) {
                tell(format_args!("warning: {warning}"));
            }
        }
        match first {
            None => first = Some(dimension),
            Some(first) if first != dimension => {
                let text = format!(
                    "{}: a packing of discs and one of spheres do not fit into one table",
                    described(sweeps, values)
                );
                return Err(Failure::new(Exit::BadInput, format!("{text}\nhint: sweep them one after the other")));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// All combinations of the values, the last key changing first.
fn combinations(sweeps: &[Sweep]) -> Vec<Vec<&str>> {
    let mut found: Vec<Vec<&str>> = vec![Vec::new()];
    for sweep in sweeps {
        found = found
            .iter()
            .flat_map(|start| sweep.values.iter().map(|value| [&start[..], &[value.as_str()]].concat()))
            .take(MOST_TESTS + 1)
            .collect();
    }
    found
}

fn described(sweeps: &[Sweep], values: &[&str]) -> String {
    sweeps.iter().zip(values).map(|(sweep, value)| format!("{}={value}", sweep.key)).collect::<Vec<_>>().join(" ")
}

/// One test and its packing.
///
/// # Errors
/// It is not sound.
fn read(common: &Common<'_>, sweeps: &[Sweep], values: &[&str]) -> Result<(Document, ElementTest, Packing), Failure> {
    let own = sweeps.iter().zip(values).map(|(sweep, value)| format!("{}={value}", sweep.key));
    let overrides: Vec<String> = common.overrides.iter().cloned().chain(own).collect();
    let found = || -> Result<_, Failure> {
        let document = Document::read_in_size(common.path, common.size, &overrides)?;
        document.expect(Kind::ElementTest)?;
        let (test, packing) = read_element_test(&document)?;
        Ok((document, test, packing))
    };
    found().map_err(|failure| Failure { message: as_swept(failure.message, sweeps), ..failure })
}

/// A message about swept values, which are given over as overrides that the user has not written.
fn as_swept(message: String, sweeps: &[Sweep]) -> String {
    let renamed = |message: String, sweep: &Sweep| {
        message.replace(&format!("--set {}=", sweep.key), &format!("--sweep {}=", sweep.key))
    };
    sweeps.iter().fold(message, renamed)
}

/// Runs one test.
///
/// # Errors
/// It is not sound.
fn one(common: &Common<'_>, sweeps: &[Sweep], values: &[&str], interrupt: &Interrupt) -> Result<Ended, Failure> {
    let (document, test, packing) = read(common, sweeps, values)?;
    let table = element_table(&test, packing, common.tangent, common.units, &mut || !interrupt.is_raised())
        .map_err(|error| Failure::new(Exit::BadInput, error))?;
    let summary = table.end.summary;
    let stopped = match table.end.result {
        Ok(()) => table.is_interrupted.then(|| format!("a stop was requested after its row {}", summary.rows - 1)),
        Err(error) if error.is_bad_input() => return Err(document.table_error(error).into()),
        Err(error) => Some(error.to_string()),
    };
    let (warnings, fallbacks) = (summary.warnings(), summary.fallbacks());
    let listed_forces = summary.listed_forces.warning();
    Ok(Ended { csv: table.csv, warnings, fallbacks, stopped, listed_forces, note: table.note })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_listed_or_evenly_spaced() {
        let values = |text: &str| text.parse::<Sweep>().map(|sweep| sweep.values);
        assert_eq!(values("contact.friction=0.1:0.7:7").unwrap(), ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]);
        assert_eq!(values("a=1e8:5e8:2").unwrap(), ["100000000", "500000000"]);
        assert_eq!(values("rve.accuracy=draft, tight").unwrap(), ["draft", "tight"]);
        assert_eq!(values("a=3").unwrap(), ["3"]);
        for bad in [
            "a",
            "=1",
            "a=",
            "a=1:2:0",
            "a=1:x:3",
            "a=1:2:-1",
            "a=1:2",
            "a=1,,2",
            "a=1:2:1000000",
            "a=1:2:1",
            "a=x,y,x",
        ] {
            assert!(values(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_last_key_changes_first() {
        let sweeps = ["a=1,2", "b=x,y"].map(|text| text.parse::<Sweep>().unwrap());
        let found: Vec<String> = combinations(&sweeps).iter().map(|values| values.concat()).collect();
        assert_eq!(found, ["1x", "1y", "2x", "2y"]);
    }
}
