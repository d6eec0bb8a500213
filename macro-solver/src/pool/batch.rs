//! The questions of one evaluation as jobs: built, waiting, answered.

use super::points::{PointState, PointTable};
use super::queue::{Queues, Ticket};
use crate::material::{PointId, PointTrial};
use protocol::transport::WorkerId;
use protocol::wire::TrialJob;
use protocol::{RveError, StateId, TrialAnswer};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How a job ended.
#[derive(Clone, Debug)]
pub(super) enum Outcome {
    /// Solved.
    Done(Box<TrialAnswer>, PointState),
    /// The engine refused or failed.
    Failed(RveError),
}

/// One distinct question.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// As it travels; `attempt` counts up with every issue.
    pub(super) wire: TrialJob,
    /// The question of the lowest point that asks it.
    pub(super) trial: PointTrial,
    /// Index of the definition.
    pub(super) definition: usize,
    /// Workers that may solve it.
    pub(super) group: usize,
    /// Committed state to start from.
    pub(super) state: PointState,
    /// Expected force evaluations.
    pub(super) expected: u64,
    /// How the workers ended that were working on it.
    pub(super) ends: Vec<String>,
    /// How many of these had been silent for longer than it may take: it may just be long.
    pub(super) overruns: u32,
    /// Whether the next issue carries the snapshot whatever the mirror says.
    pub(super) must_carry: bool,
    /// Whether the latest issue carried the snapshot.
    pub(super) carried: bool,
    /// How often a worker lacked its definition.
    pub(super) definition_misses: u32,
    /// Set once; stays empty for a job that became pointless while it waited.
    pub(super) outcome: Option<Outcome>,
}

impl Job {
    /// Workers it has ended.
    pub(super) fn blames(&self) -> u32 {
        u32::try_from(self.ends.len()).unwrap_or(u32::MAX)
    }
}

/// All jobs of one evaluation.
#[derive(Debug, Default)]
pub(super) struct Batch {
    first: u64,
    pub(super) jobs: Vec<Job>,
    /// For each trial asked, the job that answers it.
    pub(super) job_of_trial: Vec<usize>,
    pub(super) queue: Queues,
    /// Jobs that rest, and until when: `None` until somebody has looked at the clock.
    resting: Vec<(usize, Option<Instant>)>,
    open: usize,
    lowest_failure: Option<PointId>,
}

/// What makes two questions the same: nothing but bits.
type Question = (usize, StateId, [u64; 9], u32, u32, u32);

impl Batch {
    /// Turns trials into queued jobs numbered from `first`; equal questions become one job if `deduplicate`.
    /// `home` tells whether a worker still serves.
    pub(super) fn build(
        trials: &[PointTrial],
        table: &PointTable,
        first: u64,
        deduplicate: bool,
        home: impl Fn(&PointState) -> Option<WorkerId>,
    ) -> Self {
        let mut batch = Self { first, ..Self::default() };
        let mut known: BTreeMap<Question, usize> = BTreeMap::new();
        for trial in trials {
            let record = &table.records[trial.point];
            let question = (
                record.definition,
                record.committed.id,
                trial.target.0.map(f64::to_bits),
                trial.ask.tangent as u32,
                trial.ask.ramp_steps,
                trial.ask.observables.0,
            );
            let index = match known.get(&question) {
                Some(&index) if deduplicate => index,
                _ => {
                    let index = batch.jobs.len();
                    batch.jobs.push(job(trial, table, first + index as u64));
                    known.insert(question, index);
                    index
                }
            };
            let job = &mut batch.jobs[index];
            if trial.point < job.trial.point {
                job.trial = *trial;
                job.wire.point = trial.point as u64;
            }
            batch.job_of_trial.push(index);
        }
        batch.open = batch.jobs.len();
        for index in 0..batch.jobs.len() {
            let home = home(&batch.jobs[index].state);
            batch.queue.add(home, batch.ticket(index));
        }
        batch
    }

    /// No questions; later ones are numbered from `first`.
    pub(super) fn nothing(first: u64) -> Self {
        Self { first, ..Self::default() }
    }

