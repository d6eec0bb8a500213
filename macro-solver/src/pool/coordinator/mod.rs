//! The conversation with the workers, without any input or output: events go in, actions come out.
//!
//! Invariants: a job is with at most one worker; it goes to another only after its worker's end is known; a reply
//! counts only when its sender holds the job and the reply is sound.

mod dispatch;

use super::batch::{Batch, Outcome};
use super::cost_model::Pace;
use super::points::{PointState, PointTable};
use super::reply_validation::{Verdict, judge};
use super::settings::PoolSettings;
use super::statistics::{PoolStatistics, WorkerStatistics};
use super::workers::cache_mirror::CacheMirror;
use super::workers::process_stats::Observation;
use super::workers::{Roster, Standing, Stuck, Worker};
use crate::checkpoint::Reproducer;
use crate::material::MaterialError;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedReply, MacroEvent, WorkerId};
use protocol::wire::TrialReply;
use protocol::{DefinitionId, StateId};
use std::collections::{BTreeSet, VecDeque};
use std::time::Instant;

/// Times that one job may find its definition unknown before the worker counts as faulty.
const DEFINITION_MISSES_ALLOWED: u32 = 3;

/// What the pool must do after listening.
#[derive(Debug)]
pub(super) enum Action {
    /// Send a control message.
    Send(WorkerId, ToWorker),
    /// End a worker.
    Kill(WorkerId),
    /// Tell the supply that this process was welcomed.
    Joined(u32),
    /// Tell the supply that this process was refused.
    Refused(u32, String),
    /// Tell the supply that this process is gone, and whether it had answered anything.
    Gone(u32, bool),
    /// Tell the supply that this process has left in good order.
    Left(u32),
}

/// State of the conversation.
pub(super) struct Desk {
    pub(super) settings: PoolSettings,
    pub(super) points: PointTable,
    pub(super) roster: Roster,
    pub(super) batch: Batch,
    pub(super) statistics: PoolStatistics,
    pub(super) actions: Vec<Action>,
    /// Set when the run cannot go on.
    pub(super) fatal: Option<MaterialError>,
    /// The question that has ended too many workers.
    pub(super) quarantined: Option<Reproducer>,
    /// Why the last worker was refused or lost, for the message when none is left.
    pub(super) last_trouble: Option<String>,
    pub(super) paces: Vec<Pace>,
}

impl Desk {
    /// An empty desk: no workers, no questions.
    pub(super) fn new(settings: PoolSettings, points: PointTable) -> Self {
        let paces = vec![Pace::default(); points.definitions.len()];
        Self {
            settings,
            points,
            roster: Roster::default(),
            batch: Batch::default(),
            statistics: PoolStatistics::default(),
            actions: Vec::new(),
            fatal: None,
            quarantined: None,
            last_trouble: None,
            paces,
        }
    }

    /// Takes in one event.
    pub(super) fn hear(&mut self, event: MacroEvent<'_>, now: Instant) {
        match event {
            MacroEvent::Control(worker, message) => self.hear_control(worker, message, now),
            MacroEvent::Replies(worker, replies) => {
                for reply in replies {
                    self.hear_reply(worker, reply, now);
                }
            }
            MacroEvent::Lost(worker, reason) => self.hear_loss(worker, &reason),
            MacroEvent::Refused(reason) => {
                tracing::warn!(reason, "a message was refused");
                self.statistics.refused_messages += 1;
            }
            MacroEvent::Woken => {}
        }
    }

    fn hear_control(&mut self, worker: WorkerId, message: FromWorker, now: Instant) {
        match message {
            FromWorker::Hello { .. } if self.roster.get(worker).is_some() => {
                self.statistics.refused_messages += 1;
            }
            FromWorker::Hello { protocol, run, pid, capabilities, state_cache } => {
                let verdict = self.roster.admit(&self.settings, protocol, &run, &capabilities);
                let group = *verdict.as_ref().unwrap_or(&0);
                let standing = if verdict.is_ok() { Standing::Active } else { Standing::Refused };
                let known = Worker {
                    pid,
                    group,
                    standing,
                    cache: CacheMirror::new(state_cache as usize),
                    definitions: BTreeSet::new(),
                    slices: VecDeque::new(),
                    head_since: now,
                    seen: Observation::default(),
                    tally: self.statistics.workers.len(),
                };
                self.roster.add(worker, known);
                match verdict {
                    Ok(_) => {
                        tracing::info!(worker = worker.0, pid, "worker joined");
                        self.statistics.workers_joined += 1;
                        let figures = WorkerStatistics { worker: worker.0, pid, ..WorkerStatistics::default() };
                        self.statistics.workers.push(figures);
                        self.actions.push(Action::Send(worker, ToWorker::Welcome { worker: worker.0 }));
                        self.actions.push(Action::Joined(pid));
                    }
                    Err(reason) => {
                        tracing::warn!(pid, reason, "worker refused");
                        self.statistics.workers_refused += 1;
                        self.last_trouble = Some(reason.clone());
                        self.actions.push(Action::Send(worker, ToWorker::Refused { reason: reason.clone() }));
                        self.actions.push(Action::Refused(pid, reason));
                    }
                }
            }
            FromWorker::DefinitionRefused { definition, reason } => self.hear_refusal(worker, definition, &reason),
            FromWorker::Bye { reason } => {
                if self.roster.get(worker).is_some_and(|known| known.standing.answers()) {
                    tracing::info!(worker = worker.0, reason, "worker leaves");
                    self.roster.edit(worker, |known| known.standing = Standing::Leaving);
                    self.statistics.workers_left += 1;
                    self.last_trouble = Some(reason);
                    self.requeue_all(worker);
                }
            }
        }
    }

