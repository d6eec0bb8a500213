//! Report about the workers while a run goes on.

use super::coordinator::Coordinator;
use super::workers::WorkerState;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Listens to the pool.
pub type Reporter = Box<dyn FnMut(&[WorkerReport])>;

/// One worker at this moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorkerReport {
    /// Number in the run.
    pub worker: u32,
    /// Process id.
    pub pid: u32,
    /// Jobs answered.
    pub jobs: u64,
    /// Time that it reported for these, s.
    pub busy_s: f64,
    /// Gauss point of the job that it is working on.
    pub point: Option<u64>,
    /// How long it has been working on it, s.
    pub since_s: f64,
}

/// All workers that have not ended, by number.
pub(super) fn of(coordinator: &Coordinator, now: Instant) -> Vec<WorkerReport> {
    let known = coordinator.workers.iter().filter(|(_, worker)| worker.state != WorkerState::Refused);
    known
        .map(|(id, worker)| {
            let figures = coordinator.statistics.workers.get(worker.statistics);
            let head = worker.pending.front().and_then(|message| message.jobs.first());
            let job = head.and_then(|number| coordinator.batch.index_of(*number));
            WorkerReport {
                worker: id.0,
                pid: worker.pid,
                jobs: figures.map_or(0, |figures| figures.jobs),
                busy_s: figures.map_or(0.0, |figures| figures.busy_s),
                point: job.map(|index| coordinator.batch.jobs[index].trial.point as u64),
                since_s: job.map_or(0.0, |_| now.saturating_duration_since(worker.head_since).as_secs_f64()),
            }
        })
        .collect()
}
