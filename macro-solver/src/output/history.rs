//! `history.csv`: one row per accepted step, with one column per probe behind the fixed ones, the stage where there are
//! several, and last how the step was reached and how accurate it is.
//!
//! Invariants: no timings (equal runs give equal bytes); after every [`HistoryWriter::append`] the file on disk ends
//! with a complete row, also when the disk is full.

use super::OutputError;
use super::appended::{AppendedFile, EarlierFiles, csv_line, number};
use super::units::headed;
use crate::material::error_estimate::ErrorEstimate;
use crate::observer::StepAccuracy;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Columns that every history has, in order; probes follow.
const FIXED_COLUMNS: [&str; 5] = ["step", "time", "load", "iterations", "evaluations"];

/// Column behind the probes where there are several stages.
const STAGE_COLUMN: &str = "stage";

/// Columns that every history ends with.
const LAST_COLUMNS: [&str; 3] = ["cut_backs", "stabilised", "committed_iterates"];

/// Column behind them in runs whose error is estimated, and before those of [`ERROR_COLUMNS`].
const STRAIN_COLUMN: &str = "strain_per_step";

/// Last columns of runs whose error is estimated.
const ERROR_COLUMNS: [&str; 4] =
    ["estimated_error", "estimated_error_of_mean", "balance_error", "balance_error_of_mean"];

/// What a column of a history tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HistoryColumn {
    /// Which step it is, how far the run has come, and what the step cost.
    Fixed,
    /// A quantity that the scene asks for.
    Probe,
    /// How the step was reached.
    Solver,
    /// An estimated error.
    Error,
}

impl HistoryColumn {
    /// The kind of the column of this name, which is that of the header without its unit. What no run writes by itself is a probe.
    pub fn kind(name: &str) -> Self {
        match name {
            name if FIXED_COLUMNS.contains(&name) || name == STAGE_COLUMN => Self::Fixed,
            name if LAST_COLUMNS.contains(&name) || name == STRAIN_COLUMN => Self::Solver,
            name if ERROR_COLUMNS.contains(&name) => Self::Error,
            _ => Self::Probe,
        }
    }
}

/// One accepted step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HistoryRow {
    /// Number of the step, from 1; 0 is the state before loading.
    pub step: u64,
    /// Time of the scene, s; a parameter of the path in a quasi-static run.
    pub time: f64,
    /// Load factor within its stage; 1 is the whole load. Where it is an unknown, as with an arc length, it may fall.
    pub load: f64,
    /// Newton iterations of the attempt that was accepted.
    pub iterations: u64,
    /// RVE evaluations of the step, those of cut-back attempts included.
    pub evaluations: u64,
    /// Stage, from 0.
    pub stage: usize,
    /// Values of the probes, in the order of the header; each in its own SI unit.
    pub probes: Vec<f64>,
    /// Failed attempts before the step.
    pub cut_backs: u64,
    /// Increments of viscous stabilisation in the step; 0 if it was not stabilised.
    pub stabilised: u64,
    /// Iterates that were committed before the last; 0 in stabilised steps.
    pub committed_iterates: u64,
    /// Strain per ramp step, and the estimated errors of the stresses: of a point, and of their mean over the body.
    pub accuracy: StepAccuracy,
    /// Estimated errors of the probes that are means of stresses, in their units; for pictures.
    pub probe_errors: Vec<Option<f64>>,
}

/// Columns of a history in addition to those that every history has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HistoryLayout {
    /// Units that the header shows behind the names, by column; none for plain names.
    pub headings: BTreeMap<String, &'static str>,
    /// A column for each probe.
    pub probes: Vec<String>,
    /// Names of the stages; a column `stage` behind the probes tells them apart where there are several.
    pub stages: Vec<String>,
    /// Whether the error of the stresses is estimated.
    pub accuracy: bool,
}

/// Appends rows to a history file.
#[derive(Debug)]
pub struct HistoryWriter {
    file: AppendedFile,
    layout: HistoryLayout,
}

