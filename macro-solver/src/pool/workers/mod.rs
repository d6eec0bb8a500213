//! The workers of a run as the macro sees them, and which of them may get jobs.

pub(super) mod cache_mirror;
mod load_index;
pub(super) mod process_stats;

use super::settings::{HangPolicy, PoolSettings};
use cache_mirror::CacheMirror;
use load_index::{Entry, LoadIndex};
use process_stats::ProcessHistory;
use protocol::process::ProcessStat;
use protocol::transport::WorkerId;
use protocol::{Capabilities, OptionalResult, PROTOCOL_VERSION, TangentKind};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, Instant};
use thiserror::Error;

/// A message of jobs that a worker has not answered completely.
#[derive(Clone, Debug)]
pub(super) struct PendingMessage {
    /// Numbers of the unanswered jobs.
    pub(super) jobs: Vec<u64>,
    /// Expected force evaluations of all its jobs.
    pub(super) expected: u128,
    /// Time that it may take once the worker has begun it.
    pub(super) allowance: Duration,
}

/// Whether a worker gets jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WorkerState {
    /// Gets jobs; its replies count.
    Active,
    /// Was requested to finish its jobs and to leave: no new jobs, but its replies count.
    Draining,
    /// Has announced that it leaves: no new jobs.
    Leaving,
    /// Was ended or cannot be reached: its replies no longer count, and its jobs wait until its end is confirmed, so that no
    /// job runs twice at a time.
    Terminated,
    /// Its hello was refused.
    Refused,
}

impl WorkerState {
    /// Whether replies of the worker count.
    pub(super) fn answers(self) -> bool {
        matches!(self, Self::Active | Self::Draining)
    }
}

/// Why a worker has to be ended, with a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum HangReason {
    /// Its process was stopped by a signal.
    Stopped(String),
    /// It has not answered within the time that its job may take.
    Silent(String),
}

/// One worker.
#[derive(Clone, Debug)]
pub(super) struct Worker {
    pub(super) pid: u32,
    /// Which jobs it gets: see [`super::queue::JobQueues`].
    pub(super) group: usize,
    pub(super) state: WorkerState,
    /// Jobs of one definition that it solves in little more time than one of them.
    pub(super) side_by_side: usize,
    pub(super) cache: CacheMirror,
    /// Definitions it was sent.
    pub(super) definitions: BTreeSet<usize>,
    /// Unanswered messages in the order sent; it works on the first.
    pub(super) pending: VecDeque<PendingMessage>,
    /// When it began the first of them; of a worker that is to leave and holds none, since when it has been free to do so.
    pub(super) head_since: Instant,
    /// How long it may take to end once it is free to leave.
    pub(super) leave_allowance: Duration,
    /// What the kernel says about its process while it has work.
    pub(super) process: ProcessHistory,
    /// Index of its entry in the statistics.
    pub(super) statistics: usize,
}

impl Worker {
    /// Whether it gets jobs.
    pub(super) fn is_active(&self) -> bool {
        self.state == WorkerState::Active
    }

    /// Removes a job that was answered; `false` when the worker did not hold it.
    pub(super) fn release(&mut self, job: u64, now: Instant) -> bool {
        for place in 0..self.pending.len() {
            let message = &mut self.pending[place];
            let Some(position) = message.jobs.iter().position(|held| *held == job) else { continue };
            message.jobs.remove(position);
            if message.jobs.is_empty() {
                self.pending.remove(place);
            }
            // Any sign of work restarts the clock of the rest.
            self.head_since = now;
            self.process.restart();
            return true;
        }
        false
    }

    /// Expected force evaluations of its unanswered messages.
    pub(super) fn load(&self) -> u128 {
        self.pending.iter().map(|message| message.expected).sum()
    }

    /// When it counts as hung; `None` while it has nothing to do and need not leave. Time in which it got no processor does not count.
    pub(super) fn deadline(&self) -> Option<Instant> {
        match (self.state, self.pending.front()) {
            (WorkerState::Active | WorkerState::Draining, Some(head)) => {
                Some(self.head_since + head.allowance + self.process.waited_for_processor)
            }
            (WorkerState::Draining, None) | (WorkerState::Leaving, _) => Some(self.head_since + self.leave_allowance),
            (WorkerState::Active, None) | (WorkerState::Terminated | WorkerState::Refused, _) => None,
        }
    }

    /// Records what the kernel says about its process; returns whether that is stopped.
    fn check(&mut self, now: Instant, stat: impl Fn(u32) -> Option<ProcessStat>) -> bool {
        let Some(stat) = stat(self.pid) else { return false };
        self.process.record(&stat, self.head_since, now);
        stat.is_stopped()
    }

