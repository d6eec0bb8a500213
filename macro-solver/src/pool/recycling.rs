//! Workers that have done enough are replaced: engines that run for days leak memory.
//!
//! The pool requests such a worker to finish its jobs and to leave, so no job is lost or solved twice.

use super::coordinator::{Action, Coordinator};
use super::workers::WorkerState;
use protocol::control::ToWorker;
use protocol::transport::WorkerId;

impl Coordinator {
    /// Retires a worker that has answered as many jobs as one should.
    pub(super) fn retire_after_jobs(&mut self, worker: WorkerId) {
        let (Some(limit), Some(known)) = (self.settings.recycling.jobs, self.workers.get(worker)) else { return };
        let jobs = self.statistics.workers.get(known.statistics).map_or(0, |figures| figures.jobs);
        if jobs >= limit {
            self.retire(worker, &format!("it has answered {jobs} jobs"));
        }
    }

    /// Retires the workers with jobs in hand that have grown too large; `resident` is the memory of a process, MiB.
    pub(super) fn retire_after_growth(&mut self, resident: impl Fn(u32) -> Option<u64>) {
        let Some(limit) = self.settings.recycling.memory else { return };
        for worker in self.workers.busy() {
            let Some(size) = self.workers.get(worker).and_then(|known| resident(known.pid)) else { continue };
            if size >= limit {
                self.retire(worker, &format!("it has grown to {size} MiB"));
            }
        }
    }

    fn retire(&mut self, worker: WorkerId, reason: &str) {
        let retires = self.workers.edit(worker, |known| {
            let retires = known.is_active();
            if retires {
                known.state = WorkerState::Draining;
            }
            retires
        });
        if retires == Some(true) {
            tracing::info!(worker = worker.0, reason, "worker is replaced by a fresh one");
            self.statistics.workers_recycled += 1;
            self.actions.push(Action::Send(worker, ToWorker::Drain));
        }
    }
}
