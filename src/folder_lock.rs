//! Output folders: one process at a time writes to them, and those of runs are for runs alone.

use crate::exit::Failure;
use macro_solver::checkpoint::{CheckpointFile, StoredCheckpoint};
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

/// Section that the checkpoints of runs have, and those of specimens, in files of the same name, have not.
pub(crate) const SECTION_OF_RUNS: &str = "run";

/// Whether a run has written to this folder: there is its log, or a checkpoint of one.
pub(crate) fn holds_a_run(path: &Path) -> bool {
    let is_of_a_run =
        |stored| matches!(stored, StoredCheckpoint::Archive(archive, _) if archive.holds(SECTION_OF_RUNS));
    path.join("run.jsonl").is_file() || CheckpointFile::in_folder(path).read().is_ok_and(is_of_a_run)
}

/// Refuses the folder of a run for tables and pictures of something else: no run would replace them, and so none could use it again.
/// `option` is that of the command line which names the folder.
///
/// # Errors
/// The folder is that of a run.
pub(crate) fn refuse_folder_of_a_run(option: &str, path: &Path) -> Result<(), InputError> {
    if !holds_a_run(path) {
        return Ok(());
    }
    let problem = "this is the folder of a run, which could not be made again in it";
    Err(InputError::at(format!("{option} {}", path.display()), problem).hint("name another folder"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use macro_solver::checkpoint::Archive;

    #[test]
    fn folders_of_runs_are_not_for_anything_else() {
        let place = tempfile::tempdir().unwrap();
        let refuse = || refuse_folder_of_a_run("--pictures", place.path()).map_err(|error| error.to_string());
        refuse_folder_of_a_run("--pictures", &place.path().join("new")).unwrap();
        std::fs::write(place.path().join("table.csv"), "a").unwrap();
        refuse().unwrap();
        // Pictures of a specimen may lie next to its checkpoint.
        for (section, is_refused) in [("specimen", false), (SECTION_OF_RUNS, true)] {
            let mut archive = Archive::new();
            archive.put(section, 1, &0);
            CheckpointFile::in_folder(place.path()).write(&archive).unwrap();
            assert_eq!(refuse().is_err(), is_refused, "{section}");
        }
        CheckpointFile::in_folder(place.path()).remove().unwrap();
        std::fs::write(place.path().join("run.jsonl"), "").unwrap();
        let refused = refuse().unwrap_err();
        assert!(refused.contains("--pictures") && refused.contains("the folder of a run"), "{refused}");
        assert!(refused.contains("name another folder"), "{refused}");
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
