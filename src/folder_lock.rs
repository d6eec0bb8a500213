//! Folders that one process at a time writes to.

use crate::exit::Failure;
use macro_solver::output::OutputError;
use scene_reader::InputError;
use std::fs::{File, TryLockError};
use std::path::Path;

/// Locks a folder until what is returned is dropped; the system releases the lock when the process ends, however it ends. `option` is that of
/// the command line which names the folder, and `writer` what may write to it.
///
/// # Errors
/// Another process holds it, or the folder cannot be opened.
pub(crate) fn lock_folder(path: &Path, option: &str, writer: &str, hint: &str) -> Result<File, Failure> {
    let folder = File::open(path).map_err(|source| OutputError::write(path, source))?;
    match folder.try_lock() {
        // A file system without locks has no better to offer.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(folder),
        Err(TryLockError::WouldBlock) => {
            let problem = format!("another {writer} writes to this folder now");
            Err(InputError::at(format!("{option} {}", path.display()), problem).hint(hint).into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_writer_at_a_time() {
        let place = tempfile::tempdir().unwrap();
        let lock = || lock_folder(place.path(), "--out", "study", "name another folder");
        let first = lock().unwrap();
        let refused = lock().unwrap_err();
        assert!(refused.message.contains("another study writes") && refused.message.contains("name another folder"));
        drop(first);
        lock().unwrap();
    }
}
