//! Which worker gets which jobs next.

use super::Coordinator;
use crate::pool::workers::PendingMessage;
use protocol::StateId;
use protocol::transport::{LoadedJob, WorkerId};
use protocol::wire::{TrialJob, TrialReply};
use std::time::{Duration, Instant};

/// From this number of workers of a group on, a message holds a quarter of a worker's share at most. Costs differ from what was expected, and
/// the slowest of many workers differs more; few workers gain more from long messages, whose jobs they solve side by side. See
/// `docs/lab-book/hosts.md`.
const MANY_WORKERS: usize = 64;

/// A message of jobs to be sent; it is booked as sent already.
pub(in crate::pool) struct JobMessage {
    pub(in crate::pool) worker: WorkerId,
    /// Definitions (by index) that must be sent first.
    pub(in crate::pool) define: Vec<usize>,
    /// Jobs (by index in the batch).
    pub(in crate::pool) jobs: Vec<usize>,
}

impl Coordinator {
    /// The next message and its receiver; `None` when no job waits or no worker is free.
    pub(in crate::pool) fn next_message(&mut self, now: Instant) -> Option<JobMessage> {
        self.batch.release_delayed(now, self.settings.retry_delay);
        self.batch.queue.groups().into_iter().find_map(|group| self.next_of_group(group, now))
    }

    /// The jobs of a message as they travel.
    pub(in crate::pool) fn loaded(&self, message: &JobMessage) -> Vec<LoadedJob<'_>> {
        let of_job = |&index: &usize| {
            let job = &self.batch.jobs[index];
            job.loaded(self.points.definitions[job.definition].0)
        };
        message.jobs.iter().map(of_job).collect()
    }

    fn next_of_group(&mut self, group: usize, now: Instant) -> Option<JobMessage> {
        let waiting = self.batch.queue.waiting(group);
        let active = self.workers.active_in(group);
        if active == 0 {
            return None;
        }
        let worker = self.workers.idle(group).or_else(|| self.ahead_of_time(group, active))?;
        // A share of what waits, so that the last messages are short; but jobs that the worker solves side by side take it no longer than
        // a part of them would, unless other workers have nothing to do.
        let side_by_side = self.workers.get(worker).map_or(1, |known| known.side_by_side);
        let together = side_by_side.min(waiting.div_ceil(self.workers.idle_in(group).max(1)));
        let most = self.settings.jobs_per_message.get().min(waiting.div_ceil(active).max(together));
        // No message holds more than one worker's share of all work that is left: the longest jobs go first, and a message
        // full of them would keep all others waiting for its worker.
        let left = self.batch.queue.expected(group) + self.workers.load(group);
        let share = left / active as u128;
        let work = if active < MANY_WORKERS { share } else { share / 4 };
        let mut indices = self.batch.queue.take(group, worker, most, work);
        for surplus in indices.split_off(self.fitting(&indices).min(self.supervised(&indices, side_by_side))) {
            self.batch.put_back(surplus);
        }
        Some(self.book(worker, indices, now))
    }

    /// Number of these jobs, at least one, that fit a message with their states. The replies carry states of about the same
    /// size; a worker whose replies are longer sends them in several messages.
    fn fitting(&self, indices: &[usize]) -> usize {
        let sizes = indices.iter().map(|&index| size_of::<TrialReply>() + self.batch.jobs[index].state.bytes.len());
        let totals = sizes.scan(0, |total, size| {
            *total += size;
            Some(*total)
        });
        totals.take_while(|total| *total <= self.settings.message_bytes).count().max(1)
    }

    /// Number of these jobs whose duration can be limited: as many as are solved side by side while none of one of their definitions has been
    /// answered, since a worker that hangs with them is found after the time of one message.
    fn supervised(&self, indices: &[usize], side_by_side: usize) -> usize {
        let unknown = |&index: &usize| !self.throughputs[self.batch.jobs[index].definition].has_answered();
        if indices.iter().any(unknown) { side_by_side.max(1) } else { indices.len() }
    }

    /// A busy worker that may get its next message ahead of time, so that it need not wait for the channel: one whose
    /// work then is no more than its share of all that is left. A job behind a long one would wait while others are idle.
    fn ahead_of_time(&self, group: usize, active: usize) -> Option<WorkerId> {
        let (worker, load) = self.workers.least_loaded(group, self.settings.window.get())?;
        let next = u128::from(self.batch.queue.next_expected(group, worker));
        let left = self.batch.queue.expected(group) + self.workers.load(group);
        ((load + next) * active as u128 <= left).then_some(worker)
    }

    /// Whether every group that has points has a worker.
    pub(in crate::pool) fn is_served(&self) -> bool {
        self.points.groups.iter().all(|&group| self.workers.active_in(group) > 0)
    }

    /// Books jobs as sent to a worker and decides which of them carry their snapshots.
    fn book(&mut self, worker: WorkerId, jobs: Vec<usize>, now: Instant) -> JobMessage {
        let Self { workers, batch, statistics, settings, throughputs, .. } = self;
        let mut define = Vec::new();
        let mut sent = PendingMessage { jobs: Vec::new(), expected: 0, allowance: Duration::ZERO };
        let booked = workers.edit(worker, |known| {
            for &index in &jobs {
                let job = &mut batch.jobs[index];
                job.in_message = jobs.len();
                if known.definitions.insert(job.definition) {
                    define.push(job.definition);
                }
                let initial = job.state.id == StateId::NONE;
                job.carried = !initial && (job.must_carry || !known.cache.holds(job.state.id));
                known.cache.touch(job.state.id);
                let carried = if job.carried { job.state.bytes.len() } else { 0 };
                statistics.states_sent += u64::from(job.carried);
                statistics.bytes_sent += (size_of::<TrialJob>() + carried) as u64;
                sent.jobs.push(job.number);
                sent.expected += u128::from(job.expected);
            }
            sent.allowance = settings.hang.allowance(jobs.iter().map(|&index| {
                let job = &batch.jobs[index];
                (throughputs[job.definition].duration(job.expected), job.overruns)
            }));
            if known.pending.is_empty() {
                known.head_since = now;
                known.process.restart();
            }
            known.pending.push_back(sent);
        });
        booked.expect("a worker that was just chosen is in the table");
        JobMessage { worker, define, jobs }
    }
}
