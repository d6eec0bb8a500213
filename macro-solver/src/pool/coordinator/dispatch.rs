//! Who gets which jobs next.

use super::Desk;
use crate::pool::workers::Slice;
use protocol::StateId;
use protocol::transport::WorkerId;
use protocol::wire::{TrialJob, TrialReply};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A slice ready to be sent.
pub(in crate::pool) struct Shipment {
    pub(in crate::pool) worker: WorkerId,
    /// Definitions (by index) that must be sent first.
    pub(in crate::pool) define: Vec<usize>,
    pub(in crate::pool) jobs: Vec<(TrialJob, Arc<[u8]>)>,
}

impl Desk {
    /// The next slice to send and to whom, already booked as sent; `None` when nothing waits or nobody is free.
    pub(in crate::pool) fn next_shipment(&mut self, now: Instant) -> Option<Shipment> {
        self.batch.wake(now, self.settings.last_rest);
        self.batch.queue.groups().into_iter().find_map(|group| self.next_of_group(group, now))
    }

    fn next_of_group(&mut self, group: usize, now: Instant) -> Option<Shipment> {
        let waiting = self.batch.queue.waiting(group);
        let active = self.roster.active_in(group);
        if active == 0 {
            return None;
        }
        let worker = self.roster.idle(group).or_else(|| self.ahead_of_time(group, active))?;
        let most = self.settings.slice.get().min(waiting.div_ceil(active));
        // No message holds more than one worker's share of all work that is left: the longest jobs go first, and a message
        // full of them would keep all others waiting for its worker.
        let left = self.batch.queue.expected(group) + self.roster.load(group);
        let mut indices = self.batch.queue.take(group, worker, most, left / active as u128);
        for surplus in indices.split_off(self.fitting(&indices)) {
            self.batch.put_back(surplus);
        }
        Some(self.load(worker, &indices, now))
    }

    /// How many of these jobs, at least one, fit a message with their states. The replies carry states of about the same size;
    /// a worker whose replies are longer all the same sends them in several messages.
    fn fitting(&self, indices: &[usize]) -> usize {
        let sizes = indices.iter().map(|&index| size_of::<TrialReply>() + self.batch.jobs[index].state.bytes.len());
        let totals = sizes.scan(0, |total, size| {
            *total += size;
            Some(*total)
        });
        totals.take_while(|total| *total <= self.settings.message_bytes).count().max(1)
    }

    /// A busy worker that may get its next slice ahead of time, so that it need not wait for the channel: one whose
    /// work then is no more than its share of all that is left. A job behind a long one would wait while others run idle.
    fn ahead_of_time(&self, group: usize, active: usize) -> Option<WorkerId> {
        let (worker, load) = self.roster.least_loaded(group, self.settings.window.get())?;
        let next = u128::from(self.batch.queue.next_expected(group, worker));
        let left = self.batch.queue.expected(group) + self.roster.load(group);
        ((load + next) * active as u128 <= left).then_some(worker)
    }

    /// Whether every group that has points has a worker.
    pub(in crate::pool) fn is_served(&self) -> bool {
        self.points.groups.iter().all(|&group| self.roster.active_in(group) > 0)
    }

    fn load(&mut self, worker: WorkerId, indices: &[usize], now: Instant) -> Shipment {
        let Self { roster, batch, statistics, settings, paces, .. } = self;
        let mut shipment = Shipment { worker, define: Vec::new(), jobs: Vec::new() };
        let mut slice = Slice { jobs: Vec::new(), expected: 0, allowance: Duration::ZERO };
        let loaded = roster.edit(worker, |known| {
            for &index in indices {
                let job = &mut batch.jobs[index];
                if known.definitions.insert(job.definition) {
                    shipment.define.push(job.definition);
                }
                let initial = job.state.id == StateId::NONE;
                job.carried = !initial && (job.must_carry || !known.cache.holds(job.state.id));
                known.cache.touch(job.state.id);
                let bytes = if job.carried { job.state.bytes.clone() } else { Arc::from([]) };
                statistics.states_sent += u64::from(job.carried);
                statistics.bytes_sent += (size_of::<TrialJob>() + bytes.len()) as u64;
                shipment.jobs.push((TrialJob { state_length: bytes.len() as u64, ..job.wire }, bytes));
                slice.jobs.push(job.wire.job);
                slice.expected += u128::from(job.expected);
                let expected = paces[job.definition].duration(job.expected);
                slice.allowance += settings.hang.allowance(expected, job.overruns);
            }
            if known.slices.is_empty() {
                known.head_since = now;
                known.seen.begin_anew();
            }
            known.slices.push_back(slice);
        });
        loaded.expect("a worker that was just chosen is on the roster");
        shipment
    }
}
