//! Jobs that wait for a worker: one queue for each worker, with the jobs whose state it probably holds (their affinity), and
//! one for jobs without affinity. In every queue the job with the longest expected duration comes first.

mod queue_index;

use protocol::transport::WorkerId;
use queue_index::QueueIndex;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Place in a queue.
type Rank = (Reverse<u64>, usize);

/// What the queue needs to know of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct QueuedJob {
    /// Index of the job in its batch.
    pub(super) job: usize,
    /// Expected force evaluations.
    pub(super) expected: u64,
    /// Definition of its point: a message holds one definition.
    pub(super) definition: usize,
    /// Which workers may solve it: see [`JobQueues`].
    pub(super) group: usize,
    /// Whether it has ended a worker: such a job travels alone, so that the next loss identifies it.
    pub(super) quarantine_candidate: bool,
}

impl QueuedJob {
    /// Longest first; equal expectations in job order, which is the order of points.
    fn rank(&self) -> Rank {
        (Reverse(self.expected), self.job)
    }
}

/// Jobs with one affinity, in the order of their ranks.
#[derive(Debug, Default)]
struct WorkerQueue {
    jobs: BTreeMap<Rank, QueuedJob>,
    expected: u128,
}

impl WorkerQueue {
    fn add(&mut self, job: QueuedJob) {
        self.expected += u128::from(job.expected);
        self.jobs.insert(job.rank(), job);
    }

    /// Expected force evaluations of its longest job.
    fn head(&self) -> u64 {
        self.jobs.first_key_value().map_or(0, |(_, job)| job.expected)
    }

    /// Takes up to `most` jobs of one definition, the longest first, as many as come nearest to `work` expected force evaluations.
    fn take(&mut self, most: usize, work: u128) -> Vec<usize> {
        let Some((_, first)) = self.jobs.pop_first() else { return Vec::new() };
        let mut taken = vec![first];
        if most > 1 && !first.quarantine_candidate {
            let alike = |job: &&QueuedJob| job.definition == first.definition && !job.quarantine_candidate;
            let mut sum = u128::from(first.expected);
            let fits = |job: &&QueuedJob| {
                let has_room = sum.saturating_add(u128::from(job.expected) / 2) <= work;
                sum += u128::from(job.expected);
                has_room
            };
            taken.extend(self.jobs.values().filter(alike).take(most - 1).take_while(fits));
            for job in &taken[1..] {
                self.jobs.remove(&job.rank());
            }
        }
        self.expected -= taken.iter().map(|job| u128::from(job.expected)).sum::<u128>();
        taken.into_iter().map(|job| job.job).collect()
    }
}

/// The waiting jobs of one group of workers. `None` is the affinity of jobs whose state no worker holds.
#[derive(Debug, Default)]
pub(super) struct GroupQueue {
    queues: BTreeMap<Option<WorkerId>, WorkerQueue>,
    /// All queues by their longest job, so that no decision has to look at each of them.
    index: QueueIndex,
    length: usize,
    expected: u128,
}

impl GroupQueue {
    /// Number of waiting jobs.
    pub(super) fn len(&self) -> usize {
        self.length
    }

    /// Adds a job at its rank.
    pub(super) fn add(&mut self, affinity: Option<WorkerId>, job: QueuedJob) {
        self.edit(affinity, |queue| queue.add(job));
    }

    /// Expected force evaluations of all waiting jobs.
    fn expected(&self) -> u128 {
        self.expected
    }

    /// Expected force evaluations of the job that `worker` would get next; 0 when nothing waits.
    fn next_expected(&self, worker: WorkerId) -> u64 {
        self.queue_for(worker).and_then(|affinity| self.queues.get(&affinity)).map_or(0, WorkerQueue::head)
    }

    /// Takes up to `most` jobs of one definition for `worker`, the longest of a queue first, as many as come nearest to `work` expected
    /// force evaluations. Of the queues whose longest job is among the long ones of all: the worker's own, else that of jobs
    /// without affinity, else that with most work left (lowest worker number among equals).
    pub(super) fn take(&mut self, worker: WorkerId, most: usize, work: u128) -> Vec<usize> {
        let Some(affinity) = self.queue_for(worker) else { return Vec::new() };
        self.edit(affinity, |queue| queue.take(most, work))
    }

