//! Where a study's findings go: the screen, and a folder with CSV, SVG, the same text and the machine.

use crate::effort::Effort;
use crate::table::Table;
use charts::Chart;
use grainspan::exit::Failure;
use grainspan::machine::Machine;
use grainspan::stdout::print;
use macro_solver::output::{OutputError, write_atomically};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// An open report. What is handed in is on the screen and on the disk at once, so an interrupted study leaves what it has.
#[derive(Debug)]
pub(crate) struct Report {
    folder: PathBuf,
    /// `report.txt`, where every sentence is written at once.
    text: File,
}

impl Report {
    /// Makes the folder, if need be, and describes the machine in it.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub(super) fn open(folder: &Path, study: &str, machine: &Machine, effort: &Effort) -> Result<Self, Failure> {
        fs::create_dir_all(folder).map_err(|source| OutputError::write(folder, source))?;
        let described = serde_json::to_vec_pretty(machine).expect("a machine is plain data");
        write_atomically(&folder.join("machine.json"), &described)?;
        let path = folder.join(TEXT);
        let text = File::create(&path).map_err(|source| OutputError::write(&path, source))?;
        let mut report = Self { folder: folder.to_owned(), text };
        report.note(&format!("bench {study}: {}", machine.line()))?;
        if effort.quick {
            report.note("A quick look: the figures show that the study works, not what things cost.")?;
        }
        Ok(report)
    }

    /// Where it is written.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Says a sentence.
    ///
    /// # Errors
    /// Standard output cannot be written.
    pub(crate) fn note(&mut self, sentence: &str) -> Result<(), Failure> {
        self.say(&format!("{sentence}\n"))
    }

    /// Shows a table under a heading and writes it to `NAME.csv`.
    ///
    /// # Errors
    /// The file or standard output cannot be written.
    pub(crate) fn table(&mut self, name: &str, heading: &str, table: &Table) -> Result<(), Failure> {
        self.raw(name, table)?;
        self.say(&format!("\n{heading}\n{}", table.to_text()))
    }

    /// Writes a table to `NAME.csv` without showing it: samples that others may want to look at.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn raw(&self, name: &str, table: &Table) -> Result<(), Failure> {
        Ok(write_atomically(&self.folder.join(format!("{name}.csv")), &table.to_csv())?)
    }

    /// Writes a file of another kind.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn file(&self, name: &str, content: &[u8]) -> Result<(), Failure> {
        Ok(write_atomically(&self.folder.join(name), content)?)
    }

    /// Writes a picture to `NAME.svg`.
    ///
    /// # Errors
    /// The file cannot be written. A picture that cannot be drawn is left out with a note: its numbers are in a table.
    pub(crate) fn chart(&mut self, name: &str, chart: &Chart) -> Result<(), Failure> {
        match chart.to_svg() {
            Ok(picture) => Ok(write_atomically(&self.folder.join(format!("{name}.svg")), picture.as_bytes())?),
            Err(error) => self.note(&format!("{name}.svg could not be drawn: {error}")),
        }
    }

    /// Says where it lies.
    ///
    /// # Errors
    /// Standard output cannot be written.
    pub(super) fn close(self) -> Result<(), Failure> {
        print(format!("\nwritten to {}\n", self.folder.display()).as_bytes())
    }

    fn say(&mut self, text: &str) -> Result<(), Failure> {
        let written = self.text.write_all(text.as_bytes());
        written.map_err(|source| OutputError::write(&self.folder.join(TEXT), source))?;
        print(text.as_bytes())
    }
}

/// What is on the screen, as a file.
const TEXT: &str = "report.txt";

#[cfg(test)]
mod tests {
    use super::*;

    /// A study that failed left its tables without what had been said of them.
    #[test]
    fn what_is_said_is_on_the_disk_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let mut report = Report::open(folder.path(), "sample", &Machine::here(), &Effort::default()).unwrap();
        report.note("one finding").unwrap();
        let text = fs::read_to_string(folder.path().join(TEXT)).unwrap();
        assert!(text.starts_with("bench sample: ") && text.ends_with("\none finding\n"), "{text}");
        drop(report);
        let again = Report::open(folder.path(), "sample", &Machine::here(), &Effort::default()).unwrap();
        assert!(!fs::read_to_string(folder.path().join(TEXT)).unwrap().contains("one finding"));
        again.close().unwrap();
    }
}