impl HistoryWriter {
    /// Creates the file and writes the header, unless an earlier one is to be kept.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn create(path: &Path, layout: HistoryLayout, earlier: EarlierFiles) -> Result<Self, OutputError> {
        Ok(Self { file: AppendedFile::create(path, &layout.header(path)?, earlier)?, layout })
    }

    /// Makes the file hold exactly these rows and goes on behind them.
    ///
    /// # Errors
    /// As [`HistoryWriter::append`].
    pub fn reopen(path: &Path, layout: HistoryLayout, rows: &[HistoryRow]) -> Result<Self, OutputError> {
        let mut text = layout.header(path)?;
        for row in rows {
            text.extend(layout.line(path, row)?);
        }
        Ok(Self { file: AppendedFile::rewrite(path, &text)?, layout })
    }

    /// Appends one row and flushes it.
    ///
    /// # Errors
    /// [`OutputError::Encode`] when the number of probes is not that of the header; [`OutputError::Write`] when the
    /// system refuses, in which case the file is cut back to its last complete row.
    pub fn append(&mut self, row: &HistoryRow) -> Result<(), OutputError> {
        self.file.append(&self.layout.line(self.file.path(), row)?)
    }
}

impl HistoryLayout {
    fn header(&self, path: &Path) -> Result<Vec<u8>, OutputError> {
        let names = FIXED_COLUMNS.iter().copied().chain(self.probes.iter().map(String::as_str));
        let names = names.chain(self.tells_stages().then_some(STAGE_COLUMN)).chain(LAST_COLUMNS);
        let of_accuracy = std::iter::once(STRAIN_COLUMN).chain(ERROR_COLUMNS);
        let names = names.chain(of_accuracy.filter(|_| self.accuracy));
        csv_line(path, names.map(|name| headed(name, &self.headings)))
    }

    fn line(&self, path: &Path, row: &HistoryRow) -> Result<Vec<u8>, OutputError> {
        let probes = self.probes.len();
        if row.probes.len() != probes {
            let reason = format!("{} probe values for {probes} probe columns", row.probes.len());
            return Err(OutputError::encode(path, reason));
        }
        let fixed = [
            row.step.to_string(),
            number(row.time),
            number(row.load),
            row.iterations.to_string(),
            row.evaluations.to_string(),
        ];
        let stage = self.tells_stages().then(|| self.stages.get(row.stage).cloned().unwrap_or_default());
        let last = [row.cut_backs, row.stabilised, row.committed_iterates].map(|count| count.to_string());
        let of_estimate = |figure: fn(&ErrorEstimate) -> f64| {
            row.accuracy.estimate.as_ref().map(figure).map_or(String::new(), number)
        };
        let accuracy = [
            number(row.accuracy.strain_per_step),
            of_estimate(|estimate| estimate.rms),
            of_estimate(|estimate| estimate.of_mean),
            row.accuracy.balance.map_or(String::new(), |balance| number(balance.rms)),
            row.accuracy.balance.map_or(String::new(), |balance| number(balance.of_mean)),
        ];
        let accuracy = accuracy.into_iter().filter(|_| self.accuracy);
        let probes = row.probes.iter().copied().map(number);
        csv_line(path, fixed.into_iter().chain(probes).chain(stage).chain(last).chain(accuracy))
    }

    fn tells_stages(&self) -> bool {
        self.stages.len() > 1
    }
}

#[cfg(test)]
mod tests {
    use super::super::units::HISTORY_COLUMNS;
    use super::*;

    #[test]
    fn every_column_of_a_full_history_has_a_kind_and_a_unit() {
        let stages = vec!["squeeze".to_owned(), "shear".to_owned()];
        let layout = HistoryLayout { stages, accuracy: true, ..HistoryLayout::default() };
        let header = String::from_utf8(layout.header(Path::new("history.csv")).unwrap()).unwrap();
        let names: Vec<&str> = header.trim_end().split(',').collect();
        assert_eq!(names, HISTORY_COLUMNS.map(|(name, _)| name));
        assert!(names.iter().all(|name| HistoryColumn::kind(name) != HistoryColumn::Probe));
        assert_eq!(
            ["time", "stage", "cut_backs", "strain_per_step", "balance_error", "top_force"].map(HistoryColumn::kind),
            [
                HistoryColumn::Fixed,
                HistoryColumn::Fixed,
                HistoryColumn::Solver,
                HistoryColumn::Solver,
                HistoryColumn::Error,
                HistoryColumn::Probe
            ]
        );
    }