    /// Takes the affinity from the jobs of a lost worker.
    pub(super) fn unassign(&mut self, worker: WorkerId) {
        let jobs = self.edit(Some(worker), |queue| std::mem::take(queue).jobs);
        jobs.into_values().for_each(|job| self.add(None, job));
    }

    /// Removes all jobs for which `keep` is false and returns their number.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) -> usize {
        let before = self.length;
        let affinities: Vec<_> = self.queues.keys().copied().collect();
        for affinity in affinities {
            self.edit(affinity, |queue| {
                queue.jobs.retain(|_, job| keep(job.job));
                queue.expected = queue.jobs.values().map(|job| u128::from(job.expected)).sum();
            });
        }
        before - self.length
    }

    /// Changes a queue, which is made if there is none and removed if it is empty then; sums and index follow.
    fn edit<T>(&mut self, affinity: Option<WorkerId>, change: impl FnOnce(&mut WorkerQueue) -> T) -> T {
        let queue = self.queues.entry(affinity).or_default();
        if !queue.jobs.is_empty() {
            self.index.remove(affinity, queue.head(), queue.expected);
        }
        self.length -= queue.jobs.len();
        self.expected -= queue.expected;
        let outcome = change(queue);
        self.length += queue.jobs.len();
        self.expected += queue.expected;
        if queue.jobs.is_empty() {
            self.queues.remove(&affinity);
        } else {
            self.index.insert(affinity, queue.head(), queue.expected);
        }
        outcome
    }

    fn queue_for(&self, worker: WorkerId) -> Option<Option<WorkerId>> {
        // A long job that starts late keeps all others waiting, and carrying a state costs a hundredth of a job: length
        // goes before affinity. The cost model is wrong by up to a factor of two.
        let least = self.index.longest()?.div_ceil(2);
        let is_long = |queue: &WorkerQueue| queue.head() >= least;
        let own_or_unassigned =
            [Some(worker), None].into_iter().find(|affinity| self.queues.get(affinity).is_some_and(is_long));
        own_or_unassigned.or_else(|| self.index.most_work(least))
    }
}

/// One queue per group of workers. A run on one engine has one group; where points are given to several engines, each
/// engine's workers are a group and see only its points.
#[derive(Debug, Default)]
pub(super) struct JobQueues {
    groups: BTreeMap<usize, GroupQueue>,
}

impl JobQueues {
    /// Number of waiting jobs of a group.
    pub(super) fn waiting(&self, group: usize) -> usize {
        self.groups.get(&group).map_or(0, GroupQueue::len)
    }

    /// Expected force evaluations of a group's waiting jobs.
    pub(super) fn expected(&self, group: usize) -> u128 {
        self.groups.get(&group).map_or(0, GroupQueue::expected)
    }

    /// Expected force evaluations of the job of a group that `worker` would get next; 0 when nothing waits.
    pub(super) fn next_expected(&self, group: usize, worker: WorkerId) -> u64 {
        self.groups.get(&group).map_or(0, |queue| queue.next_expected(worker))
    }

    /// Groups with waiting jobs, in order.
    pub(super) fn groups(&self) -> Vec<usize> {
        self.groups.iter().filter(|(_, queue)| queue.len() > 0).map(|(group, _)| *group).collect()
    }

    /// Adds a job at its rank in its group.
    pub(super) fn add(&mut self, affinity: Option<WorkerId>, job: QueuedJob) {
        self.groups.entry(job.group).or_default().add(affinity, job);
    }

    /// See [`GroupQueue::take`].
    pub(super) fn take(&mut self, group: usize, worker: WorkerId, most: usize, work: u128) -> Vec<usize> {
        self.groups.get_mut(&group).map_or_else(Vec::new, |queue| queue.take(worker, most, work))
    }

    /// Takes the affinity from the jobs of a lost worker.
    pub(super) fn unassign(&mut self, worker: WorkerId) {
        self.groups.values_mut().for_each(|queue| queue.unassign(worker));
    }