    fn hear_refusal(&mut self, worker: WorkerId, definition: DefinitionId, reason: &str) {
        match self.points.first_point_of(definition) {
            Some(point) if self.roster.get(worker).is_some_and(|known| known.standing.answers()) => {
                let text = format!("worker {} refuses the RVE of Gauss point {point}: {reason}", worker.0);
                self.fatal.get_or_insert(MaterialError::Channel(text));
            }
            _ => self.statistics.refused_messages += 1,
        }
    }

    fn hear_reply(&mut self, worker: WorkerId, loaded: &LoadedReply<'_>, now: Instant) {
        self.statistics.bytes_received += (size_of::<TrialReply>() + loaded.state.len() + loaded.error.len()) as u64;
        let number = loaded.reply.job;
        let held = self.roster.edit(worker, |known| known.standing.answers() && known.release(number, now));
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
        match judge(&self.batch.jobs[index].wire, loaded) {
            Ok(verdict) => self.accept(worker, index, verdict),
            Err(fault) => self.condemn_for(worker, index, &fault),
        }
    }

    fn accept(&mut self, worker: WorkerId, index: usize, verdict: Verdict) {
        match verdict {
            Verdict::Done { answer, state, bytes, overhead_nanoseconds, replayed } => {
                let job = &self.batch.jobs[index];
                self.paces[job.definition].learn(&answer.cost);
                self.tally(worker, &answer, overhead_nanoseconds);
                self.statistics.replayed_trials += u64::from(replayed);
                self.roster.edit(worker, |known| known.cache.touch(state));
                self.retire_when_worn(worker);
                let state = PointState { id: state, bytes, holder: Some(worker) };
                self.batch.settle(index, Outcome::Done(answer, state));
            }
            Verdict::Failed(reason) => {
                let abandoned = self.batch.settle(index, Outcome::Failed(reason));
                self.statistics.abandoned += abandoned as u64;
            }
            Verdict::NeedState if self.batch.jobs[index].carried => {
                self.condemn_for(worker, index, "asks for a snapshot that the job carried");
            }
            Verdict::NeedState => {
                self.statistics.state_misses += 1;
                let state = self.batch.jobs[index].wire.state;
                self.forget(worker, state);
                self.batch.jobs[index].must_carry = true;
                self.batch.requeue(index);
            }
            Verdict::NeedDefinition => {
                let job = &mut self.batch.jobs[index];
                job.definition_misses += 1;
                if job.definition_misses > DEFINITION_MISSES_ALLOWED {
                    return self.condemn_for(worker, index, "keeps asking for a definition that it was sent");
                }
                self.statistics.definition_misses += 1;
                let definition = job.definition;
                self.roster.edit(worker, |known| known.definitions.remove(&definition));
                self.batch.requeue(index);
            }
        }
    }

    fn forget(&mut self, worker: WorkerId, state: StateId) {
        self.roster.edit(worker, |known| known.cache.forget(state));
    }

    fn tally(&mut self, worker: WorkerId, answer: &protocol::TrialAnswer, overhead_nanoseconds: u64) {
        let solve = answer.cost.solve_nanoseconds as f64 * 1e-9;
        let tangent = answer.cost.tangent_nanoseconds as f64 * 1e-9;
        let overhead = overhead_nanoseconds as f64 * 1e-9;
        let totals = &mut self.statistics;
        totals.solved += 1;
        totals.force_evaluations += answer.cost.force_evaluations;
        totals.rve_s += solve;
        totals.tangent_s += tangent;
        totals.transport_s += overhead;
        if let Some(known) = self.roster.get(worker) {
            let figures = &mut totals.workers[known.tally];
            figures.jobs += 1;
            figures.busy_s += solve + tangent + overhead;
        }
    }

