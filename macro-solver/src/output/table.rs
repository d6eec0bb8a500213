//! Tables of numbers by step, one CSV file each: profiles and single Gauss points.
//!
//! Rows are kept, so that a run that is continued finds its files as they were.

use super::OutputError;
use super::appended::{AppendedFile, EarlierFiles, csv_line, number};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// One row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TableRow {
    /// Number of the step.
    pub(super) step: u64,
    /// Everything behind it, in the order of the header.
    pub(super) values: Vec<f64>,
}

/// A file and its rows.
#[derive(Debug)]
pub(super) struct TableFile {
    file: AppendedFile,
    header: Vec<String>,
    rows: Vec<TableRow>,
}

impl TableFile {
    /// Creates the file and its folder, and writes the header, `step` and the columns, unless an earlier file is to be kept.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub(super) fn create(path: &Path, columns: &[String], earlier: EarlierFiles) -> Result<Self, OutputError> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|source| OutputError::write(folder, source))?;
        }
        let header: Vec<String> = std::iter::once("step".to_owned()).chain(columns.iter().cloned()).collect();
        let file = AppendedFile::create(path, &csv_line(path, header.iter().cloned())?, earlier)?;
        Ok(Self { file, header, rows: Vec::new() })
    }

    /// Rows written so far.
    pub(super) fn rows(&self) -> &[TableRow] {
        &self.rows
    }

    /// Makes the file hold exactly these rows and goes on behind them.
    ///
    /// # Errors
    /// As [`TableFile::append`].
    pub(super) fn restore(&mut self, rows: Vec<TableRow>) -> Result<(), OutputError> {
        let path = self.file.path().to_owned();
        let mut text = csv_line(&path, self.header.iter().cloned())?;
        for row in &rows {
            text.extend(self.line(row)?);
        }
        self.file = AppendedFile::rewrite(&path, &text)?;
        self.rows = rows;
        Ok(())
    }

    /// Appends the rows of a step and flushes them.
    ///
    /// # Errors
    /// [`OutputError::Encode`] when a row does not have the columns of the header; [`OutputError::Write`].
    pub(super) fn append(&mut self, rows: impl IntoIterator<Item = TableRow>) -> Result<(), OutputError> {
        let (mut text, first) = (Vec::new(), self.rows.len());
        for row in rows {
            text.extend(self.line(&row)?);
            self.rows.push(row);
        }
        let written = self.file.append(&text);
        if written.is_err() {
            self.rows.truncate(first);
        }
        written
    }

    fn line(&self, row: &TableRow) -> Result<Vec<u8>, OutputError> {
        let path = self.file.path();
        if row.values.len() + 1 != self.header.len() {
            let reason = format!("{} numbers for {} columns", row.values.len() + 1, self.header.len());
            return Err(OutputError::encode(path, reason));
        }
        csv_line(path, std::iter::once(row.step.to_string()).chain(row.values.iter().copied().map(number)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_goes_on_behind_its_rows_and_refuses_a_row_of_another_width() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points/point-0001.csv");
        let row = |step: u64| TableRow { step, values: vec![0.1 * step as f64] };
        let columns = ["time".to_owned()];
        let mut table = TableFile::create(&path, &columns, EarlierFiles::Replace).unwrap();
        table.append([row(0), row(1)]).unwrap();
        assert!(table.append([TableRow { step: 2, values: vec![] }]).is_err());
        let kept = table.rows().to_vec();
        let whole = fs::read(&path).unwrap();
        assert_eq!(String::from_utf8(whole.clone()).unwrap(), "step,time\n0,0e0\n1,1e-1\n");
        table.append([row(2)]).unwrap();
        // A run that is continued touches nothing before its state is there.
        let longer = fs::read(&path).unwrap();
        let mut table = TableFile::create(&path, &columns, EarlierFiles::Keep).unwrap();
        assert_eq!(fs::read(&path).unwrap(), longer);
        table.restore(kept).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole);
        TableFile::create(&path, &columns, EarlierFiles::Replace).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"step,time\n");
    }
}
