//! The status file of a live run, which `grainspan status` reads: a small file next to its channels.
//!
//! Whether a run is alive is never read from this file but from the process that owns the channels, so that a killed run is not
//! mistaken for a live one; the file is removed with the channels.

use macro_solver::observer::{FieldsView, Observer, Statistics, StepReport, StopRequest};
use macro_solver::output::{OutputError, write_without_flush};
use macro_solver::pool::WorkerReport;
use protocol::transport::shared_memory::{RunDirectory, RunRecord};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{SystemTime, UNIX_EPOCH};

/// File name in the directory of a run.
const FILE: &str = "progress.json";

/// Progress of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RunProgress {
    /// Start of the run, s since 1970.
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
    /// Where time has gone up to the last step, s: the names of `time` in `summary.json`.
    #[serde(default)]
    pub(crate) time: BTreeMap<String, f64>,
    /// Counters up to the last step, of the macro process: the names of `fallbacks` in `summary.json`.
    #[serde(default)]
    pub(crate) fallbacks: BTreeMap<String, u64>,
    /// Workers, as the pool saw them at its last report.
    #[serde(default)]
    pub(crate) workers: Vec<WorkerReport>,
}

impl RunProgress {
    /// A run that begins now.
    pub(crate) fn new(scene: &Path, output: &Path) -> Self {
        let begun = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        // Absolute, as the reader is elsewhere; a folder that cannot be resolved is shown as given.
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let (scene, output) = (absolute(scene), absolute(output));
        Self {
            begun,
            scene,
            output,
            step: 0,
            load: 0.0,
            evaluations: 0,
            time: BTreeMap::new(),
            fallbacks: BTreeMap::new(),
            workers: Vec::new(),
        }
    }

    /// The last status of the run with this record; `None` if it has not written any yet.
    pub(crate) fn of(record: &RunRecord) -> Option<Self> {
        serde_json::from_slice(&fs::read(path(record)?).ok()?).ok()
    }
}

/// Progress of the live run of this user on this machine that writes to a folder; `None` if there is none.
pub(crate) fn run_that_writes_to(folder: &Path) -> Option<RunProgress> {
    let whole = folder.canonicalize().ok()?;
    let alive = RunDirectory::list().ok()?.into_iter().filter(|listing| listing.alive);
    let mut known = alive.filter_map(|listing| RunProgress::of(listing.record.as_ref()?));
    known.find(|progress| progress.output.canonicalize().is_ok_and(|output| output == whole))
}

fn path(record: &RunRecord) -> Option<PathBuf> {
    Some(record.root.parent()?.join(FILE))
}

/// Writes the status of this process's run. Clones write the same file: one observes the solver, one receives the reports of the
/// pool.
#[derive(Clone, Debug)]
pub(crate) struct StatusFile(Rc<RefCell<Inner>>);

#[derive(Debug)]
struct Inner {
    path: Option<PathBuf>,
    progress: RunProgress,
}

impl StatusFile {
    /// Writes the first status of the run with this record.
    pub(crate) fn create(record: &RunRecord, progress: RunProgress) -> Self {
        let inner = Inner { path: path(record), progress };
        inner.write();
        Self(Rc::new(RefCell::new(inner)))
    }

    /// Writes the state of the workers.
    pub(crate) fn report(&self, workers: &[WorkerReport]) {
        let mut inner = self.0.borrow_mut();
        inner.progress.workers = workers.to_vec();
        inner.write();
    }
}

impl Inner {
    /// Failure affects only `grainspan status`; the run goes on.
    fn write(&self) {
        if let Err(error) = self.try_write() {
            tracing::warn!(%error, "the status file could not be written; `grainspan status` shows no progress of this run");
        }
    }

    fn try_write(&self) -> Result<(), OutputError> {
        let Some(path) = &self.path else { return Ok(()) };
        write_without_flush(path, &serde_json::to_vec(&self.progress).expect("progress is plain data"))
    }
}

impl Observer for StatusFile {
    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let mut inner = self.0.borrow_mut();
        inner.progress.step = report.step;
        inner.progress.load = report.share;
        inner.progress.evaluations = fields.statistics.evaluations;
        let known = fields.statistics;
        let times = [
            ("rve_s", known.cost.solve_nanoseconds),
            ("tangent_s", known.cost.tangent_nanoseconds),
            ("assembly_s", known.assembly_nanoseconds),
            ("linear_solver_s", known.linear_solver_nanoseconds),
        ];
        inner.progress.time = times.map(|(name, nanoseconds)| (name.to_owned(), nanoseconds as f64 * 1e-9)).into();
        inner.progress.fallbacks = counters(known);
        inner.write();
        Ok(())
    }
}

fn counters(known: &Statistics) -> BTreeMap<String, u64> {
    let flags = &known.flags;
    [
        ("not_equilibrated", flags.not_equilibrated),
        ("large_overlap", flags.large_overlap),
        ("no_load_bearing_contacts", flags.no_load_bearing_contacts),
        ("damping_changed", flags.damping_changed),
        ("handed_over", flags.handed_over),
        ("unfinished_trials", known.unfinished_trials),
        ("steps_stabilised", known.stabilised_steps),
        ("error_above_wanted", known.accuracy.missed_steps),
        ("tangent_fallback", flags.tangent_fallback),
        ("tangent_regularised", flags.tangent_regularised),
        ("tangent_floored", known.floored_tangents),
        ("rejected_iterates", known.rejected),
        ("cutbacks", known.cut_backs),
    ]
    .map(|(name, count)| (name.to_owned(), count))
    .into()
}
