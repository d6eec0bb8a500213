//! What the pages are made of: entries of the catalogue, and the committed comparisons of figures and studies.

use crate::cli::comparison::HEADER;
use crate::cli::reproduce;
use crate::exit::{Exit, Failure};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where the comparisons of figures lie.
const FIGURES: &str = "docs/papers/figures";

/// Where the comparisons of studies lie.
const STUDIES: &str = "docs/lab-book/studies";

/// An entry of the verification catalogue.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    pub(super) id: String,
    pub(super) claim: String,
    /// What it is compared with.
    pub(super) reference: String,
    pub(super) tolerance: String,
    /// Files that test it, or why there is none.
    pub(super) tested_in: String,
}

/// Ids of the entries that a row of the lab book marks as missed: their tests assert less than the catalogue asks.
///
/// # Errors
/// The lab book cannot be read.
pub(super) fn missed_in_lab_book(root: &Path) -> Result<Vec<String>, Failure> {
    let text = read(&root.join("docs/lab-book/verification.md"))?;
    let marked = text.lines().filter(|line| line.starts_with("| ") && line.contains("**missed**"));
    let mut found: Vec<String> = marked.filter_map(|line| line.split(" | ").next()).flat_map(ids).collect();
    found.sort();
    found.dedup();
    Ok(found)
}

/// Ids such as `T-10` in a text.
fn ids(text: &str) -> Vec<String> {
    let words = text.split(|letter: char| !(letter.is_ascii_alphanumeric() || letter == '-'));
    words.filter(|word| is_id(word)).map(str::to_owned).collect()
}

fn is_id(word: &str) -> bool {
    let Some((family, number)) = word.split_once('-') else { return false };
    family.len() == 1 && family.chars().all(|letter| letter.is_ascii_uppercase()) && number.parse::<u32>().is_ok()
}

/// A committed comparison.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// Paper and figure; of a study what it is.
    pub(super) origin: String,
    /// The command that repeats it.
    pub(super) command: String,
    /// Day of the measurement.
    pub(super) date: String,
    /// What it was measured on.
    pub(super) processor: String,
    /// The commit that its inputs belong to.
    pub(super) commit: String,
    /// Its rows; those that are only stated have no expected number.
    pub(super) rows: Vec<Row>,
}

/// A row of a comparison, as it stands in its file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    /// Entries of the catalogue that it belongs to.
    pub(super) entries: Vec<String>,
    pub(super) quantity: String,
    pub(super) theirs: String,
    pub(super) source: String,
    pub(super) ours: String,
    pub(super) difference: String,
    pub(super) tolerance: String,
    /// "yes", "no", or empty without a tolerance.
    pub(super) met: String,
}

impl Row {
    /// Whether there is a number to compare it with.
    pub(super) fn is_compared(&self) -> bool {
        !self.theirs.is_empty()
    }
}

/// What both files of provenance have.
#[derive(Deserialize)]
struct Provenance {
    command: Option<String>,
    size: Option<String>,
    #[serde(default)]
    entries: BTreeMap<String, Vec<String>>,
    commit_of_inputs: Option<String>,
    machine: Machine,
}

#[derive(Deserialize)]
struct Machine {
    date: String,
    processor: String,
}

pub(super) fn unusable(file: &Path, problem: impl std::fmt::Display) -> Failure {
    Failure::new(Exit::BadInput, format!("{}: {problem}", file.display()))
}

fn read(file: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(file).map_err(|error| unusable(file, error))
}

/// The entries of the catalogue, in its order.
///
/// # Errors
/// It cannot be read, or has no entries.
pub(super) fn catalogue(root: &Path) -> Result<Vec<Entry>, Failure> {
    let file = root.join("docs/reference/verification-catalogue.md");
    let text = read(&file)?;
    let entries: Vec<Entry> = text.lines().filter_map(entry).collect();
    if entries.is_empty() { Err(unusable(&file, "there are no entries")) } else { Ok(entries) }
}

/// The entry in a line of the catalogue.
fn entry(line: &str) -> Option<Entry> {
    let cells: Vec<&str> = line.strip_prefix("| ")?.strip_suffix(" |")?.split(" | ").collect();
    let [id, claim, reference, tolerance, tested_in] = cells[..] else { return None };
    is_id(id).then(|| Entry {
        id: id.to_owned(),
        claim: claim.to_owned(),
        reference: reference.to_owned(),
        tolerance: tolerance.to_owned(),
        tested_in: tested_in.to_owned(),
    })
}

