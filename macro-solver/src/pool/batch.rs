//! The trials of one evaluation as jobs: built, queued, settled.

use super::points::{PointState, PointTable};
use super::queue::{JobQueues, QueuedJob};
use crate::material::{PointId, PointTrial};
use protocol::transport::{LoadedJob, WorkerId};
use protocol::wire::TrialJob;
use protocol::{DefinitionId, RveError, StateId, TrialResult};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How a job ended.
#[derive(Clone, Debug)]
pub(super) enum JobOutcome {
    /// Solved: the answer and the trial state.
    Done(Box<TrialResult>, PointState),
    /// The engine refused or failed.
    Failed(RveError),
}

/// One distinct trial of an evaluation and what happened to it: the pool's own form of a request, from the evaluation to its
/// answer. What travels is made of it by [`Job::loaded`].
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Number in the run; a job that is issued again keeps it.
    pub(super) number: u64,
    /// The trial, of the lowest point among those with a bitwise equal one.
    pub(super) trial: PointTrial,
    /// Issues after the first.
    pub(super) attempt: u32,
    /// Index of the definition.
    pub(super) definition: usize,
    /// Workers that may solve it.
    pub(super) group: usize,
    /// Committed state to start from.
    pub(super) state: PointState,
    /// Expected force evaluations.
    pub(super) expected: u64,
    /// Reasons why workers ended while they worked on it, oldest first.
    pub(super) failures: Vec<String>,
    /// Number of these workers that exceeded the time that the job may take: it may just be long.
    pub(super) overruns: u32,
    /// Whether the next issue carries the snapshot whatever the mirror of the worker's cache says.
    pub(super) must_carry: bool,
    /// Whether the latest issue carried the snapshot.
    pub(super) carried: bool,
    /// Number of jobs in the message of the latest issue.
    pub(super) in_message: usize,
    /// Number of workers that lacked its definition.
    pub(super) definition_misses: u32,
    /// Set once; stays empty for a job that was dropped.
    pub(super) outcome: Option<JobOutcome>,
}

impl Job {
    /// A job that nobody has got yet.
    fn new(number: u64, trial: &PointTrial, table: &PointTable) -> Self {
        let record = &table.records[trial.point];
        Self {
            number,
            trial: *trial,
            attempt: 0,
            definition: record.definition,
            group: table.groups[record.definition],
            state: record.committed.clone(),
            expected: record.cost_model.expect(trial),
            failures: Vec::new(),
            overruns: 0,
            must_carry: false,
            carried: false,
            in_message: 0,
            definition_misses: 0,
            outcome: None,
        }
    }

    /// The job as it travels, with its snapshot if the latest issue carries it.
    pub(super) fn loaded(&self, definition: DefinitionId) -> LoadedJob<'_> {
        let job = TrialJob {
            job: self.number,
            point: self.trial.point as u64,
            definition,
            state: self.state.id,
            target: self.trial.target,
            tangent: self.trial.options.tangent as u32,
            ramp_steps: self.trial.options.ramp_steps,
            observables: self.trial.options.observables.0,
            attempt: self.attempt,
            // The frame owns the length.
            state_length: 0,
            friction_reduction: self.trial.options.friction_reduction,
        };
        LoadedJob { job, state: if self.carried { &self.state.bytes } else { &[] } }
    }

    /// Number of workers that ended while they worked on it.
    pub(super) fn failure_count(&self) -> u32 {
        u32::try_from(self.failures.len()).unwrap_or(u32::MAX)
    }
}

/// All jobs of one evaluation.
#[derive(Debug, Default)]
pub(super) struct Batch {
    first: u64,
    pub(super) jobs: Vec<Job>,
    /// For each trial of the evaluation, the index of its job.
    pub(super) job_of_trial: Vec<usize>,
    pub(super) queue: JobQueues,
    /// Jobs that are delayed, and until when: `None` until the clock has been read.
    delayed: Vec<(usize, Option<Instant>)>,
    open: usize,
    lowest_failure: Option<PointId>,
}

/// What makes two trials the same: definition, state, and the bits of target and options.
type TrialKey = (usize, StateId, [u64; 9], u32, u32, u32, u64);

impl Batch {
    /// Turns trials into queued jobs numbered from `first`; duplicate trials become one job if `deduplicate`.
    /// `affinity` names the worker that probably holds a state and still serves.
    pub(super) fn build(
        trials: &[PointTrial],
        table: &PointTable,
        first: u64,
        deduplicate: bool,
        affinity: impl Fn(&PointState) -> Option<WorkerId>,
    ) -> Self {
        let mut batch = Self { first, ..Self::default() };
        let mut known: BTreeMap<TrialKey, usize> = BTreeMap::new();
        for trial in trials {
            let record = &table.records[trial.point];
            let key = (
                record.definition,
                record.committed.id,
                trial.target.0.map(f64::to_bits),
                trial.options.tangent as u32,
                trial.options.ramp_steps,
                trial.options.observables.0,
                trial.options.friction_reduction.to_bits(),
            );
            let index = match known.get(&key) {
                Some(&index) if deduplicate => index,
                _ => {
                    let index = batch.jobs.len();
                    batch.jobs.push(Job::new(first + index as u64, trial, table));
                    known.insert(key, index);
                    index
                }
            };
            let job = &mut batch.jobs[index];
            if trial.point < job.trial.point {
                job.trial = *trial;
            }
            batch.job_of_trial.push(index);
        }
        batch.open = batch.jobs.len();
        for index in 0..batch.jobs.len() {
            let affinity = affinity(&batch.jobs[index].state);
            batch.queue.add(affinity, batch.queued(index));
        }
        batch
    }

    /// No jobs; later ones are numbered from `first`.
    pub(super) fn nothing(first: u64) -> Self {
        Self { first, ..Self::default() }
    }

