//! A text file that grows by whole lines.
//!
//! After every [`AppendedFile::append`] the file on disk ends with a complete line, also when the disk is full.

use super::{OutputError, write_atomically};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What becomes of the files that an earlier process has left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EarlierFiles {
    /// They are replaced at once: the run begins.
    Replace,
    /// They stay as they are until the state of the run is restored: a state that is refused costs no result.
    Keep,
}

/// The file and the length of its complete lines.
#[derive(Debug)]
pub(super) struct AppendedFile {
    path: PathBuf,
    file: File,
    length: u64,
}

impl AppendedFile {
    /// Creates the file with these lines, unless there is an earlier one that is to be kept.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub(super) fn create(path: &Path, lines: &[u8], earlier: EarlierFiles) -> Result<Self, OutputError> {
        let failed = |source| OutputError::write(path, source);
        if earlier == EarlierFiles::Keep && path.exists() {
            let file = appending(path)?;
            let length = file.metadata().map_err(failed)?.len();
            return Ok(Self { path: path.to_owned(), file, length });
        }
        File::create(path).map_err(failed)?;
        let mut appended = Self { path: path.to_owned(), file: appending(path)?, length: 0 };
        appended.append(lines)?;
        Ok(appended)
    }

    /// Makes the file hold exactly these lines and goes on behind them. It is written again rather than cut back: after a power cut
    /// it may hold less than it did, or something else.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub(super) fn rewrite(path: &Path, lines: &[u8]) -> Result<Self, OutputError> {
        write_atomically(path, lines)?;
        Ok(Self { path: path.to_owned(), file: appending(path)?, length: lines.len() as u64 })
    }

    /// Where it lies.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends whole lines and flushes them.
    ///
    /// # Errors
    /// [`OutputError::Write`] when the system refuses, in which case the file is cut back to its last complete line.
    pub(super) fn append(&mut self, lines: &[u8]) -> Result<(), OutputError> {
        if let Err(source) = self.file.write_all(lines).and_then(|()| self.file.flush()) {
            // Cutting back can only fail where the write failed for a graver reason, which is reported.
            let _ = self.file.set_len(self.length);
            return Err(OutputError::write(&self.path, source));
        }
        self.length += lines.len() as u64;
        Ok(())
    }
}

/// Opens a file so that every write goes to its end, also after it has been cut back.
fn appending(path: &Path) -> Result<File, OutputError> {
    OpenOptions::new().append(true).open(path).map_err(|source| OutputError::write(path, source))
}

/// One record as a line of a CSV file.
///
/// # Errors
/// [`OutputError::Encode`].
pub(super) fn csv_line(path: &Path, record: impl Iterator<Item = String>) -> Result<Vec<u8>, OutputError> {
    let mut encoder = csv::Writer::from_writer(Vec::new());
    encoder.write_record(record).map_err(|reason| OutputError::encode(path, reason))?;
    encoder.into_inner().map_err(|reason| OutputError::encode(path, reason))
}

/// Shortest text that reads back to the same bits.
pub(super) fn number(value: f64) -> String {
    format!("{value:e}")
}
