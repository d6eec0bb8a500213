//! Data for standard output, and a place for it: a named file or the screen.

use crate::exit::{Exit, Failure};
use macro_solver::output::{OutputError, try_place, write_atomically};
use std::io::{ErrorKind, Write};
use std::path::Path;

/// Writes data to standard output. A reader that has seen enough (`| head`) is no failure.
///
/// # Errors
/// Standard output is full or closed for another reason.
pub fn print(data: &[u8]) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(data).and_then(|()| stdout.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(OutputError::write(Path::new("standard output"), source).into())
        }
        _ => Ok(()),
    }
}

/// Refuses a file that could not be written, or that is one of the files which the command reads, before the work whose result goes there.
///
/// # Errors
/// A folder stands there, or there is none that could take the file; the result would take the place of an input.
pub fn expect_place(file: Option<&Path>, inputs: &[&Path]) -> Result<(), Failure> {
    let Some(path) = file else { return Ok(()) };
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    // What does not exist yet is no input.
    if let Some(input) = inputs.iter().find(|input| real(path).is_some_and(|place| real(input) == Some(place))) {
        let problem =
            format!("{}: the result would take the place of {}, which is read", path.display(), input.display());
        return Err(Failure::new(Exit::BadInput, format!("{problem}\nhint: name another place with --out")));
    }
    if path.is_dir() {
        let problem = format!("{}: this is a folder, not a file", path.display());
        return Err(Failure::new(Exit::BadInput, format!("{problem}\nhint: name a file in it with --out")));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder.filter(|folder| !folder.is_dir()) {
        Some(folder) => {
            let problem = format!("{}: there is no folder {}", path.display(), folder.display());
            Err(Failure::new(Exit::BadInput, format!("{problem}\nhint: make it, or name another place with --out")))
        }
        None => Ok(try_place(path)?),
    }
}

/// Writes data to the file, or to standard output when none is named.
///
/// # Errors
/// The place cannot be written; no half file is left.
pub fn deliver(file: Option<&Path>, data: &[u8]) -> Result<(), Failure> {
    match file {
        Some(path) => Ok(write_atomically(path, data)?),
        None => print(data),
    }
}
