//! The workers of a run as the macro sees them.

pub(super) mod cache_mirror;
mod load_index;
pub(super) mod process_stats;

use super::settings::{HangPolicy, PoolSettings};
use cache_mirror::CacheMirror;
use load_index::{Entry, Rota};
use process_stats::{Observation, Vitals};
use protocol::transport::WorkerId;
use protocol::{Capabilities, PROTOCOL_VERSION};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, Instant};

/// A message of jobs that a worker has not answered completely.
#[derive(Clone, Debug)]
pub(super) struct Slice {
    /// Numbers of the unanswered jobs.
    pub(super) jobs: Vec<u64>,
    /// Expected force evaluations of what was sent.
    pub(super) expected: u128,
    /// How long it may take once the worker has begun it.
    pub(super) allowance: Duration,
}

/// Whether a worker gets jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// Gets jobs; its replies count.
    Active,
    /// Was asked to finish what it holds and to leave: no new jobs, but its replies count.
    Draining,
    /// Told us that it leaves: no new jobs.
    Leaving,
    /// Was ended or cannot be reached; nothing it says counts and its jobs wait for the news of its end, so that no
    /// job runs twice at a time.
    Condemned,
    /// Its hello was refused.
    Refused,
}

impl Standing {
    /// Whether what the worker says about its jobs counts.
    pub(super) fn answers(self) -> bool {
        matches!(self, Self::Active | Self::Draining)
    }
}

/// Why a worker has to be ended, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Stuck {
    /// Somebody has stopped its process.
    Stopped(String),
    /// It has been silent for longer than its job may take.
    Silent(String),
}

/// One worker.
#[derive(Clone, Debug)]
pub(super) struct Worker {
    pub(super) pid: u32,
    /// Which jobs it gets: see [`super::queue::Queues`].
    pub(super) group: usize,
    pub(super) standing: Standing,
    pub(super) cache: CacheMirror,
    /// Definitions it was sent.
    pub(super) definitions: BTreeSet<usize>,
    /// Unanswered slices in the order sent; it works on the first.
    pub(super) slices: VecDeque<Slice>,
    /// When it began the first slice.
    pub(super) head_since: Instant,
    /// What the kernel says about it while it has work.
    pub(super) seen: Observation,
    /// Index of its figures in the statistics.
    pub(super) tally: usize,
}

impl Worker {
    /// Whether it gets jobs.
    pub(super) fn is_active(&self) -> bool {
        self.standing == Standing::Active
    }

    /// Takes a job off the worker's hands; `false` when it did not hold it.
    pub(super) fn release(&mut self, job: u64, now: Instant) -> bool {
        for place in 0..self.slices.len() {
            let slice = &mut self.slices[place];
            let Some(position) = slice.jobs.iter().position(|held| *held == job) else { continue };
            slice.jobs.remove(position);
            if slice.jobs.is_empty() {
                self.slices.remove(place);
            }
            // Any sign of work restarts the clock of the rest.
            self.head_since = now;
            self.seen.begin_anew();
            return true;
        }
        false
    }

    /// Expected force evaluations of its unanswered slices.
    pub(super) fn load(&self) -> u128 {
        self.slices.iter().map(|slice| slice.expected).sum()
    }

    /// When it counts as hung; `None` while it has nothing to do. Time in which it got no processor does not count.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let head = self.slices.front()?;
        self.standing.answers().then(|| self.head_since + head.allowance + self.seen.starved)
    }

    /// Takes in what the kernel says about its process; returns whether that is stopped.
    fn look(&mut self, now: Instant, vitals: impl Fn(u32) -> Option<Vitals>) -> bool {
        let Some(vitals) = vitals(self.pid) else { return false };
        self.seen.take(&vitals, self.head_since, now);
        vitals.stopped
    }

    /// Why it is to be ended, if it is.
    fn stuck(&self, now: Instant, hang: &HangPolicy) -> Option<Stuck> {
        let deadline = self.deadline()?;
        if let Some(stopped) = self.seen.stopped(now).filter(|stopped| *stopped >= hang.stopped) {
            return Some(Stuck::Stopped(format!("stopped for {:.1} s", stopped.as_secs_f64())));
        }
        (deadline <= now).then(|| {
            let passed = now.saturating_duration_since(self.head_since).as_secs_f64();
            Stuck::Silent(format!("no answer for {passed:.1} s, longer than the job may take"))
        })
    }
}

/// All workers ever heard of that have not ended.
#[derive(Debug, Default)]
pub(super) struct Roster {
    workers: BTreeMap<WorkerId, Worker>,
    rota: Rota,
    /// Whether a worker with work was stopped at the last look.
    any_stopped: bool,
    /// Engine and version of the first worker of each group: bitwise equal answers need the same in all.
    engines: BTreeMap<usize, (String, String)>,
}

impl Roster {
    /// Takes in a worker that has said hello.
    pub(super) fn add(&mut self, id: WorkerId, worker: Worker) {
        self.rota.enter(id, Entry::of(&worker));
        self.workers.insert(id, worker);
    }

    /// Forgets a worker that has ended.
    pub(super) fn remove(&mut self, id: WorkerId) {
        if let Some(worker) = self.workers.remove(&id) {
            self.rota.leave(id, Entry::of(&worker));
        }
    }

