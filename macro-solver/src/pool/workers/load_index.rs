//! Which worker of each group is idle, which has the least work and whose deadline comes first: updated with every change,
//! so that a decision costs the same with four workers and with four thousand.

use super::Worker;
use protocol::transport::WorkerId;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// What the index needs to know of a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::pool) struct Entry {
    /// Its place among those that get jobs: group, messages held, expected force evaluations of these.
    serves: Option<(usize, usize, u128)>,
    /// When it counts as hung.
    deadline: Option<Instant>,
}

impl Entry {
    /// The entry of a worker.
    pub(in crate::pool) fn of(worker: &Worker) -> Self {
        let serves = worker.is_active().then(|| (worker.group, worker.pending.len(), worker.load()));
        Self { serves, deadline: worker.deadline() }
    }
}

/// The workers of one group that get jobs.
#[derive(Debug, Default)]
struct Group {
    count: usize,
    /// Expected force evaluations of all that they hold.
    load: u128,
    /// By number of messages held: load and number.
    by_depth: BTreeMap<usize, BTreeSet<(u128, WorkerId)>>,
}

/// The index of all workers.
#[derive(Debug, Default)]
pub(in crate::pool) struct LoadIndex {
    groups: BTreeMap<usize, Group>,
    deadlines: BTreeSet<(Instant, WorkerId)>,
    active: usize,
}

impl LoadIndex {
    /// Inserts a worker.
    pub(in crate::pool) fn insert(&mut self, worker: WorkerId, entry: Entry) {
        if let Some(deadline) = entry.deadline {
            self.deadlines.insert((deadline, worker));
        }
        let Some((group, depth, load)) = entry.serves else { return };
        let group = self.groups.entry(group).or_default();
        group.count += 1;
        group.load += load;
        group.by_depth.entry(depth).or_default().insert((load, worker));
        self.active += 1;
    }

    /// Removes a worker; `entry` is what it was inserted with.
    pub(in crate::pool) fn remove(&mut self, worker: WorkerId, entry: Entry) {
        if let Some(deadline) = entry.deadline {
            self.deadlines.remove(&(deadline, worker));
        }
        let Some((group, depth, load)) = entry.serves else { return };
        let group = self.groups.get_mut(&group).expect("a worker that was inserted has a group");
        group.count -= 1;
        group.load -= load;
        let alike = group.by_depth.get_mut(&depth).expect("a worker that was inserted has a depth");
        alike.remove(&(load, worker));
        if alike.is_empty() {
            group.by_depth.remove(&depth);
        }
        self.active -= 1;
    }

    /// Number of workers that get jobs.
    pub(in crate::pool) fn active(&self) -> usize {
        self.active
    }

    /// Number of workers of a group that get jobs.
    pub(in crate::pool) fn active_in(&self, group: usize) -> usize {
        self.groups.get(&group).map_or(0, |group| group.count)
    }

    /// Number of workers of a group that hold no messages.
    pub(in crate::pool) fn idle_in(&self, group: usize) -> usize {
        self.groups.get(&group).and_then(|group| group.by_depth.get(&0)).map_or(0, BTreeSet::len)
    }

    /// Expected force evaluations that the workers of a group were sent and have not answered.
    pub(in crate::pool) fn load(&self, group: usize) -> u128 {
        self.groups.get(&group).map_or(0, |group| group.load)
    }

    /// The worker of a group with the least expected work among those that hold fewer than `depth` messages, and that work;
    /// the lowest number among equals.
    pub(in crate::pool) fn least_loaded(&self, group: usize, depth: usize) -> Option<(WorkerId, u128)> {
        let alike = self.groups.get(&group)?.by_depth.range(..depth);
        alike.filter_map(|(_, workers)| workers.first()).min().map(|(load, worker)| (*worker, *load))
    }

    /// Earliest time at which some worker counts as hung.
    pub(in crate::pool) fn next_deadline(&self) -> Option<Instant> {
        self.deadlines.first().map(|(deadline, _)| *deadline)
    }
}
