//! Whole files, or none.

use super::OutputError;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Writes `bytes` to `path` so that the file is either complete or as it was before: a temporary file beside it is
/// written, flushed to the disk and renamed. Something that is not a regular file (a device, a pipe) is written directly.
///
/// # Errors
/// [`OutputError::Write`]; the temporary file is removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write(path, bytes, true)
}

/// As [`write_atomically`], but without waiting for the disk: for what is written in every step and read by people. The file is whole
/// however this process ends; after a power cut the latest ones may be missing, as is everything since the last checkpoint. Waiting took
/// up to a seventh of a run.
///
/// # Errors
/// [`OutputError::Write`]; the temporary file is removed.
pub fn write_without_flush(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write(path, bytes, false)
}

fn write(path: &Path, bytes: &[u8], flush: bool) -> Result<(), OutputError> {
    if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return OpenOptions::new()
            .write(true)
            .open(path)
            .and_then(|mut target| target.write_all(bytes))
            .map_err(|source| OutputError::write(path, source));
    }
    let temporary = temporary_name(path);
    let written = write_and_rename(&temporary, path, bytes, flush);
    if written.is_err() {
        // The first error is the one worth telling; a temporary file that was never made cannot be removed.
        let _ = fs::remove_file(&temporary);
    }
    written.map_err(|source| OutputError::write(path, source))
}

fn write_and_rename(temporary: &Path, path: &Path, bytes: &[u8], flush: bool) -> std::io::Result<()> {
    let mut file = File::create(temporary)?;
    file.write_all(bytes)?;
    if flush {
        file.sync_data()?;
    }
    fs::rename(temporary, path)
}

/// Tries whether [`write_atomically`] could begin with `path`, and leaves nothing there. Something that is not a regular file is not tried.
///
/// # Errors
/// [`OutputError::Write`]: no file can be made in its folder.
pub fn try_place(path: &Path) -> Result<(), OutputError> {
    if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Ok(());
    }
    let temporary = temporary_name(path);
    let tried = File::create(&temporary).and_then(|_| fs::remove_file(&temporary));
    tried.map_err(|source| OutputError::write(path, source))
}

/// Removes what a process left in a folder that ended while it wrote a file.
///
/// # Errors
/// [`OutputError::Write`].
pub fn remove_drafts(folder: &Path) -> Result<(), OutputError> {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_draft(&entry.file_name().to_string_lossy()) {
            match fs::remove_file(entry.path()) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    return Err(OutputError::write(&entry.path(), error));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Whether files have such names while they are written, see [`write_atomically`].
pub fn is_draft(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

/// `.NAME.PID.partial` in the same folder: renaming is atomic only within one file system.
fn temporary_name(path: &Path) -> PathBuf {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!(".{name}.{}.partial", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_write_leaves_the_old_file_and_no_temporary() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.txt");
        for write in [write_atomically, write_without_flush] {
            write(&path, b"old").unwrap();
            // A folder in the way of the temporary name makes the write fail at its first step.
            fs::create_dir(temporary_name(&path)).unwrap();
            assert!(write(&path, b"new").is_err());
            assert_eq!(fs::read(&path).unwrap(), b"old");
            fs::remove_dir(temporary_name(&path)).unwrap();
            write(&path, b"new").unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"new");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn a_full_disk_is_named_with_its_remedy() {
        let error = write_atomically(Path::new("/dev/full"), b"anything").unwrap_err();
        let text = error.to_string();
        assert!(text.contains("/dev/full") && text.contains("hint: free some space"), "{text}");
    }
}
