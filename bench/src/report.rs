//! Where a study's findings go: the screen, and a folder with CSV, SVG, the same text and the machine.

use crate::effort::Effort;
use crate::table::Table;
use charts::Chart;
use grainspan::exit::Failure;
use grainspan::machine::Machine;
use grainspan::stdout::print;
use macro_solver::output::{OutputError, write_atomically};
use std::fs;
use std::path::{Path, PathBuf};

/// An open report. What is handed in is on the screen and on the disk at once, so an interrupted study leaves what it has.
#[derive(Debug)]
pub(crate) struct Report {
    folder: PathBuf,
    text: String,
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
        let mut report = Self { folder: folder.to_owned(), text: String::new() };
        report.note(&format!("bench {study}: {}", machine.line()))?;
        if effort.quick {
            report.note("A quick look: the figures show that the study works, not what things cost.")?;
        }
        Ok(report)
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

    /// Ends the report.
    ///
    /// # Errors
    /// The text cannot be written.
    pub(super) fn close(mut self) -> Result<(), Failure> {
        let place = format!("\nwritten to {}\n", self.folder.display());
        print(place.as_bytes())?;
        self.text.shrink_to_fit();
        Ok(write_atomically(&self.folder.join("report.txt"), self.text.as_bytes())?)
    }

    fn say(&mut self, text: &str) -> Result<(), Failure> {
        self.text.push_str(text);
        print(text.as_bytes())
    }
}
