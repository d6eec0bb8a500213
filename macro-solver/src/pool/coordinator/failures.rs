//! Lost, hung and faulty workers: their jobs go to others, and a job that has ended too many stops the run.

use super::{Action, Coordinator};
use crate::checkpoint::FailureCase;
use crate::material::MaterialError;
use crate::pool::workers::{HangReason, WorkerState};
use protocol::transport::WorkerId;
use std::time::Instant;

impl Coordinator {
    /// A worker is gone. If `suspicious`, the jobs that it was working on may have ended it.
    pub(super) fn handle_loss(&mut self, worker: WorkerId, reason: &str, suspicious: bool) {
        let Some(known) = self.workers.get(worker) else { return };
        let (pid, state) = (known.pid, known.state);
        let had_answered = self.statistics.workers.get(known.statistics).is_some_and(|figures| figures.jobs > 0);
        if state != WorkerState::Refused {
            tracing::warn!(worker = worker.0, pid, reason, "worker lost");
            self.statistics.workers_lost += u64::from(state != WorkerState::Leaving);
            self.statistics.workers_cut_off += u64::from(state != WorkerState::Leaving && !suspicious);
            self.last_trouble = Some(format!("worker {} (process {pid}): {reason}", worker.0));
            let left = state == WorkerState::Leaving;
            self.actions.push(if left { Action::Left(pid, had_answered) } else { Action::Gone(pid, had_answered) });
        }
        if state.answers() && suspicious {
            self.record_failure_of_head(worker, reason, 0);
        }
        self.requeue_all(worker);
        self.workers.remove(worker);
        self.batch.queue.unassign(worker);
    }

    /// Only the message at the head was under way; the others have no part in it.
    fn record_failure_of_head(&mut self, worker: WorkerId, reason: &str, overruns: u32) {
        let Some(known) = self.workers.get(worker) else { return };
        for number in known.pending.front().map_or_else(Vec::new, |message| message.jobs.clone()) {
            if let Some(index) = self.batch.index_of(number) {
                self.batch.jobs[index].overruns += overruns;
                self.record_failure(index, reason);
            }
        }
    }

    fn record_failure(&mut self, index: usize, reason: &str) {
        if !self.batch.is_needed(index) {
            return;
        }
        let limit = self.settings.quarantine_after;
        let job = &mut self.batch.jobs[index];
        job.failures.push(reason.to_owned());
        if job.failure_count() >= limit && self.fatal.is_none() {
            let text = format!(
                "Gauss point {} has ended {} workers with the same trial (last: {reason}); displacement gradient {:?} from \
                 state {}; the run stops before it ends more",
                job.trial.point,
                job.failure_count(),
                job.trial.target.0,
                job.state.id
            );
            self.quarantined = Some(FailureCase {
                program: format!("grainspan {}", env!("CARGO_PKG_VERSION")),
                engine: self.settings.engines.get(job.definition).cloned().unwrap_or_default(),
                point: job.trial.point as u64,
                failures: job.failures.clone(),
                definition: self.points.definitions[job.definition].1.clone(),
                state: job.state.bytes.to_vec(),
                target: job.trial.target,
                tangent: job.trial.options.tangent,
                ramp_steps: job.trial.options.ramp_steps,
                observables: job.trial.options.observables,
                friction_reduction: job.trial.options.friction_reduction,
            });
            self.fatal = Some(MaterialError::WorkersLost(text));
        }
    }

    pub(super) fn requeue_all(&mut self, worker: WorkerId) {
        let held = self.workers.edit(worker, |known| std::mem::take(&mut known.pending));
        for number in held.into_iter().flatten().flat_map(|message| message.jobs) {
            if let Some(index) = self.batch.index_of(number) {
                self.reissue(index);
            }
        }
    }

    /// Gives a job of a lost or faulty worker to another, after a delay if the next loss would be the last; nobody gets one that is no longer
    /// needed.
    fn reissue(&mut self, index: usize) {
        if !self.batch.is_needed(index) {
            return self.abandon(index);
        }
        self.statistics.reissued += 1;
        let (job, limit) = (&self.batch.jobs[index], self.settings.quarantine_after);
        if !job.failures.is_empty() && job.failure_count().saturating_add(1) == limit {
            let (point, failures, delay) = (job.trial.point, job.failure_count(), self.settings.retry_delay);
            tracing::warn!(
                point,
                failures,
                ?delay,
                "this trial has ended workers; it is delayed before the next one gets it"
            );
            self.batch.requeue_delayed(index);
        } else {
            self.batch.requeue(index);
        }
    }

    /// Queues a job again that its worker could not begin with, unless it is no longer needed.
    pub(super) fn queue_again(&mut self, index: usize) {
        if self.batch.is_needed(index) {
            self.batch.requeue(index);
        } else {
            self.abandon(index);
        }
    }

    fn abandon(&mut self, index: usize) {
        self.batch.drop_sent(index);
        self.statistics.abandoned += 1;
    }

    /// After an invalid reply the worker is ended and its job goes to another.
    pub(super) fn terminate_for(&mut self, worker: WorkerId, index: usize, fault: &str) {
        tracing::error!(worker = worker.0, point = self.batch.jobs[index].trial.point, fault, "invalid reply");
        self.statistics.workers_faulty += 1;
        self.record_failure(index, fault);
        self.reissue(index);
        self.terminate(worker);
    }

    fn terminate(&mut self, worker: WorkerId) {
        if self.workers.edit(worker, |known| known.state = WorkerState::Terminated).is_some() {
            self.actions.push(Action::Kill(worker));
        }
    }

    /// Ends the workers that have been silent or stopped for too long.
    pub(in crate::pool) fn terminate_hung(&mut self, now: Instant) {
        for (worker, hang_reason) in self.workers.hung(now, &self.settings.hang) {
            let (reason, overruns) = match hang_reason {
                HangReason::Stopped(reason) => (reason, 0),
                HangReason::Silent(reason) => (reason, 1),
            };
            tracing::error!(worker = worker.0, reason, "worker is ended");
            self.statistics.workers_hung += 1;
            self.record_failure_of_head(worker, &reason, overruns);
            self.terminate(worker);
        }
    }

    /// The channel to this worker did not take a message.
    pub(in crate::pool) fn undeliverable(&mut self, worker: WorkerId, reason: &str) {
        tracing::warn!(worker = worker.0, reason, "message not delivered");
        self.terminate(worker);
    }
}