    #[test]
    fn numbers_read_back_to_the_same_bits_and_names_are_quoted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let layout = HistoryLayout {
            probes: vec!["plain".to_owned(), "with, comma".to_owned()],
            stages: vec!["squeeze".to_owned(), "shear".to_owned()],
            accuracy: true,
            ..HistoryLayout::default()
        };
        let mut history = HistoryWriter::create(&path, layout, EarlierFiles::Replace).unwrap();
        let values = vec![0.1 + 0.2, -1.234_567_890_123_456_7e-300];
        history
            .append(&HistoryRow {
                step: 1,
                time: 0.05,
                load: 0.05,
                iterations: 3,
                evaluations: 384,
                stage: 1,
                probes: values.clone(),
                cut_backs: 2,
                stabilised: 17,
                committed_iterates: 5,
                accuracy: StepAccuracy { strain_per_step: 1e-6, ..StepAccuracy::default() },
                probe_errors: Vec::new(),
            })
            .unwrap();
        let mut reader = csv::Reader::from_path(&path).unwrap();
        assert_eq!(reader.headers().unwrap().get(6), Some("with, comma"));
        let row = reader.records().next().unwrap().unwrap();
        let read: Vec<f64> = (5..7).map(|column| row[column].parse().unwrap()).collect();
        assert_eq!(read, values);
        assert_eq!((&row[4], &row[7]), ("384", "shear"));
        let headers = reader.headers().unwrap();
        assert_eq!(
            [7, 8, 9, 10].map(|column| &headers[column]),
            ["stage", "cut_backs", "stabilised", "committed_iterates"]
        );
        assert_eq!((&row[8], &row[9], &row[10]), ("2", "17", "5"));
        assert_eq!([11, 12].map(|column| &headers[column]), ["strain_per_step", "estimated_error"]);
        assert_eq!((&row[11], &row[12]), ("1e-6", ""), "what is not known is left empty");
    }

    #[test]
    fn a_header_may_hold_units() {
        let probes = vec!["force".to_owned(), "ratio".to_owned()];
        let headings = [("force", "N/m"), ("ratio", "-"), ("time", "s")].map(|(name, unit)| (name.to_owned(), unit));
        let layout = HistoryLayout { headings: headings.into(), probes, ..HistoryLayout::default() };
        let header = layout.header(Path::new("history.csv")).unwrap();
        let expected =
            "step,time [s],load,iterations,evaluations,force [N/m],ratio,cut_backs,stabilised,committed_iterates\n";
        assert_eq!(String::from_utf8(header).unwrap(), expected);
    }

    #[test]
    fn a_row_of_the_wrong_width_is_refused_and_leaves_the_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let mut history = HistoryWriter::create(&path, HistoryLayout::default(), EarlierFiles::Replace).unwrap();
        let before = std::fs::read(&path).unwrap();
        let row = HistoryRow {
            step: 1,
            time: 0.0,
            load: 0.0,
            iterations: 1,
            evaluations: 1,
            stage: 0,
            probes: vec![1.0],
            cut_backs: 0,
            stabilised: 0,
            committed_iterates: 0,
            accuracy: StepAccuracy::default(),
            probe_errors: Vec::new(),
        };
        assert!(history.append(&row).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), before);
    }

    #[test]
    fn a_history_goes_on_behind_given_rows_whatever_the_file_held() {
        let folder = tempfile::tempdir().unwrap();
        let row = |step: u64| HistoryRow {
            step,
            time: 0.1 * step as f64,
            load: 0.1 * step as f64,
            iterations: 2,
            evaluations: 8,
            stage: 0,
            probes: vec![-0.0, 1.0 / 3.0][..1 + usize::from(step > 99)].to_vec(),
            cut_backs: step % 2,
            stabilised: 0,
            committed_iterates: 0,
            accuracy: StepAccuracy::default(),
            probe_errors: Vec::new(),
        };
        let layout = HistoryLayout { probes: vec!["one".to_owned()], ..HistoryLayout::default() };
        let (whole, broken) = (folder.path().join("whole.csv"), folder.path().join("broken.csv"));
        let mut history = HistoryWriter::create(&whole, layout.clone(), EarlierFiles::Replace).unwrap();
        (0..4).for_each(|step| history.append(&row(step)).unwrap());
        std::fs::write(&broken, "step,time\n0,garbage\n1").unwrap();
        let rows: Vec<HistoryRow> = (0..2).map(row).collect();
        let mut history = HistoryWriter::reopen(&broken, layout.clone(), &rows).unwrap();
        (2..4).for_each(|step| history.append(&row(step)).unwrap());
        assert_eq!(std::fs::read(&broken).unwrap(), std::fs::read(&whole).unwrap());
        assert!(HistoryWriter::reopen(&broken, layout, &[row(100)]).is_err());
    }

    #[test]
    fn a_full_disk_is_an_error() {
        let error = HistoryWriter::create(Path::new("/dev/full"), HistoryLayout::default(), EarlierFiles::Replace)
            .unwrap_err();
        assert!(error.to_string().contains("hint: free some space"), "{error}");
    }
}