    /// Why it is to be ended, if it is.
    fn hang_reason(&self, now: Instant, hang: &HangPolicy) -> Option<HangReason> {
        let deadline = self.deadline()?;
        // The processes of workers without jobs are not looked at.
        let has_jobs = !self.pending.is_empty();
        if let Some(stopped) = self.process.stopped(now).filter(|stopped| has_jobs && *stopped >= hang.stopped) {
            return Some(HangReason::Stopped(format!("stopped for {:.1} s", stopped.as_secs_f64())));
        }
        (deadline <= now).then(|| {
            let passed = now.saturating_duration_since(self.head_since).as_secs_f64();
            HangReason::Silent(match has_jobs {
                true => format!("no answer for {passed:.1} s, longer than the job may take"),
                false => format!("it was to leave, and is still there after {passed:.1} s"),
            })
        })
    }
}

/// All workers that have sent a hello and have not ended.
#[derive(Debug, Default)]
pub(super) struct WorkerTable {
    workers: BTreeMap<WorkerId, Worker>,
    load_index: LoadIndex,
    /// Whether a worker with work was stopped at the last check.
    any_stopped: bool,
    /// Engine and version of the first worker of each group: bitwise equal answers need the same in all.
    engines: BTreeMap<usize, (String, String)>,
}

impl WorkerTable {
    /// Adds a worker that has sent a hello.
    pub(super) fn add(&mut self, id: WorkerId, worker: Worker) {
        self.load_index.insert(id, Entry::of(&worker));
        self.workers.insert(id, worker);
    }

    /// Removes a worker that has ended.
    pub(super) fn remove(&mut self, id: WorkerId) {
        if let Some(worker) = self.workers.remove(&id) {
            self.load_index.remove(id, Entry::of(&worker));
        }
    }

    /// A worker.
    pub(super) fn get(&self, id: WorkerId) -> Option<&Worker> {
        self.workers.get(&id)
    }

    /// Changes a worker of the table; the only way to do so, so that the load index follows.
    pub(super) fn edit<T>(&mut self, id: WorkerId, change: impl FnOnce(&mut Worker) -> T) -> Option<T> {
        let worker = self.workers.get_mut(&id)?;
        let before = Entry::of(worker);
        let outcome = change(worker);
        let after = Entry::of(worker);
        if after != before {
            self.load_index.remove(id, before);
            self.load_index.insert(id, after);
        }
        Some(outcome)
    }

    /// All workers, by number.
    pub(super) fn iter(&self) -> impl Iterator<Item = (WorkerId, &Worker)> {
        self.workers.iter().map(|(id, worker)| (*id, worker))
    }

    /// Moves the statistics of every worker to another place.
    pub(super) fn renumber(&mut self, place: impl Fn(usize) -> usize) {
        self.workers.values_mut().for_each(|worker| worker.statistics = place(worker.statistics));
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.workers.is_empty()
    }

    /// Number of workers that get jobs.
    pub(super) fn active(&self) -> usize {
        self.load_index.active()
    }

    /// Whether this worker gets jobs.
    pub(super) fn is_active(&self, worker: WorkerId) -> bool {
        self.workers.get(&worker).is_some_and(Worker::is_active)
    }

    /// Number of workers of a group that get jobs.
    pub(super) fn active_in(&self, group: usize) -> usize {
        self.load_index.active_in(group)
    }

    /// A worker of a group that has nothing to do; the lowest number among several.
    pub(super) fn idle(&self, group: usize) -> Option<WorkerId> {
        self.load_index.least_loaded(group, 1).map(|(worker, _)| worker)
    }

    /// Number of workers of a group that have nothing to do.
    pub(super) fn idle_in(&self, group: usize) -> usize {
        self.load_index.idle_in(group)
    }

    /// See [`LoadIndex::least_loaded`].
    pub(super) fn least_loaded(&self, group: usize, depth: usize) -> Option<(WorkerId, u128)> {
        self.load_index.least_loaded(group, depth)
    }

    /// Expected force evaluations that the workers of a group were sent and have not answered.
    pub(super) fn load(&self, group: usize) -> u128 {
        self.load_index.load(group)
    }

