//! The decisions of the pool, without any input or output: events go in, actions come out, so tests can play every fault.
//!
//! Invariants: a job is with at most one worker; it goes to another only after its worker's end is known; a reply
//! counts only when its sender holds the job and the reply is valid.

mod dispatch;
mod failures;

use super::batch::{Batch, JobOutcome};
use super::cost_model::Throughput;
use super::points::{PointState, PointTable};
use super::reply_validation::{ValidatedReply, validate_reply};
use super::settings::PoolSettings;
use super::statistics::{PoolStatistics, WorkerStatistics};
use super::workers::cache_mirror::CacheMirror;
use super::workers::process_stats::ProcessHistory;
use super::workers::{Worker, WorkerState, WorkerTable};
use crate::checkpoint::FailureCase;
use crate::material::MaterialError;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedReply, MacroEvent, WorkerId};
use protocol::wire::TrialReply;
use protocol::{Cost, DefinitionId, TrialFlags};
use std::collections::{BTreeSet, VecDeque};
use std::time::Instant;

/// Times that a job may find its definition unknown before the worker counts as faulty.
const DEFINITION_MISSES_ALLOWED: u32 = 3;

/// What the pool must do after an event.
#[derive(Debug)]
pub(super) enum Action {
    /// Send a control message.
    Send(WorkerId, ToWorker),
    /// End a worker's process.
    Kill(WorkerId),
    /// Report to the supply that this process was welcomed.
    Joined(u32),
    /// Report to the supply that this process was refused.
    Refused(u32, String),
    /// Report to the supply that this process is gone, and whether it had answered anything.
    Gone(u32, bool),
    /// Report to the supply that this process has left in good order, and whether it had answered anything.
    Left(u32, bool),
}

/// Points, workers and jobs of a run, and what is known about each.
pub(super) struct Coordinator {
    pub(super) settings: PoolSettings,
    pub(super) points: PointTable,
    pub(super) workers: WorkerTable,
    pub(super) batch: Batch,
    pub(super) statistics: PoolStatistics,
    pub(super) actions: Vec<Action>,
    /// Set when the run cannot go on.
    pub(super) fatal: Option<MaterialError>,
    /// The trial that has ended too many workers.
    pub(super) quarantined: Option<FailureCase>,
    /// Why the last worker was refused or lost, for the message when none is left.
    pub(super) last_trouble: Option<String>,
    /// By definition.
    pub(super) throughputs: Vec<Throughput>,
}

impl Coordinator {
    /// No workers, no jobs.
    pub(super) fn new(settings: PoolSettings, points: PointTable) -> Self {
        let throughputs = vec![Throughput::default(); points.definitions.len()];
        Self {
            settings,
            points,
            workers: WorkerTable::default(),
            batch: Batch::default(),
            statistics: PoolStatistics::default(),
            actions: Vec::new(),
            fatal: None,
            quarantined: None,
            last_trouble: None,
            throughputs,
        }
    }

    /// Takes in one event.
    pub(super) fn handle(&mut self, event: MacroEvent<'_>, now: Instant) {
        match event {
            MacroEvent::Control(worker, message) => self.handle_control(worker, message, now),
            MacroEvent::Replies(worker, replies) => {
                for reply in replies {
                    self.handle_reply(worker, reply, now);
                }
            }
            MacroEvent::Lost(worker, reason) => self.handle_loss(worker, &reason, true),
            MacroEvent::CutOff(worker, reason) => self.handle_loss(worker, &reason, false),
            MacroEvent::Refused(reason) => {
                tracing::warn!(reason, "a message was refused");
                self.statistics.refused_messages += 1;
            }
            MacroEvent::Woken => {}
        }
    }

    fn handle_control(&mut self, worker: WorkerId, message: FromWorker, now: Instant) {
        match message {
            FromWorker::Hello { .. } if self.workers.get(worker).is_some() => {
                self.statistics.refused_messages += 1;
            }
            FromWorker::Hello { protocol, run, pid, capabilities, state_cache } => {
                let admitted = self.workers.admit(&self.settings, protocol, &run, &capabilities);
                let known = Worker {
                    pid,
                    group: *admitted.as_ref().unwrap_or(&0),
                    state: if admitted.is_ok() { WorkerState::Active } else { WorkerState::Refused },
                    side_by_side: capabilities.side_by_side.max(1) as usize,
                    cache: CacheMirror::new(state_cache as usize),
                    definitions: BTreeSet::new(),
                    pending: VecDeque::new(),
                    head_since: now,
                    leave_allowance: self.settings.hang.floor,
                    process: ProcessHistory::default(),
                    statistics: self.statistics.workers.len(),
                };
                self.workers.add(worker, known);
                match admitted {
                    Ok(_) => self.welcome(worker, pid),
                    Err(refusal) => self.refuse(worker, pid, refusal.to_string()),
                }
            }
            FromWorker::DefinitionRefused { definition, reason } => {
                self.handle_definition_refusal(worker, definition, &reason)
            }
            FromWorker::Bye { reason } => {
                if self.workers.get(worker).is_some_and(|known| known.state.answers()) {
                    tracing::info!(worker = worker.0, reason, "worker leaves");
                    self.statistics.workers_left += 1;
                    self.last_trouble = Some(reason);
                    self.requeue_all(worker);
                    self.workers.edit(worker, |known| {
                        known.state = WorkerState::Leaving;
                        known.head_since = now;
                    });
                }
            }
        }
    }