    /// A worker as it stands.
    pub(super) fn get(&self, id: WorkerId) -> Option<&Worker> {
        self.workers.get(&id)
    }

    /// Changes a worker, if it is on the roster; the only way to do so, so that the rota follows.
    pub(super) fn edit<T>(&mut self, id: WorkerId, change: impl FnOnce(&mut Worker) -> T) -> Option<T> {
        let worker = self.workers.get_mut(&id)?;
        let before = Entry::of(worker);
        let outcome = change(worker);
        let after = Entry::of(worker);
        if after != before {
            self.rota.leave(id, before);
            self.rota.enter(id, after);
        }
        Some(outcome)
    }

    /// All workers, by number.
    pub(super) fn iter(&self) -> impl Iterator<Item = (WorkerId, &Worker)> {
        self.workers.iter().map(|(id, worker)| (*id, worker))
    }

    /// Moves every worker's figures to another place in the statistics.
    pub(super) fn renumber(&mut self, place: impl Fn(usize) -> usize) {
        self.workers.values_mut().for_each(|worker| worker.tally = place(worker.tally));
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.workers.is_empty()
    }

    /// Number of workers that get jobs.
    pub(super) fn active(&self) -> usize {
        self.rota.active()
    }

    /// Whether this worker gets jobs.
    pub(super) fn is_active(&self, worker: WorkerId) -> bool {
        self.workers.get(&worker).is_some_and(Worker::is_active)
    }

    /// Number of workers of a group that get jobs.
    pub(super) fn active_in(&self, group: usize) -> usize {
        self.rota.active_in(group)
    }

    /// A worker of a group that has nothing to do; the lowest number among several.
    pub(super) fn idle(&self, group: usize) -> Option<WorkerId> {
        self.rota.least_loaded(group, 1).map(|(worker, _)| worker)
    }

    /// See [`Rota::least_loaded`].
    pub(super) fn least_loaded(&self, group: usize, depth: usize) -> Option<(WorkerId, u128)> {
        self.rota.least_loaded(group, depth)
    }

    /// Expected force evaluations that the workers of a group were sent and have not answered.
    pub(super) fn load(&self, group: usize) -> u128 {
        self.rota.load(group)
    }

    /// Earliest time at which some worker counts as hung.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.rota.next_deadline()
    }

    /// Looks at the processes of the workers that have work; returns whether any of them is stopped.
    pub(super) fn look(&mut self, now: Instant, vitals: impl Fn(u32) -> Option<Vitals>) -> bool {
        self.any_stopped = false;
        for id in self.busy() {
            self.any_stopped |= self.edit(id, |worker| worker.look(now, &vitals)).unwrap_or(false);
        }
        self.any_stopped
    }

    /// Workers that have jobs in hand.
    pub(super) fn busy(&self) -> Vec<WorkerId> {
        let busy = |worker: &Worker| worker.standing.answers() && !worker.slices.is_empty();
        self.iter().filter(|(_, worker)| busy(worker)).map(|(id, _)| id).collect()
    }

    /// Workers that have been silent or stopped for too long, each with the reason.
    pub(super) fn hung(&self, now: Instant, hang: &HangPolicy) -> Vec<(WorkerId, Stuck)> {
        let due = self.next_deadline().is_some_and(|deadline| deadline <= now);
        if !due && !self.any_stopped {
            return Vec::new();
        }
        self.iter().filter_map(|(id, worker)| Some((id, worker.stuck(now, hang)?))).collect()
    }

    /// Checks a hello and returns the worker's group.
    ///
    /// # Errors
    /// Why the worker cannot take part, with the remedy.
    pub(super) fn admit(
        &mut self,
        settings: &PoolSettings,
        protocol: u32,
        run: &str,
        capabilities: &Capabilities,
    ) -> Result<usize, String> {
        if protocol != PROTOCOL_VERSION {
            return Err(format!(
                "the worker speaks protocol version {protocol}, this run version {PROTOCOL_VERSION}; start both from \
                 the same build of grainspan"
            ));
        }
        if run != settings.run {
            return Err(format!("the worker asks for run `{run}`, this is run `{}`; check --run", settings.run));
        }
        let engine = &capabilities.engine;
        if !capabilities.dimensions.contains(&settings.dimension) {
            return Err(format!(
                "engine `{engine}` does not serve {} dimensions; choose another engine or scene",
                settings.dimension
            ));
        }
        if let Some(missing) = settings.tangents.iter().find(|kind| !capabilities.tangents.contains(kind)) {
            return Err(format!(
                "engine `{engine}` cannot deliver the tangent `{}`; choose another tangent in the scene",
                missing.keyword()
            ));
        }
        let Some(group) = settings.group_of(engine) else {
            return Err(format!(
                "engine `{engine}` solves no point of this run, whose engines are {}; start the worker with another",
                settings.engines.join(", ")
            ));
        };
        let offered = (engine.clone(), capabilities.version.clone());
        let expected = self.engines.entry(group).or_insert_with(|| offered.clone());
        if *expected != offered {
            return Err(format!(
                "engine `{} {}` does not equal `{} {}` of this run's first worker; results would depend on who solves \
                 what",
                offered.0, offered.1, expected.0, expected.1
            ));
        }
        Ok(group)
    }
}
