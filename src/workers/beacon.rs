//! What a live run tells about itself to `grainspan status`: a small file beside its channels.
//!
//! Whether a run lives is never read from this file but from the process that the channels belong to, so a run that was
//! killed is not mistaken for a live one; the file goes with the channels.

use macro_solver::observer::{FieldsView, Observer, StepReport, StopRequest};
use macro_solver::output::{OutputError, write_atomically};
use macro_solver::pool::WorkerReport;
use protocol::transport::shared_memory::RunRecord;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{SystemTime, UNIX_EPOCH};

/// File name in the directory of a run.
const FILE: &str = "progress.json";

/// How far a run is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progress {
    /// When the run began, s since 1970.
    pub(crate) begun: u64,
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Output folder.
    pub(crate) output: PathBuf,
    /// Accepted steps.
    pub(crate) step: usize,
    /// Share of the path reached, 0 to 1.
    pub(crate) load: f64,
    /// Point evaluations.
    pub(crate) evaluations: u64,
    /// Workers, as the pool saw them at its last report.
    #[serde(default)]
    pub(crate) workers: Vec<WorkerReport>,
}

impl Progress {
    /// A run that begins now.
    pub(crate) fn new(scene: &Path, output: &Path) -> Self {
        let begun = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        // Absolute, as the reader is elsewhere; a folder that cannot be resolved is shown as given.
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let (scene, output) = (absolute(scene), absolute(output));
        Self { begun, scene, output, step: 0, load: 0.0, evaluations: 0, workers: Vec::new() }
    }

    /// What the run with this record last said; `None` when it has not said anything yet.
    pub(crate) fn of(record: &RunRecord) -> Option<Self> {
        serde_json::from_slice(&fs::read(path(record)?).ok()?).ok()
    }
}

fn path(record: &RunRecord) -> Option<PathBuf> {
    Some(record.root.parent()?.join(FILE))
}

/// Keeps the progress of this process's run up to date. Clones tell about the same run: one listens to the solver, one
/// to the pool.
#[derive(Clone, Debug)]
pub(crate) struct RunBeacon(Rc<RefCell<Lamp>>);

#[derive(Debug)]
struct Lamp {
    path: Option<PathBuf>,
    progress: Progress,
}

impl RunBeacon {
    /// Tells about the run with this record.
    pub(crate) fn light(record: &RunRecord, progress: Progress) -> Self {
        let lamp = Lamp { path: path(record), progress };
        lamp.tell();
        Self(Rc::new(RefCell::new(lamp)))
    }

    /// Tells about the workers.
    pub(crate) fn report(&self, workers: &[WorkerReport]) {
        let mut lamp = self.0.borrow_mut();
        lamp.progress.workers = workers.to_vec();
        lamp.tell();
    }
}

impl Lamp {
    /// Only `status` suffers when this fails: no reason to end a run.
    fn tell(&self) {
        if let Err(error) = self.try_tell() {
            tracing::warn!(%error, "`grainspan status` does not see how far this run is");
        }
    }

    fn try_tell(&self) -> Result<(), OutputError> {
        let Some(path) = &self.path else { return Ok(()) };
        write_atomically(path, &serde_json::to_vec(&self.progress).expect("progress is plain data"))
    }
}

impl Observer for RunBeacon {
    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let mut lamp = self.0.borrow_mut();
        lamp.progress.step = report.step;
        lamp.progress.load = report.share;
        lamp.progress.evaluations = fields.statistics.evaluations;
        lamp.tell();
        Ok(())
    }
}