    /// Earliest time at which some worker counts as hung.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.load_index.next_deadline()
    }

    /// Checks the processes of the workers that have work; returns whether any of them is stopped.
    pub(super) fn check(&mut self, now: Instant, stat: impl Fn(u32) -> Option<ProcessStat>) -> bool {
        self.any_stopped = false;
        for id in self.busy() {
            self.any_stopped |= self.edit(id, |worker| worker.check(now, &stat)).unwrap_or(false);
        }
        self.any_stopped
    }

    /// Workers that have unanswered jobs.
    pub(super) fn busy(&self) -> Vec<WorkerId> {
        let busy = |worker: &Worker| worker.state.answers() && !worker.pending.is_empty();
        self.iter().filter(|(_, worker)| busy(worker)).map(|(id, _)| id).collect()
    }

    /// Workers that have been silent or stopped for too long, each with the reason.
    pub(super) fn hung(&self, now: Instant, hang: &HangPolicy) -> Vec<(WorkerId, HangReason)> {
        let due = self.next_deadline().is_some_and(|deadline| deadline <= now);
        if !due && !self.any_stopped {
            return Vec::new();
        }
        self.iter().filter_map(|(id, worker)| Some((id, worker.hang_reason(now, hang)?))).collect()
    }

    /// Checks a hello and returns the worker's group.
    ///
    /// # Errors
    /// Why the worker cannot take part.
    pub(super) fn admit(
        &mut self,
        settings: &PoolSettings,
        protocol: u32,
        run: &str,
        capabilities: &Capabilities,
    ) -> Result<usize, Refusal> {
        if protocol != PROTOCOL_VERSION {
            return Err(Refusal::Protocol { found: protocol });
        }
        if run != settings.run {
            return Err(Refusal::OtherRun { requested: run.to_owned(), run: settings.run.clone() });
        }
        let engine = capabilities.engine.clone();
        if !capabilities.dimensions.contains(&settings.dimension) {
            return Err(Refusal::Dimension { engine, dimension: settings.dimension });
        }
        if let Some(&tangent) = settings.tangents.iter().find(|kind| !capabilities.tangents.contains(kind)) {
            return Err(Refusal::Tangent { engine, tangent });
        }
        let Some(group) = settings.group_of(&engine) else {
            return Err(Refusal::Engine { engine, engines: settings.engines.join(", ") });
        };
        let offered = (engine, capabilities.version.clone());
        if let Some(version) = settings.version_of(&offered.0).filter(|version| *version != offered.1) {
            return Err(Refusal::Build { offered, expected: version.to_owned() });
        }
        // What the run takes for a number of this engine must not be the zero of a worker that does not deliver it.
        if let Some(known) = settings.lacking.get(group)
            && let Some(result) = capabilities.lacking().into_iter().find(|result| !known.contains(result))
        {
            return Err(Refusal::Observable { engine: offered.0, result });
        }
        let expected = self.engines.entry(group).or_insert_with(|| offered.clone());
        if *expected != offered {
            return Err(Refusal::Version { offered, expected: expected.clone() });
        }
        Ok(group)
    }
}

/// Why a worker cannot take part in a run, with the remedy.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub(super) enum Refusal {
    /// Built from another version of the protocol.
    #[error(
        "the worker speaks protocol version {found}, this run version {PROTOCOL_VERSION}; start both from the same build of \
         grainspan"
    )]
    Protocol {
        /// Version of the worker.
        found: u32,
    },
    /// Started for another run.
    #[error("the worker asks for run `{requested}`, this is run `{run}`; check --run")]
    OtherRun {
        /// Run that the worker names.
        requested: String,
        /// This run.
        run: String,
    },
    /// The engine does not serve the dimension of the problem.
    #[error("engine `{engine}` does not serve {dimension} dimensions; choose another engine or scene")]
    Dimension {
        /// Engine of the worker.
        engine: String,
        /// 2 or 3.
        dimension: u32,
    },
    /// The engine lacks a tangent of the scene.
    #[error("engine `{engine}` cannot deliver the tangent `{}`; choose another tangent in the scene", tangent.keyword())]
    Tangent {
        /// Engine of the worker.
        engine: String,
        /// Tangent that it lacks.
        tangent: TangentKind,
    },
    /// No point is given to the engine.
    #[error(
        "engine `{engine}` solves no point of this run, whose engines are {engines}; start the worker with another"
    )]
    Engine {
        /// Engine of the worker.
        engine: String,
        /// Engines of the run.
        engines: String,
    },
    /// The engine is another build of the one that the caller has.
    #[error(
        "the worker's engine `{} {}` is not `{} {expected}`, which this program was built with; results would depend on the worker; use \
         a `grainspan` built from the same sources",
        offered.0, offered.1, offered.0
    )]
    Build {
        /// Engine and version of the worker.
        offered: (String, String),
        /// Version of this program's engine.
        expected: String,
    },
    /// The worker delivers less than the engine of the run.
    #[error(
        "this worker of engine `{engine}` does not deliver `{}`, which the engine of the run does; start the same program",
        result.keyword()
    )]
    Observable {
        /// Engine of the worker.
        engine: String,
        /// What it lacks.
        result: OptionalResult,
    },
    /// Bitwise equal answers need one version of an engine.
    #[error(
        "engine `{} {}` does not equal `{} {}` of this run's first worker; results would depend on the worker",
        offered.0, offered.1, expected.0, expected.1
    )]
    Version {
        /// Engine and version of the worker.
        offered: (String, String),
        /// Those of the first worker of the group.
        expected: (String, String),
    },
}