/// The committed comparisons: figures in the order of their list, then studies by name.
///
/// # Errors
/// A file is missing or cannot be read.
pub(super) fn sources(root: &Path) -> Result<Vec<Source>, Failure> {
    let mut found = Vec::new();
    for figure in reproduce::summaries() {
        let stem = root.join(FIGURES).join(figure.name);
        let provenance = provenance(&stem)?;
        let size = provenance.size.clone().unwrap_or_default();
        let command = format!("grainspan reproduce {} --size {size}", figure.name);
        let entries_of = |quantity: &str| {
            let named = figure.entries.iter().filter(|(_, part)| quantity.contains(part));
            named.map(|(entry, _)| (*entry).to_owned()).collect()
        };
        found.push(source(&stem, figure.source, command, &provenance, &entries_of)?);
    }
    let folder = root.join(STUDIES);
    let entries = std::fs::read_dir(&folder).map_err(|error| unusable(&folder, error))?;
    let mut stems: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|ending| ending == "json"))
        .map(|path| path.with_extension(""))
        .collect();
    stems.sort();
    for stem in stems {
        let provenance = provenance(&stem)?;
        let command = provenance.command.clone().unwrap_or_default();
        let entries_of = |quantity: &str| {
            let holds = |rows: &Vec<String>| rows.iter().any(|row| row == quantity);
            provenance.entries.iter().filter(|(_, rows)| holds(rows)).map(|(entry, _)| entry.clone()).collect()
        };
        found.push(source(&stem, "ensembles of packings", command, &provenance, &entries_of)?);
    }
    Ok(found)
}

/// A file next to the others of its name; names have no dots.
fn with_ending(stem: &Path, ending: &str) -> PathBuf {
    stem.with_extension(ending)
}

fn provenance(stem: &Path) -> Result<Provenance, Failure> {
    let file = with_ending(stem, "json");
    serde_json::from_str(&read(&file)?).map_err(|error| unusable(&file, error))
}

fn source(
    stem: &Path,
    origin: &str,
    command: String,
    provenance: &Provenance,
    entries_of: &dyn Fn(&str) -> Vec<String>,
) -> Result<Source, Failure> {
    let file = with_ending(stem, "csv");
    let text = read(&file)?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| unusable(&file, error))?;
    if header.iter().ne(HEADER) {
        return Err(unusable(&file, "it has not the columns of a comparison"));
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| unusable(&file, error))?;
        let is_condition = &record[1] == "yes = 1";
        let value = |column: usize| match (&record[column], is_condition) {
            ("", _) => String::new(),
            ("1.000", true) => "yes".to_owned(),
            ("0", true) => "no".to_owned(),
            ("-", _) => "-".to_owned(),
            (text, _) => match &record[1] {
                "-" => text.to_owned(),
                unit => format!("{text} {unit}"),
            },
        };
        let condition = |column: usize| if is_condition { String::new() } else { record[column].to_owned() };
        rows.push(Row {
            entries: entries_of(&record[0]),
            quantity: record[0].to_owned(),
            theirs: value(2),
            source: record[3].to_owned(),
            ours: value(4),
            difference: condition(5),
            tolerance: match (record[2].contains(" to "), &record[6]) {
                (true, "0") => "within".to_owned(),
                _ => condition(6),
            },
            met: record[7].to_owned(),
        });
    }
    Ok(Source {
        origin: origin.to_owned(),
        command,
        date: provenance.machine.date.clone(),
        processor: provenance.machine.processor.clone(),
        commit: provenance.commit_of_inputs.clone().unwrap_or_default(),
        rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_read_from_their_lines() {
        let line = "| X-12 | Claim with `a | b`? no. | source | 5 % | `tests/a.rs` |".replace("`a | b`", "`ab`");
        let found = entry(&line).unwrap();
        assert_eq!(
            (found.id.as_str(), found.reference.as_str(), found.tolerance.as_str(), found.tested_in.as_str()),
            ("X-12", "source", "5 %", "`tests/a.rs`")
        );
        for other in ["| id | claim | reference | tolerance | tested in |", "| --- | --- | --- | --- | --- |", "text"]
        {
            assert_eq!(entry(other), None);
        }
        assert_eq!(ids("| X-1, Y-12, [Liu2015] x-3, 1e-3: Z-"), ["X-1", "Y-12"]);
    }
}