    fn hear_loss(&mut self, worker: WorkerId, reason: &str) {
        let Some(known) = self.roster.get(worker) else { return };
        let (pid, standing) = (known.pid, known.standing);
        let had_answered = self.statistics.workers.get(known.tally).is_some_and(|figures| figures.jobs > 0);
        if standing != Standing::Refused {
            tracing::warn!(worker = worker.0, pid, reason, "worker lost");
            self.statistics.workers_lost += u64::from(standing != Standing::Leaving);
            self.last_trouble = Some(format!("worker {} (process {pid}): {reason}", worker.0));
            let left = standing == Standing::Leaving;
            self.actions.push(if left { Action::Left(pid) } else { Action::Gone(pid, had_answered) });
        }
        if standing.answers() {
            self.blame_head(worker, reason, 0);
        }
        self.requeue_all(worker);
        self.roster.remove(worker);
        self.batch.queue.disown(worker);
    }

    /// Only the slice at the head was under way: the rest is innocent.
    fn blame_head(&mut self, worker: WorkerId, reason: &str, overruns: u32) {
        let Some(known) = self.roster.get(worker) else { return };
        for number in known.slices.front().map_or_else(Vec::new, |slice| slice.jobs.clone()) {
            if let Some(index) = self.batch.index_of(number) {
                self.batch.jobs[index].overruns += overruns;
                self.blame(index, reason);
            }
        }
    }

    fn blame(&mut self, index: usize, reason: &str) {
        let limit = self.settings.blames_until_quarantine;
        let job = &mut self.batch.jobs[index];
        job.ends.push(reason.to_owned());
        if job.blames() >= limit && self.fatal.is_none() {
            let text = format!(
                "Gauss point {} has ended {} workers with the same question (last: {reason}); displacement gradient \
                 {:?} from state {}; the run stops before it ends more",
                job.trial.point,
                job.blames(),
                job.trial.target.0,
                job.wire.state
            );
            self.quarantined = Some(Reproducer {
                program: format!("grainspan {}", env!("CARGO_PKG_VERSION")),
                point: job.wire.point,
                ends: job.ends.clone(),
                definition: self.points.definitions[job.definition].1.clone(),
                state: job.state.bytes.to_vec(),
                target: job.trial.target,
                tangent: job.trial.ask.tangent,
                ramp_steps: job.trial.ask.ramp_steps,
                observables: job.trial.ask.observables,
            });
            self.fatal = Some(MaterialError::WorkersLost(text));
        }
    }

    fn requeue_all(&mut self, worker: WorkerId) {
        let held = self.roster.edit(worker, |known| std::mem::take(&mut known.slices));
        for number in held.into_iter().flatten().flat_map(|slice| slice.jobs) {
            if let Some(index) = self.batch.index_of(number) {
                self.hand_on(index);
            }
        }
    }

    /// Gives a job of a lost or faulty worker to another, after a rest if the next loss would be the last.
    fn hand_on(&mut self, index: usize) {
        self.statistics.reissued += 1;
        let (job, limit) = (&self.batch.jobs[index], self.settings.blames_until_quarantine);
        if !job.ends.is_empty() && job.blames().saturating_add(1) == limit {
            let (point, blames, rest) = (job.trial.point, job.blames(), self.settings.last_rest);
            tracing::warn!(
                point,
                blames,
                ?rest,
                "this question has ended workers; it rests before the next one gets it"
            );
            self.batch.requeue_rested(index);
        } else {
            self.batch.requeue(index);
        }
    }

    /// An unsound reply: the worker is ended and its job asked elsewhere.
    fn condemn_for(&mut self, worker: WorkerId, index: usize, fault: &str) {
        tracing::error!(worker = worker.0, point = self.batch.jobs[index].trial.point, fault, "unsound reply");
        self.statistics.workers_faulty += 1;
        self.blame(index, fault);
        self.hand_on(index);
        self.condemn(worker);
    }

    fn condemn(&mut self, worker: WorkerId) {
        if self.roster.edit(worker, |known| known.standing = Standing::Condemned).is_some() {
            self.actions.push(Action::Kill(worker));
        }
    }

    /// Ends the workers that have been silent or stopped for too long.
    pub(super) fn end_hung(&mut self, now: Instant) {
        for (worker, stuck) in self.roster.hung(now, &self.settings.hang) {
            let (reason, overruns) = match stuck {
                Stuck::Stopped(reason) => (reason, 0),
                Stuck::Silent(reason) => (reason, 1),
            };
            tracing::error!(worker = worker.0, reason, "worker is ended");
            self.statistics.workers_hung += 1;
            self.blame_head(worker, &reason, overruns);
            self.condemn(worker);
        }
    }

    /// The channel to this worker did not take a message.
    pub(super) fn undeliverable(&mut self, worker: WorkerId, reason: &str) {
        tracing::warn!(worker = worker.0, reason, "message not delivered");
        self.condemn(worker);
    }
}
