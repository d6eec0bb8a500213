//! What a pool did and what it cost; figures for people and summaries, never input to a result.

use protocol::Cost;
use serde::{Deserialize, Serialize};

/// Work of one worker process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorkerStatistics {
    /// Number in the run.
    pub worker: u32,
    /// Process id.
    pub pid: u32,
    /// Jobs answered.
    pub jobs: u64,
    /// Time it reported for these jobs, s.
    pub busy_s: f64,
}

/// Trials that workers have solved, those of exactly zero deformation left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SolvedTrials {
    /// Their number.
    pub trials: u64,
    /// Their force evaluations.
    pub force_evaluations: u64,
    /// Time of the grain solver, s.
    pub seconds: f64,
    /// For each of them the trials in its message, added up.
    pub in_messages: u64,
}

impl SolvedTrials {
    /// Counts one trial that came in a message of `in_message` trials.
    pub(super) fn add(&mut self, cost: &Cost, in_message: usize) {
        self.trials += 1;
        self.force_evaluations += cost.force_evaluations;
        self.seconds += cost.solve_nanoseconds as f64 * 1e-9;
        self.in_messages += in_message as u64;
    }

    /// Time of a force evaluation, s; `None` if there was none.
    pub fn seconds_per_evaluation(&self) -> Option<f64> {
        (self.force_evaluations > 0).then(|| self.seconds / self.force_evaluations as f64)
    }
}

/// What workers solved of one RVE definition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DefinitionStatistics {
    /// Trials that came to their worker in messages of at least half as many as it solves side by side; the built-in engine solves fewer
    /// one by one.
    pub side_by_side: SolvedTrials,
    /// All other trials.
    pub one_by_one: SolvedTrials,
    /// Trials with a tangent operator.
    pub tangents: u64,
    /// Trials without one.
    pub without_tangent: u64,
    /// Time of the tangent operators, s.
    pub tangent_s: f64,
}

impl DefinitionStatistics {
    /// Counts a trial with or without a tangent operator.
    pub(super) fn add_tangent(&mut self, cost: &Cost, has_tangent: bool) {
        self.tangents += u64::from(has_tangent);
        self.without_tangent += u64::from(!has_tangent);
        self.tangent_s += cost.tangent_nanoseconds as f64 * 1e-9;
    }

    /// Time that solving trials side by side has saved, by the time of a force evaluation of those that were solved one by one, s;
    /// `None` without trials of both kinds.
    pub fn seconds_saved_side_by_side(&self) -> Option<f64> {
        let together = &self.side_by_side;
        let alone = self.one_by_one.seconds_per_evaluation().filter(|_| together.trials > 0)?;
        Some(alone * together.force_evaluations as f64 - together.seconds)
    }

    /// Time of a tangent operator, s; `None` if none was computed.
    pub fn seconds_per_tangent(&self) -> Option<f64> {
        (self.tangents > 0 && self.tangent_s > 0.0).then(|| self.tangent_s / self.tangents as f64)
    }
}

/// Totals since the pool began. Counts of trouble depend on what happened, times on the machine; the rest is
/// deterministic as long as nothing fails.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoolStatistics {
    /// Trials requested and answered.
    pub evaluations: u64,
    /// Jobs that workers solved; smaller than `evaluations` by the duplicates.
    pub solved: u64,
    /// Trials that shared the answer of a bitwise equal trial.
    pub duplicates_skipped: u64,
    /// Force evaluations of the answers that they shared.
    #[serde(default)]
    pub duplicate_force_evaluations: u64,
    /// Jobs dropped because a lower point had failed: waiting ones, and those of lost workers.
    pub abandoned: u64,
    /// Force evaluations of all solved jobs.
    pub force_evaluations: u64,
    /// What workers solved, by RVE definition: times of different cells do not compare.
    pub by_definition: Vec<DefinitionStatistics>,
    /// Jobs sent again because their worker was lost.
    pub reissued: u64,
    /// Workers that were welcomed.
    pub workers_joined: u64,
    /// Welcomed workers whose process ended before the run did.
    pub workers_lost: u64,
    /// Those of them whose host was lost, not the worker alone.
    #[serde(default)]
    pub workers_cut_off: u64,
    /// Workers that left on their own will.
    pub workers_left: u64,
    /// Workers that were requested to leave because they had done enough; those that did are among `workers_left`.
    pub workers_recycled: u64,
    /// Replacements started.
    pub worker_restarts: u64,
    /// Workers ended because they did not answer in time.
    pub workers_hung: u64,
    /// Workers ended because a reply of theirs was not sound.
    pub workers_faulty: u64,
    /// Workers whose hello was refused.
    pub workers_refused: u64,
    /// Messages that were none of the protocol, or out of turn.
    pub refused_messages: u64,
    /// Replies to jobs that were already settled, or no longer the sender's.
    pub late_replies: u64,
    /// Replies to jobs that were never given out.
    pub unknown_replies: u64,
    /// Jobs sent again because the worker no longer held the state.
    pub state_misses: u64,
    /// Jobs sent again because the worker did not know the definition.
    pub definition_misses: u64,
    /// Trials that workers solved again to rebuild states, because their engine's states are paths.
    pub replayed_trials: u64,
    /// Snapshots sent to workers.
    pub states_sent: u64,
    /// Bytes of jobs and snapshots sent.
    pub bytes_sent: u64,
    /// Bytes of replies and snapshots received.
    pub bytes_received: u64,
    /// Time spent inside evaluations, s.
    pub wall_s: f64,
    /// Time of the grain solver, summed over workers, s.
    pub rve_s: f64,
    /// Time of the tangent operators, summed over workers, s.
    pub tangent_s: f64,
    /// Time of restoring, writing, checking and moving messages, summed over workers, s.
    pub transport_s: f64,
    /// Time of writing, checking and moving messages in the macro process, s.
    pub macro_transport_s: f64,
    /// Time that workers spent waiting while an evaluation was under way: workers x wall less what they reported, s.
    pub idle_s: f64,
    /// Every worker that was welcomed, in order of joining.
    pub workers: Vec<WorkerStatistics>,
}

impl PoolStatistics {
    /// What was solved of a definition, to be counted on.
    pub(super) fn definition_mut(&mut self, number: usize) -> &mut DefinitionStatistics {
        if self.by_definition.len() <= number {
            self.by_definition.resize_with(number + 1, DefinitionStatistics::default);
        }
        &mut self.by_definition[number]
    }

    /// Adds workers, and what has happened to them, that were counted before those of the earlier part of a resumed run were known.
    /// Whatever belongs to evaluations is left out: none has begun.
    pub(super) fn add_workers(&mut self, later: Self) {
        self.reissued += later.reissued;
        self.workers_joined += later.workers_joined;
        self.workers_lost += later.workers_lost;
        self.workers_cut_off += later.workers_cut_off;
        self.workers_left += later.workers_left;
        self.workers_recycled += later.workers_recycled;
        self.workers_hung += later.workers_hung;
        self.workers_faulty += later.workers_faulty;
        self.workers_refused += later.workers_refused;
        self.refused_messages += later.refused_messages;
        self.late_replies += later.late_replies;
        self.unknown_replies += later.unknown_replies;
        self.workers.extend(later.workers);
    }
}
