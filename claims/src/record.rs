//! What claims leave behind: a table per process.

use serde::{Deserialize, Serialize};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;

/// Environment variable that names the folder of the record; nothing is written without it. The folder is made where it is missing.
pub const FOLDER: &str = "GRAINSPAN_MEASURED";

/// How a claim is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The tolerance is a share of the expected number.
    Relative,
    /// The tolerance is in the unit of the error.
    Absolute,
    /// The number has to lie in a range.
    Range,
    /// It holds or does not.
    Condition,
}

/// One statement of a test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Entry of the catalogue, such as `B-5`.
    pub entry: String,
    /// What is compared.
    pub quantity: String,
    /// How.
    pub kind: Kind,
    /// The number or range that is expected; empty where the test computes an error.
    pub expected: String,
    /// The number found; empty where the test computes an error.
    pub measured: String,
    /// Measured less expected, as a share of the expected number if the tolerance is relative; or the error; distance from the range.
    pub error: String,
    /// Largest error that counts as agreement; empty for ranges and conditions.
    pub tolerance: String,
    /// Whether the error is within the tolerance.
    pub met: bool,
    /// Orders statements of one quantity: the largest is the worst.
    pub badness: f64,
    /// Source file of the test, relative to the workspace.
    pub file: String,
}

/// Appends a line to the table of this process, if there is a record. One call of `write` each, so that lines of threads do not mix.
///
/// # Panics
/// The line cannot be written: a record that lacks claims would be wrong without a sign.
pub(crate) fn append(record: &Record) {
    let Some(folder) = std::env::var_os(FOLDER).filter(|folder| !folder.is_empty()) else { return };
    let file = Path::new(&folder).join(format!("{}.csv", std::process::id()));
    std::fs::create_dir_all(&folder).and_then(|()| write(&file, record)).unwrap_or_else(|error| {
        panic!("{FOLDER} has to be the absolute path of a folder that can be written: {}: {error}", file.display())
    });
}

fn write(file: &Path, record: &Record) -> io::Result<()> {
    let mut line = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    line.serialize(record).map_err(io::Error::other)?;
    let line = line.into_inner().map_err(|error| io::Error::other(error.to_string()))?;
    OpenOptions::new().create(true).append(true).open(file)?.write_all(&line)
}

/// All statements in a folder, in no particular order.
///
/// # Errors
/// The folder or a table in it cannot be read.
pub fn read(folder: &Path) -> io::Result<Vec<Record>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let file = entry?.path();
        if file.extension().is_none_or(|ending| ending != "csv") {
            continue;
        }
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_path(&file).map_err(io::Error::other)?;
        for record in reader.deserialize() {
            found.push(record.map_err(|error| io::Error::other(format!("{}: {error}", file.display())))?);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let record = |quantity: &str, badness: f64| Record {
            entry: "X-1".to_owned(),
            quantity: quantity.to_owned(),
            kind: Kind::Relative,
            expected: "1e0".to_owned(),
            measured: "1.5e0".to_owned(),
            error: "5e-1".to_owned(),
            tolerance: "1e-1".to_owned(),
            met: false,
            badness,
            file: "a/src/b.rs".to_owned(),
        };
        let records = [record("with, comma and \"quotes\"", 0.5), record("not a number", f64::INFINITY)];
        for record in &records {
            write(&folder.path().join("7.csv"), record).unwrap();
        }
        std::fs::write(folder.path().join("other.txt"), "no table").unwrap();
        assert_eq!(read(folder.path()).unwrap(), records);
        std::fs::write(folder.path().join("8.csv"), "X-1,short\n").unwrap();
        assert!(read(folder.path()).unwrap_err().to_string().contains("8.csv"));
    }
}
