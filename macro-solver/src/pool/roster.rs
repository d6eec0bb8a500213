//! The workers of a run as the macro sees them.

use super::cache::CacheMirror;
use super::settings::{HangPolicy, PoolSettings};
use super::vitals::{Observation, Vitals};
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
    /// Told us that it leaves: no new jobs.
    Leaving,
    /// Was ended or cannot be reached; nothing it says counts and its jobs wait for the news of its end, so that no
    /// job runs twice at a time.
    Condemned,
    /// Its hello was refused.
    Refused,
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

    /// Every job it holds, in the order sent.
    pub(super) fn held(&self) -> Vec<u64> {
        self.slices.iter().flat_map(|slice| slice.jobs.iter().copied()).collect()
    }

    /// Expected force evaluations of its unanswered slices.
    fn load(&self) -> u128 {
        self.slices.iter().map(|slice| slice.expected).sum()
    }

    /// When it counts as hung; `None` while it has nothing to do. Time in which it got no processor does not count.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let head = self.slices.front()?;
        (self.standing == Standing::Active).then(|| self.head_since + head.allowance + self.seen.starved)
    }

    /// Why it is to be ended, if it is.
    fn stuck(&self, now: Instant, hang: &HangPolicy) -> Option<String> {
        let deadline = self.deadline()?;
        if let Some(stopped) = self.seen.stopped(now).filter(|stopped| *stopped >= hang.stopped) {
            return Some(format!("stopped for {:.1} s", stopped.as_secs_f64()));
        }
        (deadline <= now).then(|| {
            let passed = now.saturating_duration_since(self.head_since).as_secs_f64();
            format!("no answer for {passed:.1} s, longer than the job may take")
        })
    }
}

/// All workers ever heard of that have not ended.
#[derive(Debug, Default)]
pub(super) struct Roster {
    pub(super) workers: BTreeMap<WorkerId, Worker>,
    /// Engine and version of the first worker of each group: bitwise equal answers need the same in all.
    engines: BTreeMap<usize, (String, String)>,
}

impl Roster {
    /// Number of workers that get jobs.
    pub(super) fn active(&self) -> usize {
        self.workers.values().filter(|worker| worker.standing == Standing::Active).count()
    }

    /// Whether this worker gets jobs.
    pub(super) fn is_active(&self, worker: WorkerId) -> bool {
        self.workers.get(&worker).is_some_and(|known| known.standing == Standing::Active)
    }

    /// Number of workers of a group that get jobs.
    pub(super) fn active_in(&self, group: usize) -> usize {
        self.serving(group).count()
    }

    fn serving(&self, group: usize) -> impl Iterator<Item = (WorkerId, &Worker)> {
        let serves = move |worker: &Worker| worker.standing == Standing::Active && worker.group == group;
        self.workers.iter().filter(move |(_, worker)| serves(worker)).map(|(id, worker)| (*id, worker))
    }

    /// A worker of a group that has nothing to do; the lowest number among several.
    pub(super) fn idle(&self, group: usize) -> Option<WorkerId> {
        self.serving(group).find(|(_, worker)| worker.slices.is_empty()).map(|(id, _)| id)
    }

    /// The worker of a group with the least expected work among those that hold fewer than `depth` slices, and that work;
    /// the lowest number among equals.
    pub(super) fn least_loaded(&self, group: usize, depth: usize) -> Option<(WorkerId, u128)> {
        let room = self.serving(group).filter(|(_, worker)| worker.slices.len() < depth);
        room.map(|(id, worker)| (id, worker.load())).min_by_key(|(id, load)| (*load, *id))
    }

    /// Expected force evaluations that the workers of a group were sent and have not answered.
    pub(super) fn load(&self, group: usize) -> u128 {
        self.serving(group).map(|(_, worker)| worker.load()).sum()
    }

    /// Earliest time at which some worker counts as hung.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.workers.values().filter_map(Worker::deadline).min()
    }

    /// Looks at the processes of the workers that have work; returns whether any of them is stopped.
    pub(super) fn look(&mut self, now: Instant, vitals: impl Fn(u32) -> Option<Vitals>) -> bool {
        let mut any_stopped = false;
        let busy = |worker: &&mut Worker| worker.standing == Standing::Active && !worker.slices.is_empty();
        for worker in self.workers.values_mut().filter(busy) {
            if let Some(vitals) = vitals(worker.pid) {
                worker.seen.take(&vitals, worker.head_since, now);
                any_stopped |= vitals.stopped;
            }
        }
        any_stopped
    }

    /// Workers that have been silent or stopped for too long, each with the reason.
    pub(super) fn hung(&self, now: Instant, hang: &HangPolicy) -> Vec<(WorkerId, String)> {
        self.workers.iter().filter_map(|(id, worker)| Some((*id, worker.stuck(now, hang)?))).collect()
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
