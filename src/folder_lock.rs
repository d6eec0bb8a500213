//! Output folders: one process at a time writes to them, and those of runs are for runs alone.

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
        Ok(()) => Ok(folder),
        Err(TryLockError::Error(reason)) => {
            tracing::warn!(
                folder = %path.display(),
                %reason,
                "the folder cannot be locked on this file system: see to it that nothing else writes to it meanwhile"
            );
            Ok(folder)
        }
        Err(TryLockError::WouldBlock) => {
            let problem = format!("another {writer} writes to this folder now");
            Err(InputError::at(format!("{option} {}", path.display()), problem).hint(hint).into())
        }
    }
}

/// Files of which the folder of a run holds one at least.
pub(crate) const MARKS_OF_A_RUN: [&str; 2] = ["run.jsonl", "checkpoint.bin"];

/// Refuses the folder of a run for tables and pictures of something else: no run would replace them, and so none could use it again.
///
/// # Errors
/// The folder is that of a run.
pub(crate) fn refuse_folder_of_a_run(path: &Path) -> Result<(), InputError> {
    if !MARKS_OF_A_RUN.iter().any(|mark| path.join(mark).is_file()) {
        return Ok(());
    }
    let problem = "this is the folder of a run, which could not be made again in it";
    Err(InputError::at(format!("--out {}", path.display()), problem).hint("name another folder"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_runs_are_not_for_anything_else() {
        let place = tempfile::tempdir().unwrap();
        refuse_folder_of_a_run(&place.path().join("new")).unwrap();
        std::fs::write(place.path().join("table.csv"), "a").unwrap();
        refuse_folder_of_a_run(place.path()).unwrap();
        std::fs::write(place.path().join("run.jsonl"), "").unwrap();
        let refused = refuse_folder_of_a_run(place.path()).unwrap_err().to_string();
        assert!(refused.contains("the folder of a run") && refused.contains("name another folder"), "{refused}");
    }

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