    /// Whether every job has an outcome or is not needed any more.
    pub(super) fn is_finished(&self) -> bool {
        self.open == 0
    }

    /// Index of the job with this number, if it belongs to this evaluation.
    pub(super) fn index_of(&self, number: u64) -> Option<usize> {
        let index = usize::try_from(number.checked_sub(self.first)?).ok()?;
        (index < self.jobs.len()).then_some(index)
    }

    /// Whether this number was given out before this evaluation.
    pub(super) fn is_past(&self, number: u64) -> bool {
        number < self.first
    }

    /// Puts a job that was sent back into the queue.
    pub(super) fn requeue(&mut self, index: usize) {
        if self.jobs[index].outcome.is_none() {
            self.jobs[index].wire.attempt += 1;
            self.queue.add(None, self.ticket(index));
        }
    }

    /// As [`requeue`](Self::requeue), after a rest.
    pub(super) fn requeue_rested(&mut self, index: usize) {
        if self.jobs[index].outcome.is_none() {
            self.jobs[index].wire.attempt += 1;
            self.resting.push((index, None));
        }
    }

    /// Queues a job again that was taken and not given out.
    pub(super) fn put_back(&mut self, index: usize) {
        self.queue.add(None, self.ticket(index));
    }

    /// Queues the jobs that have rested for `rest`.
    pub(super) fn wake(&mut self, now: Instant, rest: Duration) {
        for (index, until) in std::mem::take(&mut self.resting) {
            let until = until.unwrap_or(now + rest);
            if until <= now {
                self.queue.add(None, self.ticket(index));
            } else {
                self.resting.push((index, Some(until)));
            }
        }
    }

    /// When the next job that rests has to be looked at.
    pub(super) fn next_awake(&self) -> Option<Instant> {
        self.resting.iter().filter_map(|(_, until)| *until).min()
    }

    /// Records how a job ended. Returns how many waiting jobs became pointless by it.
    pub(super) fn settle(&mut self, index: usize, outcome: Outcome) -> usize {
        debug_assert!(self.jobs[index].outcome.is_none(), "a job is settled once");
        self.resting.retain(|(resting, _)| *resting != index);
        self.open -= 1;
        let failed = matches!(outcome, Outcome::Failed(_));
        self.jobs[index].outcome = Some(outcome);
        if failed { self.abandon_above(self.jobs[index].trial.point) } else { 0 }
    }

    /// Once a point has failed, only lower points can change the outcome: the rest need not be solved.
    fn abandon_above(&mut self, point: PointId) -> usize {
        let limit = self.lowest_failure.map_or(point, |lowest| lowest.min(point));
        self.lowest_failure = Some(limit);
        let jobs = &self.jobs;
        let is_needed = |index: usize| jobs[index].trial.point <= limit;
        let resting = self.resting.len();
        self.resting.retain(|(index, _)| is_needed(*index));
        let abandoned = self.queue.retain(is_needed) + resting - self.resting.len();
        self.open -= abandoned;
        abandoned
    }

    fn ticket(&self, index: usize) -> Ticket {
        let job = &self.jobs[index];
        Ticket {
            job: index,
            expected: job.expected,
            definition: job.definition,
            group: job.group,
            suspect: !job.ends.is_empty(),
        }
    }
}

fn job(trial: &PointTrial, table: &PointTable, number: u64) -> Job {
    let record = &table.records[trial.point];
    Job {
        wire: TrialJob {
            job: number,
            point: trial.point as u64,
            definition: table.definitions[record.definition].0,
            state: record.committed.id,
            target: trial.target,
            tangent: trial.ask.tangent as u32,
            ramp_steps: trial.ask.ramp_steps,
            observables: trial.ask.observables.0,
            attempt: 0,
            state_length: 0,
        },
        trial: *trial,
        definition: record.definition,
        group: table.groups[record.definition],
        state: record.committed.clone(),
        expected: record.forecast.expect(trial),
        ends: Vec::new(),
        overruns: 0,
        must_carry: false,
        carried: false,
        definition_misses: 0,
        outcome: None,
    }
}