    /// Whether every job has an outcome or was dropped.
    pub(super) fn is_finished(&self) -> bool {
        self.open == 0
    }

    /// Index of the job with this number, if it belongs to this evaluation.
    pub(super) fn index_of(&self, number: u64) -> Option<usize> {
        let index = usize::try_from(number.checked_sub(self.first)?).ok()?;
        (index < self.jobs.len()).then_some(index)
    }

    /// Whether this number belongs to an earlier evaluation.
    pub(super) fn is_past(&self, number: u64) -> bool {
        number < self.first
    }

    /// Whether the outcome of a job can still change that of the evaluation: no lower point has failed.
    pub(super) fn is_needed(&self, index: usize) -> bool {
        self.lowest_failure.is_none_or(|lowest| self.jobs[index].trial.point <= lowest)
    }

    /// Gives up a job that was sent, is with no worker any more and is not needed.
    pub(super) fn drop_sent(&mut self, index: usize) {
        if self.jobs[index].outcome.is_none() {
            self.open -= 1;
        }
    }

    /// Puts a job that was sent back into the queue.
    pub(super) fn requeue(&mut self, index: usize) {
        if self.jobs[index].outcome.is_none() {
            self.jobs[index].attempt += 1;
            self.queue.add(None, self.queued(index));
        }
    }

    /// As [`requeue`](Self::requeue), after a delay.
    pub(super) fn requeue_delayed(&mut self, index: usize) {
        if self.jobs[index].outcome.is_none() {
            self.jobs[index].attempt += 1;
            self.delayed.push((index, None));
        }
    }

    /// Queues a job again that was taken and not sent.
    pub(super) fn put_back(&mut self, index: usize) {
        self.queue.add(None, self.queued(index));
    }

    /// Queues the jobs that have been delayed for `delay`.
    pub(super) fn release_delayed(&mut self, now: Instant, delay: Duration) {
        for (index, until) in std::mem::take(&mut self.delayed) {
            let until = until.unwrap_or(now + delay);
            if until <= now {
                self.queue.add(None, self.queued(index));
            } else {
                self.delayed.push((index, Some(until)));
            }
        }
    }

    /// End of the next delay.
    pub(super) fn next_release(&self) -> Option<Instant> {
        self.delayed.iter().filter_map(|(_, until)| *until).min()
    }

    /// Records how a job ended. Returns the number of waiting jobs that are dropped because of it.
    pub(super) fn settle(&mut self, index: usize, outcome: JobOutcome) -> usize {
        debug_assert!(self.jobs[index].outcome.is_none(), "a job is settled once");
        self.delayed.retain(|(delayed, _)| *delayed != index);
        self.open -= 1;
        let failed = matches!(outcome, JobOutcome::Failed(_));
        self.jobs[index].outcome = Some(outcome);
        if failed { self.drop_above(self.jobs[index].trial.point) } else { 0 }
    }

    /// Once a point has failed, only lower points can change the outcome: the rest need not be solved.
    fn drop_above(&mut self, point: PointId) -> usize {
        let limit = self.lowest_failure.map_or(point, |lowest| lowest.min(point));
        self.lowest_failure = Some(limit);
        let jobs = &self.jobs;
        let is_needed = |index: usize| jobs[index].trial.point <= limit;
        let delayed = self.delayed.len();
        self.delayed.retain(|(index, _)| is_needed(*index));
        let dropped = self.queue.retain(is_needed) + delayed - self.delayed.len();
        self.open -= dropped;
        dropped
    }

    /// Place and reason of the failed trial of the point with the lowest number, the first if it has several: those of the whole
    /// evaluation.
    pub(super) fn lowest_failure(&self, trials: &[PointTrial]) -> Option<(usize, RveError)> {
        let failed = |(place, job): (usize, &usize)| match &self.jobs[*job].outcome {
            Some(JobOutcome::Failed(reason)) => Some((place, reason)),
            _ => None,
        };
        let failures = self.job_of_trial.iter().enumerate().filter_map(failed);
        failures.min_by_key(|(place, _)| trials[*place].point).map(|(place, reason)| (place, reason.clone()))
    }

    /// Force evaluations of all answers that several trials share, once for each trial but the first.
    pub(super) fn shared_force_evaluations(&self) -> u64 {
        let mut is_known = vec![false; self.jobs.len()];
        let mut shared = 0;
        for &job in &self.job_of_trial {
            if let Some(JobOutcome::Done(answer, _)) = &self.jobs[job].outcome
                && std::mem::replace(&mut is_known[job], true)
            {
                shared += answer.cost.force_evaluations;
            }
        }
        shared
    }

    /// Answers and trial states of all trials, in their order, when none has failed. Only duplicate trials copy an answer.
    pub(super) fn into_answers(mut self) -> impl Iterator<Item = (TrialResult, PointState)> {
        let mut uses = vec![0usize; self.jobs.len()];
        self.job_of_trial.iter().for_each(|&job| uses[job] += 1);
        std::mem::take(&mut self.job_of_trial).into_iter().map(move |job| {
            uses[job] -= 1;
            let outcome = &mut self.jobs[job].outcome;
            let outcome = if uses[job] == 0 { outcome.take() } else { outcome.clone() };
            match outcome {
                Some(JobOutcome::Done(answer, state)) => (*answer, state),
                _ => unreachable!("jobs are dropped only after a failure, and failures were reported before"),
            }
        })
    }

    fn queued(&self, index: usize) -> QueuedJob {
        let job = &self.jobs[index];
        QueuedJob {
            job: index,
            expected: job.expected,
            definition: job.definition,
            group: job.group,
            quarantine_candidate: !job.failures.is_empty(),
        }
    }
}