    /// Removes all jobs for which `keep` is false and returns their number.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) -> usize {
        self.groups.values_mut().map(|queue| queue.retain(&keep)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(job: usize, expected: u64) -> QueuedJob {
        QueuedJob { job, expected, definition: 0, group: 0, quarantine_candidate: false }
    }

    const FIRST: WorkerId = WorkerId(1);
    const SECOND: WorkerId = WorkerId(2);
    const THIRD: WorkerId = WorkerId(3);

    #[test]
    fn longest_goes_first_and_equals_in_point_order() {
        let mut queue = GroupQueue::default();
        for (number, expected) in [(2, 5), (0, 5), (1, 9)] {
            queue.add(None, job(number, expected));
        }
        let order: Vec<_> = (0..3).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [1, 0, 2]);
        assert_eq!(queue.len(), 0);
    }

    #[test]
    fn message_ends_where_it_is_nearest_to_its_work() {
        let mut queue = GroupQueue::default();
        for (number, expected) in [(0, 100), (1, 30), (2, 30), (3, 30), (4, 0), (5, 0)] {
            queue.add(None, job(number, expected));
        }
        assert_eq!(queue.take(FIRST, 8, 95), [0]);
        assert_eq!(queue.take(SECOND, 8, 45), [1, 2]);
        assert_eq!(queue.take(THIRD, 1, 45), [3]);
        assert_eq!(queue.take(FIRST, 8, 0), [4, 5], "jobs of unknown length");
        queue.add(None, job(0, 80));
        queue.add(None, job(1, 75));
        assert_eq!(queue.take(FIRST, 8, 100), [0], "not twice what it may hold");
    }

    #[test]
    fn order_among_equal_jobs_is_own_then_unassigned_then_those_of_the_busiest_worker() {
        let mut queue = GroupQueue::default();
        queue.add(Some(FIRST), job(0, 50));
        queue.add(None, job(1, 60));
        queue.add(Some(SECOND), job(2, 100));
        queue.add(Some(SECOND), job(3, 60));
        queue.add(Some(THIRD), job(4, 70));
        let order: Vec<_> = (0..5).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [0, 1, 2, 4, 3]);
    }

    #[test]
    fn a_job_that_is_much_longer_goes_before_the_own() {
        let mut queue = GroupQueue::default();
        queue.add(Some(FIRST), job(0, 40));
        queue.add(None, job(1, 30));
        queue.add(Some(SECOND), job(2, 100));
        assert_eq!((queue.next_expected(FIRST), queue.expected()), (100, 170));
        let order: Vec<_> = (0..3).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [2, 0, 1]);
        assert_eq!((queue.next_expected(FIRST), queue.expected()), (0, 0));
    }

    #[test]
    fn message_holds_one_definition_and_quarantine_candidates_travel_alone() {
        let mut queue = GroupQueue::default();
        queue.add(None, job(0, 9));
        queue.add(None, QueuedJob { definition: 1, ..job(1, 8) });
        queue.add(None, QueuedJob { quarantine_candidate: true, ..job(2, 7) });
        queue.add(None, job(3, 6));
        assert_eq!(queue.take(FIRST, 8, u128::MAX), [0, 3]);
        assert_eq!(queue.take(FIRST, 8, u128::MAX), [1]);
        assert_eq!(queue.take(FIRST, 8, u128::MAX), [2]);
        assert!(queue.take(FIRST, 8, u128::MAX).is_empty());
    }

    #[test]
    fn jobs_of_a_lost_worker_lose_their_affinity_and_keep_their_order() {
        let mut queue = GroupQueue::default();
        queue.add(Some(SECOND), job(3, 10));
        queue.add(None, job(1, 5));
        queue.add(Some(SECOND), job(0, 1));
        queue.unassign(SECOND);
        assert_eq!(queue.len(), 3);
        let order: Vec<_> = (0..3).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [3, 1, 0]);
        queue.add(None, job(7, 1));
        queue.add(Some(THIRD), job(8, 1));
        assert_eq!(queue.retain(|job| job == 8), 1);
        assert_eq!(queue.take(FIRST, 1, u128::MAX), [8]);
    }
}