    fn welcome(&mut self, worker: WorkerId, pid: u32) {
        tracing::info!(worker = worker.0, pid, "worker joined");
        self.statistics.workers_joined += 1;
        let figures = WorkerStatistics { worker: worker.0, pid, ..WorkerStatistics::default() };
        self.statistics.workers.push(figures);
        self.actions.push(Action::Send(worker, ToWorker::Welcome { worker: worker.0 }));
        self.actions.push(Action::Joined(pid));
    }

    fn refuse(&mut self, worker: WorkerId, pid: u32, reason: String) {
        tracing::warn!(pid, reason, "worker refused");
        self.statistics.workers_refused += 1;
        self.last_trouble = Some(reason.clone());
        self.actions.push(Action::Send(worker, ToWorker::Refused { reason: reason.clone() }));
        self.actions.push(Action::Refused(pid, reason));
    }

    fn handle_definition_refusal(&mut self, worker: WorkerId, definition: DefinitionId, reason: &str) {
        match self.points.first_point_of(definition) {
            Some(point) if self.workers.get(worker).is_some_and(|known| known.state.answers()) => {
                let text = format!("worker {} refuses the RVE of Gauss point {point}: {reason}", worker.0);
                self.fatal.get_or_insert(MaterialError::DefinitionRefused(text));
            }
            _ => self.statistics.refused_messages += 1,
        }
    }

    fn handle_reply(&mut self, worker: WorkerId, loaded: &LoadedReply<'_>, now: Instant) {
        self.statistics.bytes_received += (size_of::<TrialReply>() + loaded.state.len() + loaded.error.len()) as u64;
        let number = loaded.reply.job;
        let held = self.workers.edit(worker, |known| known.state.answers() && known.release(number, now));
        let held = held.unwrap_or(false);
        let index = self.batch.index_of(number);
        let (Some(index), true) = (index, held) else {
            if index.is_some() || self.batch.is_past(number) {
                self.statistics.late_replies += 1;
            } else {
                self.statistics.unknown_replies += 1;
            }
            return;
        };
        match validate_reply(&self.batch.jobs[index], loaded) {
            Ok(reply) => self.accept(worker, index, reply),
            Err(fault) => self.terminate_for(worker, index, &fault.to_string()),
        }
    }

    fn accept(&mut self, worker: WorkerId, index: usize, reply: ValidatedReply) {
        match reply {
            ValidatedReply::Done { answer, state, overhead_nanoseconds, replayed } => {
                let job = &self.batch.jobs[index];
                self.throughputs[job.definition].learn(&answer.cost);
                let (definition, in_message, has_tangent) =
                    (job.definition, job.in_message, answer.tangent.is_some());
                self.count_cost(worker, &answer.cost, overhead_nanoseconds);
                self.statistics.definition_mut(definition).add_tangent(&answer.cost, has_tangent);
                if !answer.flags.contains(TrialFlags::SKIPPED_NULL_TARGET) {
                    self.count_solved(worker, definition, &answer.cost, in_message);
                }
                self.statistics.replayed_trials += u64::from(replayed);
                self.workers.edit(worker, |known| known.cache.touch(state.id));
                self.retire_after_jobs(worker);
                self.batch.settle(index, JobOutcome::Done(answer, PointState { holder: Some(worker), ..state }));
            }
            ValidatedReply::Failed(reason) => {
                let abandoned = self.batch.settle(index, JobOutcome::Failed(reason));
                self.statistics.abandoned += abandoned as u64;
            }
            ValidatedReply::NeedState if self.batch.jobs[index].carried => {
                self.terminate_for(worker, index, "asks for a snapshot that the job carried");
            }
            ValidatedReply::NeedState => {
                self.statistics.state_misses += 1;
                let state = self.batch.jobs[index].state.id;
                self.workers.edit(worker, |known| known.cache.forget(state));
                self.batch.jobs[index].must_carry = true;
                self.queue_again(index);
            }
            ValidatedReply::NeedDefinition => {
                let job = &mut self.batch.jobs[index];
                job.definition_misses += 1;
                if job.definition_misses > DEFINITION_MISSES_ALLOWED {
                    return self.terminate_for(worker, index, "keeps asking for a definition that it was sent");
                }
                self.statistics.definition_misses += 1;
                let definition = job.definition;
                self.workers.edit(worker, |known| known.definitions.remove(&definition));
                self.queue_again(index);
            }
        }
    }

    /// Counts an answer.
    fn count_cost(&mut self, worker: WorkerId, cost: &Cost, overhead_nanoseconds: u64) {
        let solve = cost.solve_nanoseconds as f64 * 1e-9;
        let tangent = cost.tangent_nanoseconds as f64 * 1e-9;
        let overhead = overhead_nanoseconds as f64 * 1e-9;
        let totals = &mut self.statistics;
        totals.solved += 1;
        totals.force_evaluations += cost.force_evaluations;
        totals.rve_s += solve;
        totals.tangent_s += tangent;
        totals.transport_s += overhead;
        if let Some(known) = self.workers.get(worker) {
            let figures = &mut totals.workers[known.statistics];
            figures.jobs += 1;
            figures.busy_s += solve + tangent + overhead;
        }
    }

    /// Counts a trial that a worker has solved, in a message of `in_message` trials.
    fn count_solved(&mut self, worker: WorkerId, definition: usize, cost: &Cost, in_message: usize) {
        if let Some(known) = self.workers.get(worker) {
            let figures = self.statistics.definition_mut(definition);
            let is_together = known.side_by_side > 1 && 2 * in_message >= known.side_by_side;
            let group = if is_together { &mut figures.side_by_side } else { &mut figures.one_by_one };
            group.add(cost, in_message);
        }
    }
}
