//! The output folder of a run: created only when all input has been checked, and never over foreign files.

use crate::exit::Failure;
use crate::folder_lock::{holds_a_run, lock_folder};
use macro_solver::output::{OutputError, is_draft, remove_drafts, write_atomically};
use page::Controls;
use scene_reader::{InputCopy, InputError};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Everything that a run writes; these names are replaced in a folder of an earlier run, in this order: a folder that is
/// half emptied when the system fails must not look complete.
const FILES: [&str; 17] = [
    "summary.json",
    "scene.toml",
    "checkpoint.bin",
    "checkpoint.previous.bin",
    ".checkpoint.partial",
    "quarantine.replay",
    "history.csv",
    "history.svg",
    "fields.pvd",
    "gauss_points.pvd",
    "packing.json",
    "mesh.msh",
    "probe_errors.csv",
    "units.json",
    // Written by `--listen`, and removed when such a run ends.
    "join",
    "join.part",
    REPORT,
];

/// Written by `grainspan report`; of no use next to another run.
const REPORT: &str = "report.html";

/// The log, which every run begins with.
const LOG: &str = "run.jsonl";

/// Folders that a run fills.
const FOLDERS: [&str; 7] = ["cells", "control", "fields", "grains", "packings", "points", "profiles"];

/// Whether a run gives such names to files in one of its folders. Profiles are called as the scene says.
fn is_of_a_run(folder: &str, name: &str) -> bool {
    let named = |beginning: &str, ending: &str| name.starts_with(beginning) && name.ends_with(ending);
    let is_number = |stem: &str| !stem.is_empty() && stem.bytes().all(|byte| byte.is_ascii_digit() || byte == b'-');
    match folder {
        "cells" => named("point-", ".json"),
        "fields" => named("step-", ".vtu") || named("gauss-points-", ".vtp"),
        "grains" => ["point-", "contacts-"].iter().any(|what| named(what, ".vtp") || named(what, ".pvd")),
        "packings" => name.strip_suffix(".json").is_some_and(is_number),
        "points" => named("point-", ".csv"),
        "profiles" => named("", ".csv"),
        _ => !name.contains('.'),
    }
}

/// A folder that is ready to be written to.
#[derive(Debug)]
pub(super) struct OutputFolder {
    path: PathBuf,
    /// Held as long as the run writes: two processes that continue one run would spoil it.
    _lock: File,
}

impl OutputFolder {
    /// Makes the folder, or empties that of an earlier run, and writes the scene and the files that it names into it. A folder that
    /// cannot take even these is removed again if it was new.
    ///
    /// # Errors
    /// The path is a file, or a folder with files that are not a run's; the system refuses.
    pub(super) fn prepare(path: &Path, scene: &str, files: &[&InputCopy]) -> Result<Self, Failure> {
        refuse_foreign(path)?;
        let is_new = !path.exists();
        fs::create_dir_all(path).map_err(|source| OutputError::write(path, source))?;
        let folder = Self { path: path.to_owned(), _lock: lock(path)? };
        let filled = folder.fill(scene, files);
        if filled.is_err() && is_new {
            // The error that is reported is the one that matters; what cannot be removed was never made.
            let _ = fs::remove_dir_all(path);
        }
        filled?;
        Ok(folder)
    }

    /// Takes the folder of a run that is continued as it is, without the traces of a write that was cut short.
    ///
    /// # Errors
    /// Another process writes to it, or the system refuses.
    pub(super) fn reopen(path: &Path) -> Result<Self, Failure> {
        let folder = Self { path: path.to_owned(), _lock: lock(path)? };
        remove_drafts(path)?;
        for name in FOLDERS {
            remove_drafts(&path.join(name))?;
        }
        Controls::of(path).clear();
        // It tells of the rows so far.
        let report = path.join(REPORT);
        absent(fs::remove_file(&report)).map_err(|source| OutputError::write(&report, source))?;
        Ok(folder)
    }

    /// Where it lies.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    fn fill(&self, scene: &str, files: &[&InputCopy]) -> Result<(), OutputError> {
        for name in FILES {
            let file = self.path.join(name);
            absent(fs::remove_file(&file)).map_err(|source| OutputError::write(&file, source))?;
        }
        for name in FOLDERS {
            let below = self.path.join(name);
            absent(fs::remove_dir_all(&below)).map_err(|source| OutputError::write(&below, source))?;
        }
        remove_drafts(&self.path)?;
        let log = self.path.join(LOG);
        // What the run writes from here on stands next to a log.
        File::create(&log).map_err(|source| OutputError::write(&log, source))?;
        for copy in files {
            let file = self.path.join(&copy.name);
            if let Some(parent) = file.parent() {
                fs::create_dir_all(parent).map_err(|source| OutputError::write(parent, source))?;
            }
            write_atomically(&file, copy.text.as_bytes())?;
        }
        write_atomically(&self.path.join("scene.toml"), scene.as_bytes())
    }
}

fn lock(path: &Path) -> Result<File, Failure> {
    let hint = "wait for its end, stop it (`grainspan status` shows its process), or name another folder";
    lock_folder(path, "--out", "run", hint)
}

/// Refuses a folder that a run writes to now: what else may be wrong with continuing it does not matter then.
///
/// # Errors
/// One does.
pub(super) fn refuse_live(path: &Path) -> Result<(), Failure> {
    if path.is_dir() { lock(path).map(drop) } else { Ok(()) }
}

