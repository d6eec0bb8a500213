//! Workers that have done enough make room for fresh ones: engines that run for days leak.
//!
//! The pool asks such a worker to finish what it holds and to leave, so nothing is lost and nothing is done twice.

use super::coordinator::{Action, Coordinator};
use super::workers::WorkerState;
use protocol::control::ToWorker;
use protocol::transport::WorkerId;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fs;

/// When a worker has done enough; `None`: never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Recycling {
    /// Answered jobs after which a worker, of any engine, is replaced by a fresh one.
    #[serde(rename = "recycle_jobs")]
    #[schemars(extend("x-default" = "never"))]
    pub jobs: Option<u64>,
    /// Resident memory from which a worker, of any engine, is replaced by a fresh one.
    #[serde(rename = "recycle_memory")]
    #[schemars(extend("x-unit" = "MiB", "x-default" = "never"))]
    pub memory: Option<u64>,
}

impl Coordinator {
    /// Retires a worker that has answered as many jobs as one should.
    pub(super) fn retire_when_worn(&mut self, worker: WorkerId) {
        let (Some(limit), Some(known)) = (self.settings.recycling.jobs, self.workers.get(worker)) else { return };
        let jobs = self.statistics.workers.get(known.statistics).map_or(0, |figures| figures.jobs);
        if jobs >= limit {
            self.retire(worker, &format!("it has answered {jobs} jobs"));
        }
    }

    /// Retires the workers with jobs in hand that have grown too large; `resident` tells a process' memory, MiB.
    pub(super) fn retire_the_large(&mut self, resident: impl Fn(u32) -> Option<u64>) {
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
            tracing::info!(worker = worker.0, reason, "worker is asked to make room for a fresh one");
            self.statistics.workers_recycled += 1;
            self.actions.push(Action::Send(worker, ToWorker::Drain));
        }
    }
}

/// Resident memory of a process, MiB; `None` when it cannot be seen from here.
pub(super) fn resident_mebibytes(pid: u32) -> Option<u64> {
    let told = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? >> 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_tells_how_large_a_process_is() {
        let hoard = std::hint::black_box(vec![1u8; 32 << 20]);
        assert!(resident_mebibytes(std::process::id()).is_some_and(|size| (32..100_000).contains(&size)));
        drop(hoard);
        assert_eq!(resident_mebibytes(u32::MAX), None);
    }
}
