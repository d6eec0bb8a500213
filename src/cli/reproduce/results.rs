//! What the runs of a figure have left: tables, summaries, fields.

use super::curve::Curve;
use super::error::ReproduceError;
use super::inputs::Inputs;
use crate::build_info::this_program;
use crate::cli::commit::commit_of;
use crate::machine::Machine;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a run was made with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Origin {
    program: String,
    commit_of_inputs: Option<String>,
    machine: serde_json::Value,
}

impl Origin {
    /// This program, these inputs and this machine.
    pub(super) fn of_now(inputs: &Inputs) -> Self {
        Self {
            program: this_program(),
            commit_of_inputs: commit_of(inputs.folder()),
            machine: serde_json::to_value(Machine::here()).unwrap_or_default(),
        }
    }
}

/// A run that has ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Finished {
    #[serde(skip)]
    name: String,
    #[serde(skip)]
    folder: PathBuf,
    identity: String,
    exit_code: i32,
    said: String,
    wall_s: f64,
    /// Missing in marks of earlier versions.
    #[serde(default)]
    origin: Option<Origin>,
}

impl Finished {
    /// A run that has just ended.
    pub(super) fn new(
        name: &str,
        folder: &Path,
        identity: String,
        exit_code: i32,
        said: String,
        wall_s: f64,
        origin: Origin,
    ) -> Self {
        let (name, folder, origin) = (name.to_owned(), folder.to_owned(), Some(origin));
        Self { name, folder, identity, exit_code, said, wall_s, origin }
    }

    /// A run of an earlier call; `None` if there is none that can be read.
    pub(super) fn read(name: &str, folder: &Path, mark: &Path) -> Option<Self> {
        let text = std::fs::read_to_string(mark).ok()?;
        let found: Self = serde_json::from_str(&text).ok()?;
        Some(Self { name: name.to_owned(), folder: folder.to_owned(), ..found })
    }

    /// The mark of a finished run.
    pub(super) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// What has run.
    pub(super) fn identity(&self) -> &str {
        &self.identity
    }

    /// Its folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether it was made by the same program from the same inputs.
    pub(super) fn is_of(&self, now: &Origin) -> bool {
        let same =
            |origin: &Origin| (&origin.program, &origin.commit_of_inputs) == (&now.program, &now.commit_of_inputs);
        self.origin.as_ref().is_some_and(same)
    }

    /// The last line with an error, for a run that stopped early or was refused.
    pub(super) fn stopped(&self) -> Option<String> {
        let line = || self.said.lines().rev().find(|line| line.starts_with("error:")).unwrap_or("stopped early");
        (self.exit_code != 0).then(|| line().trim_start_matches("error: ").to_owned())
    }

    /// A number of `summary.json`, by the path to it, such as `["fallbacks", "steps_stabilised"]`.
    ///
    /// # Errors
    /// The summary cannot be read, or has no such number.
    pub(super) fn summary(&self, path: &[&str]) -> Result<f64, ReproduceError> {
        let file = self.folder.join("summary.json");
        let text = std::fs::read_to_string(&file).map_err(|error| unusable(&file, &error))?;
        let all: serde_json::Value = serde_json::from_str(&text).map_err(|error| unusable(&file, &error))?;
        let found = path.iter().try_fold(&all, |value, key| value.get(key)).and_then(serde_json::Value::as_f64);
        found.ok_or_else(|| unusable(&file, &format!("there is no number '{}'", path.join("."))))
    }

    /// Another table of a run, such as `layers/band.csv`.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn table_of(&self, file: &str) -> Result<Table, ReproduceError> {
        Table::read(self.folder.join(file))
    }

    /// A picture that a run has drawn, as text.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn picture(&self, file: &str) -> Result<String, ReproduceError> {
        let file = self.folder.join(file);
        std::fs::read_to_string(&file).map_err(|error| unusable(&file, &error))
    }

    /// `history.csv` of a scene, or the rows of an element test or a specimen.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn table(&self) -> Result<Table, ReproduceError> {
        let history = self.folder.join("history.csv");
        Table::read(if history.exists() { history } else { self.folder.join("rows.csv") })
    }
}

/// The runs of a figure.
#[derive(Debug)]
pub(super) struct Results {
    runs: Vec<Finished>,
}

impl Results {
    /// Runs in the order of the figure.
    pub(super) fn new(runs: Vec<Finished>) -> Self {
        Self { runs }
    }

    /// The run of this name.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn run(&self, name: &str) -> Result<&Finished, ReproduceError> {
        let found = self.runs.iter().find(|run| run.name == name);
        found.ok_or_else(|| ReproduceError::NotFound(format!("the figure has no run '{name}'")))
    }

    /// What each run was made with.
    pub(super) fn origins(&self) -> impl Iterator<Item = (&str, Option<&Origin>)> {
        self.runs.iter().map(|run| (run.name.as_str(), run.origin.as_ref()))
    }

    /// A remark on every run that stopped early.
    pub(super) fn notes(&self) -> Vec<String> {
        self.runs.iter().filter_map(|run| Some(format!("{}: {}", run.name, run.stopped()?))).collect()
    }
}

/// A table of numbers with a header.
#[derive(Clone, Debug)]
pub(super) struct Table {
    file: PathBuf,
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(file: PathBuf) -> Result<Self, ReproduceError> {
        let mut reader = csv::Reader::from_path(&file).map_err(|error| unusable(&file, &error))?;
        let columns = reader.headers().map_err(|error| unusable(&file, &error))?.iter().map(str::to_owned).collect();
        let rows = reader
            .records()
            .map(|row| row.map(|row| row.iter().map(str::to_owned).collect()))
            .collect::<Result<Vec<Vec<String>>, csv::Error>>()
            .map_err(|error| unusable(&file, &error))?;
        Ok(Self { file, columns, rows })
    }

    /// A column; an entry that is no number is NaN.
    ///
    /// # Errors
    /// There is no such column.
    pub(super) fn column(&self, name: &str) -> Result<Vec<f64>, ReproduceError> {
        let place = self.columns.iter().position(|column| column == name);
        let place = place.ok_or_else(|| unusable(&self.file, &format!("there is no column '{name}'")))?;
        Ok(self.rows.iter().map(|row| row[place].parse().unwrap_or(f64::NAN)).collect())
    }

    /// The rows of a stage of a scene, begun by the state at its start.
    ///
    /// # Errors
    /// The table has no stages, or none of this name.
    pub(super) fn stage(&self, name: &str) -> Result<Self, ReproduceError> {
        let place = self.columns.iter().position(|column| column == "stage");
        let place = place.ok_or_else(|| unusable(&self.file, &"there is no column 'stage'"))?;
        let first = self.rows.iter().position(|row| row[place] == name);
        let first = first.ok_or_else(|| unusable(&self.file, &format!("there is no stage '{name}'")))?;
        let last = self.rows.iter().rposition(|row| row[place] == name).unwrap_or(first);
        let rows = self.rows[first.saturating_sub(1)..=last].to_vec();
        Ok(Self { file: self.file.clone(), columns: self.columns.clone(), rows })
    }

    /// One column over another.
    ///
    /// # Errors
    /// There is no such column.
    pub(super) fn curve(&self, x: &str, y: &str) -> Result<Curve, ReproduceError> {
        Ok(super::curve::curve(&self.column(x)?, &self.column(y)?))
    }
}

/// A file that cannot be used.
pub(super) fn unusable(file: &Path, problem: &dyn std::fmt::Display) -> ReproduceError {
    ReproduceError::Unusable { file: file.to_owned(), problem: problem.to_string() }
}