/// A missing file need not be removed.
fn absent(removed: std::io::Result<()>) -> std::io::Result<()> {
    match removed {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Refuses a folder that a run would have to empty of what no run has written.
///
/// # Errors
/// The path is a file, or the folder holds something else than the files of an earlier run.
pub(super) fn refuse_foreign(path: &Path) -> Result<(), InputError> {
    let unusable = |problem: String| InputError::at(format!("--out {}", path.display()), problem);
    if path.exists() && !path.is_dir() {
        return Err(unusable("this is a file, not a folder".to_owned()).hint("name a folder that may be created"));
    }
    // Whatever else in it may be called as those of a run are.
    let has_run = holds_a_run(path);
    for entry in fs::read_dir(path).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let foreign = if !has_run {
            Some(name)
        } else if entry.path().is_dir() {
            let is_known = FOLDERS.contains(&name.as_str());
            if is_known { foreign_within(&entry.path(), &name) } else { Some(name) }
        } else {
            let is_known = name == LOG || FILES.contains(&name.as_str()) || is_draft(&name);
            (!is_known).then_some(name)
        };
        if let Some(foreign) = foreign {
            return Err(unusable(format!("the folder holds '{foreign}', which no run has written"))
                .hint("name an empty or new folder; an earlier run's files would be replaced, others never are"));
        }
    }
    Ok(())
}

/// The first entry of one of the folders of a run that no run has written.
fn foreign_within(path: &Path, folder: &str) -> Option<String> {
    fs::read_dir(path).into_iter().flatten().flatten().find_map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_ours = !entry.path().is_dir() && (is_of_a_run(folder, &name) || is_draft(&name));
        (!is_ours).then(|| format!("{folder}/{name}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use macro_solver::checkpoint::{Archive, CheckpointFile};

    #[test]
    fn an_earlier_run_is_replaced_and_foreign_files_are_never_touched() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        OutputFolder::prepare(&path, "a = 1", &[]).unwrap();
        fs::write(path.join("history.csv"), "old").unwrap();
        fs::write(path.join("report.html"), "old").unwrap();
        fs::write(path.join("mesh.msh"), "old").unwrap();
        fs::create_dir(path.join("fields")).unwrap();
        fs::write(path.join("fields/step-0001.vtu"), "old").unwrap();
        fs::write(path.join(".history.csv.99.partial"), "cut short").unwrap();
        let packing = InputCopy { key: "packing".into(), name: "packings/0-0.json".into(), text: "{}".into() };
        let second = OutputFolder::prepare(&path, "a = 2", &[&packing]).unwrap();
        assert!(!path.join(".history.csv.99.partial").exists());
        let taken = OutputFolder::reopen(&path).unwrap_err();
        assert!(taken.message.contains("another run writes"), "{}", taken.message);
        assert_eq!(refuse_live(&path).unwrap_err().message, taken.message);
        drop(second);
        refuse_live(&path).unwrap();
        refuse_live(&place.path().join("none")).unwrap();
        OutputFolder::reopen(&path).unwrap();
        assert!(!path.join("report.html").exists() && !path.join("mesh.msh").exists());
        assert!(!path.join("history.csv").exists() && !path.join("fields").exists());
        assert_eq!(fs::read_to_string(path.join("scene.toml")).unwrap(), "a = 2");

        let refused = || OutputFolder::prepare(&path, "a = 3", &[]).unwrap_err().message;
        for (name, told) in [
            ("fields/mine.txt", "fields/mine.txt"),
            ("points/lab.csv", "points/lab.csv"),
            ("packings/mine.json", "packings/mine.json"),
            ("cells/raw/lab.csv", "cells/raw"),
            ("thesis.txt", "thesis.txt"),
        ] {
            let file = path.join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(&file, "mine").unwrap();
            assert!(refused().contains(told), "{name}: {}", refused());
            fs::remove_file(&file).unwrap();
            // The folders `points`, `cells` and so on are a run's, one within them is not.
            let _ = fs::remove_dir(path.join("cells/raw"));
        }
        assert_eq!(fs::read_to_string(path.join("scene.toml")).unwrap(), "a = 2");
    }

    /// A project with names that a run uses too is no folder of a run.
    #[test]
    fn a_folder_that_no_run_has_made_is_not_emptied() {
        let place = tempfile::tempdir().unwrap();
        // A specimen keeps its checkpoints under the same name.
        let mut archive = Archive::new();
        archive.put("specimen", 1, &0);
        CheckpointFile::in_folder(place.path()).write(&archive).unwrap();
        let refusal = OutputFolder::prepare(place.path(), "a = 1", &[]).unwrap_err().message;
        assert!(refusal.contains("holds 'checkpoint.bin', which no run has written"), "{refusal}");
        assert!(place.path().join("checkpoint.bin").is_file());
        fs::remove_file(place.path().join("checkpoint.bin")).unwrap();
        for name in ["scene.toml", "packings/mine.json"] {
            let file = place.path().join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(&file, "mine").unwrap();
            let refusal = OutputFolder::prepare(place.path(), "a = 1", &[]).unwrap_err().message;
            assert!(refusal.contains("which no run has written"), "{refusal}");
            assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
            fs::remove_file(&file).unwrap();
        }
        assert!(
            OutputFolder::prepare(place.path(), "a = 1", &[]).is_err(),
            "an empty folder of packings is somebody's"
        );
    }
}
