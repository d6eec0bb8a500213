//! Records of live runs: one small file per run, by which `status` and `clean` find them.
//!
//! A record is a description, never a lock: whether a run lives is read from the process it names, so a run that was
//! killed leaves a record that nobody mistakes for a live one.

use macro_solver::observer::{FieldsView, Observer, StepReport, StopRequest};
use macro_solver::output::{OutputError, write_atomically};
use serde::{Deserialize, Serialize};
use std::fs;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// How far a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progress {
    /// Accepted steps.
    pub(crate) step: usize,
    /// Load factor reached, 0 to 1.
    pub(crate) load: f64,
    /// Point evaluations.
    pub(crate) evaluations: u64,
}

/// What is known of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RunRecord {
    /// Name of the run.
    pub(crate) run: String,
    /// Process id of the macro.
    pub(crate) pid: u32,
    /// Start time of that process in the kernel's count, so that a re-used process id is not mistaken for the run.
    pub(crate) process_start: u64,
    /// When the run began, s since 1970.
    pub(crate) begun: u64,
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Output folder.
    pub(crate) output: PathBuf,
    /// How far it is.
    pub(crate) progress: Progress,
}

impl RunRecord {
    /// A record of a run of this process.
    pub(crate) fn of_this_process(run: &str, scene: &Path, output: &Path) -> Self {
        let pid = std::process::id();
        Self {
            run: run.to_owned(),
            pid,
            process_start: process_start(pid).unwrap_or(0),
            begun: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
            scene: scene.to_owned(),
            output: output.to_owned(),
            progress: Progress::default(),
        }
    }

    /// Whether the macro process still lives.
    pub(crate) fn is_alive(&self) -> bool {
        process_start(self.pid) == Some(self.process_start)
    }
}

/// Start time of a living process, clock ticks since boot; `None` when there is no such process or only its remains.
fn process_start(pid: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The command name in parentheses may itself hold blanks and parentheses; fields are counted from its end.
    let fields: Vec<_> = text.rsplit_once(')')?.1.split_whitespace().collect();
    if matches!(*fields.first()?, "Z" | "X") {
        return None;
    }
    fields.get(19)?.parse().ok()
}

/// The folder that holds the records of one user's runs.
#[derive(Clone, Debug)]
pub(crate) struct RunRegistry {
    folder: PathBuf,
}

impl RunRegistry {
    /// The records of this user: below the session's runtime folder where there is one, else below the temporary
    /// folder.
    pub(crate) fn of_this_user() -> Self {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| folder.is_dir());
        Self::at(match runtime {
            Some(folder) => folder.join("grainspan"),
            None => std::env::temp_dir().join(format!("grainspan-{}", rustix::process::getuid().as_raw())),
        })
    }

    /// The records in this folder.
    pub(crate) fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// Makes a run known until the beacon is dropped.
    ///
    /// # Errors
    /// The record cannot be written.
    pub(crate) fn register(&self, record: RunRecord) -> Result<RunBeacon, OutputError> {
        // For nobody else's eyes: the folder may lie where everybody can look.
        let made = fs::DirBuilder::new().recursive(true).mode(0o700).create(&self.folder);
        made.map_err(|source| OutputError::write(&self.folder, source))?;
        let beacon = RunBeacon { path: self.path_of(&record.run), record };
        beacon.write()?;
        Ok(beacon)
    }

    /// All records, by name. Files that are no records are passed over.
    pub(crate) fn records(&self) -> Vec<RunRecord> {
        let Ok(entries) = fs::read_dir(&self.folder) else { return Vec::new() };
        let files =
            entries.flatten().map(|entry| entry.path()).filter(|path| path.extension() == Some("json".as_ref()));
        let mut records: Vec<RunRecord> =
            files.filter_map(|path| serde_json::from_slice(&fs::read(path).ok()?).ok()).collect();
        records.sort_by(|left, right| left.run.cmp(&right.run));
        records
    }

    /// Removes the record of a run.
    pub(crate) fn forget(&self, run: &str) {
        // Another clean-up may have been faster.
        let _ = fs::remove_file(self.path_of(run));
    }

    fn path_of(&self, run: &str) -> PathBuf {
        self.folder.join(format!("{run}.json"))
    }
}

/// Keeps the record of this process's run up to date, and removes it in the end.
#[derive(Debug)]
pub(crate) struct RunBeacon {
    path: PathBuf,
    record: RunRecord,
}

impl RunBeacon {
    fn write(&self) -> Result<(), OutputError> {
        let text = serde_json::to_vec(&self.record).expect("a record is plain data");
        write_atomically(&self.path, &text)
    }
}

impl Observer for RunBeacon {
    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.record.progress =
            Progress { step: report.step, load: report.load, evaluations: fields.statistics.evaluations };
        if let Err(error) = self.write() {
            // Only `status` suffers: no reason to end a run.
            tracing::warn!(%error, "the record of this run is out of date");
        }
        Ok(())
    }
}

impl Drop for RunBeacon {
    fn drop(&mut self) {
        // Somebody may have cleaned up by hand.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_listed_while_its_beacon_lives() {
        let place = tempfile::tempdir().unwrap();
        let registry = RunRegistry::at(place.path().join("runs"));
        assert!(registry.records().is_empty());
        let record = RunRecord::of_this_process("a-1", Path::new("a.toml"), Path::new("out/a"));
        let beacon = registry.register(record.clone()).unwrap();
        fs::write(place.path().join("runs/noise.json"), "{").unwrap();
        assert_eq!(registry.records(), [record.clone()]);
        assert!(record.is_alive());
        drop(beacon);
        assert!(registry.records().is_empty());
    }

    #[test]
    fn a_reused_process_id_is_not_taken_for_the_run() {
        let mut record = RunRecord::of_this_process("a-1", Path::new("a.toml"), Path::new("out/a"));
        record.process_start += 1;
        assert!(!record.is_alive());
        record.pid = u32::MAX;
        assert!(!record.is_alive());
    }
}
