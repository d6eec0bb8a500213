//! Jobs that wait for a worker, longest expected first, sorted by the worker that probably holds their state.

mod queue_index;

use protocol::transport::WorkerId;
use queue_index::LineIndex;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Place in a line.
type Rank = (Reverse<u64>, usize);

/// What the queue needs to know of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ticket {
    /// Index of the job in its batch.
    pub(super) job: usize,
    /// Expected force evaluations.
    pub(super) expected: u64,
    /// Definition of its point: one slice holds one definition.
    pub(super) definition: usize,
    /// Which workers may solve it: see [`Queues`].
    pub(super) group: usize,
    /// Whether it has ended a worker: such a job travels alone, so the next victim names the culprit.
    pub(super) suspect: bool,
}

impl Ticket {
    /// Longest first; equal expectations in job order, which is the order of points.
    fn rank(&self) -> Rank {
        (Reverse(self.expected), self.job)
    }
}

/// Line of jobs with one home, in the order of their ranks.
#[derive(Debug, Default)]
struct Line {
    tickets: BTreeMap<Rank, Ticket>,
    expected: u128,
}

impl Line {
    fn add(&mut self, ticket: Ticket) {
        self.expected += u128::from(ticket.expected);
        self.tickets.insert(ticket.rank(), ticket);
    }

    /// Expectation of its longest job.
    fn head(&self) -> u64 {
        self.tickets.first_key_value().map_or(0, |(_, ticket)| ticket.expected)
    }

    /// Takes up to `most` jobs of one definition, the longest first, until they exceed `work` expected force evaluations.
    fn take(&mut self, most: usize, work: u128) -> Vec<usize> {
        let Some((_, first)) = self.tickets.pop_first() else { return Vec::new() };
        let mut taken = vec![first];
        if most > 1 && !first.suspect {
            let alike = |ticket: &&Ticket| ticket.definition == first.definition && !ticket.suspect;
            let mut sum = u128::from(first.expected);
            let fits = |ticket: &&Ticket| {
                let has_room = sum <= work;
                sum += u128::from(ticket.expected);
                has_room
            };
            taken.extend(self.tickets.values().filter(alike).take(most - 1).take_while(fits));
            for ticket in &taken[1..] {
                self.tickets.remove(&ticket.rank());
            }
        }
        self.expected -= taken.iter().map(|ticket| u128::from(ticket.expected)).sum::<u128>();
        taken.into_iter().map(|ticket| ticket.job).collect()
    }
}

/// The waiting jobs. `None` is the home of jobs whose state nobody holds.
#[derive(Debug, Default)]
pub(super) struct Queue {
    lines: BTreeMap<Option<WorkerId>, Line>,
    /// All lines by their longest job, so that no decision has to look at every line.
    index: LineIndex,
    length: usize,
    expected: u128,
}

impl Queue {
    /// Number of waiting jobs.
    pub(super) fn len(&self) -> usize {
        self.length
    }

    /// Adds a job at its rank.
    pub(super) fn add(&mut self, home: Option<WorkerId>, ticket: Ticket) {
        self.edit(home, |line| line.add(ticket));
    }

    /// Expected force evaluations of all waiting jobs.
    fn expected(&self) -> u128 {
        self.expected
    }

    /// Expected force evaluations of the job that `worker` would get next; 0 when nothing waits.
    fn next_expected(&self, worker: WorkerId) -> u64 {
        self.line_for(worker).and_then(|home| self.lines.get(&home)).map_or(0, Line::head)
    }

    /// Takes up to `most` jobs of one definition for `worker`, the longest of a line first, until they exceed `work` expected
    /// force evaluations. Of the lines whose longest
    /// job is among the long ones of all: its own, else that of jobs at home nowhere, else that with most work left
    /// (lowest worker number among equals).
    pub(super) fn take(&mut self, worker: WorkerId, most: usize, work: u128) -> Vec<usize> {
        let Some(home) = self.line_for(worker) else { return Vec::new() };
        self.edit(home, |line| line.take(most, work))
    }

    /// Makes the jobs of a lost worker homeless.
    pub(super) fn disown(&mut self, worker: WorkerId) {
        let tickets = self.edit(Some(worker), |line| std::mem::take(line).tickets);
        tickets.into_values().for_each(|ticket| self.add(None, ticket));
    }

    /// Removes all jobs for which `keep` is false and returns how many they were.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) -> usize {
        let before = self.length;
        let homes: Vec<_> = self.lines.keys().copied().collect();
        for home in homes {
            self.edit(home, |line| {
                line.tickets.retain(|_, ticket| keep(ticket.job));
                line.expected = line.tickets.values().map(|ticket| u128::from(ticket.expected)).sum();
            });
        }
        before - self.length
    }

    /// Changes a line, which is made if there is none and removed if it is empty then; sums and index follow.
    fn edit<T>(&mut self, home: Option<WorkerId>, change: impl FnOnce(&mut Line) -> T) -> T {
        let line = self.lines.entry(home).or_default();
        if !line.tickets.is_empty() {
            self.index.leave(home, line.head(), line.expected);
        }
        self.length -= line.tickets.len();
        self.expected -= line.expected;
        let outcome = change(line);
        self.length += line.tickets.len();
        self.expected += line.expected;
        if line.tickets.is_empty() {
            self.lines.remove(&home);
        } else {
            self.index.enter(home, line.head(), line.expected);
        }
        outcome
    }

    fn line_for(&self, worker: WorkerId) -> Option<Option<WorkerId>> {
        // A long job that starts late keeps all others waiting, and carrying a state costs a hundredth of a job: length
        // goes before home. Less than a factor of two is what forecasts are wrong anyway.
        let least = self.index.longest()?.div_ceil(2);
        let is_long = |line: &Line| line.head() >= least;
        let at_home = [Some(worker), None].into_iter().find(|home| self.lines.get(home).is_some_and(is_long));
        at_home.or_else(|| self.index.most_work(least))
    }
}

/// One queue per group of workers. A run on one engine has one group; where points are given to several engines, each
/// engine's workers are a group and see only its points.
#[derive(Debug, Default)]
pub(super) struct Queues {
    groups: BTreeMap<usize, Queue>,
}

impl Queues {
    /// Number of waiting jobs of a group.
    pub(super) fn waiting(&self, group: usize) -> usize {
        self.groups.get(&group).map_or(0, Queue::len)
    }

    /// Expected force evaluations of a group's waiting jobs.
    pub(super) fn expected(&self, group: usize) -> u128 {
        self.groups.get(&group).map_or(0, Queue::expected)
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
    pub(super) fn add(&mut self, home: Option<WorkerId>, ticket: Ticket) {
        self.groups.entry(ticket.group).or_default().add(home, ticket);
    }

    /// See [`Queue::take`].
    pub(super) fn take(&mut self, group: usize, worker: WorkerId, most: usize, work: u128) -> Vec<usize> {
        self.groups.get_mut(&group).map_or_else(Vec::new, |queue| queue.take(worker, most, work))
    }

    /// Makes the jobs of a lost worker homeless.
    pub(super) fn disown(&mut self, worker: WorkerId) {
        self.groups.values_mut().for_each(|queue| queue.disown(worker));
    }

    /// Removes all jobs for which `keep` is false and returns how many they were.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) -> usize {
        self.groups.values_mut().map(|queue| queue.retain(&keep)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticket(job: usize, expected: u64) -> Ticket {
        Ticket { job, expected, definition: 0, group: 0, suspect: false }
    }

    const FIRST: WorkerId = WorkerId(1);
    const SECOND: WorkerId = WorkerId(2);
    const THIRD: WorkerId = WorkerId(3);

    #[test]
    fn longest_goes_first_and_equals_in_point_order() {
        let mut queue = Queue::default();
        for (job, expected) in [(2, 5), (0, 5), (1, 9)] {
            queue.add(None, ticket(job, expected));
        }
        let order: Vec<_> = (0..3).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [1, 0, 2]);
        assert_eq!(queue.len(), 0);
    }

    #[test]
    fn message_ends_with_the_job_that_exceeds_its_work() {
        let mut queue = Queue::default();
        for (job, expected) in [(0, 100), (1, 30), (2, 30), (3, 30), (4, 0), (5, 0)] {
            queue.add(None, ticket(job, expected));
        }
        assert_eq!(queue.take(FIRST, 8, 95), [0]);
        assert_eq!(queue.take(SECOND, 8, 45), [1, 2]);
        assert_eq!(queue.take(THIRD, 1, 45), [3]);
        assert_eq!(queue.take(FIRST, 8, 0), [4, 5], "jobs of unknown length");
    }

    #[test]
    fn of_jobs_alike_the_own_come_first_then_homeless_ones_then_those_of_the_busiest() {
        let mut queue = Queue::default();
        queue.add(Some(FIRST), ticket(0, 50));
        queue.add(None, ticket(1, 60));
        queue.add(Some(SECOND), ticket(2, 100));
        queue.add(Some(SECOND), ticket(3, 60));
        queue.add(Some(THIRD), ticket(4, 70));
        let order: Vec<_> = (0..5).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [0, 1, 2, 4, 3]);
    }

    #[test]
    fn a_job_that_is_much_longer_goes_before_the_own() {
        let mut queue = Queue::default();
        queue.add(Some(FIRST), ticket(0, 40));
        queue.add(None, ticket(1, 30));
        queue.add(Some(SECOND), ticket(2, 100));
        assert_eq!((queue.next_expected(FIRST), queue.expected()), (100, 170));
        let order: Vec<_> = (0..3).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [2, 0, 1]);
        assert_eq!((queue.next_expected(FIRST), queue.expected()), (0, 0));
    }

    #[test]
    fn a_slice_holds_one_definition_and_suspects_travel_alone() {
        let mut queue = Queue::default();
        queue.add(None, ticket(0, 9));
        queue.add(None, Ticket { definition: 1, ..ticket(1, 8) });
        queue.add(None, Ticket { suspect: true, ..ticket(2, 7) });
        queue.add(None, ticket(3, 6));
        assert_eq!(queue.take(FIRST, 8, u128::MAX), [0, 3]);
        assert_eq!(queue.take(FIRST, 8, u128::MAX), [1]);
        assert_eq!(queue.take(FIRST, 8, u128::MAX), [2]);
        assert!(queue.take(FIRST, 8, u128::MAX).is_empty());
    }

    #[test]
    fn jobs_of_a_lost_worker_become_homeless_in_order() {
        let mut queue = Queue::default();
        queue.add(Some(SECOND), ticket(3, 10));
        queue.add(None, ticket(1, 5));
        queue.add(Some(SECOND), ticket(0, 1));
        queue.disown(SECOND);
        assert_eq!(queue.len(), 3);
        let order: Vec<_> = (0..3).flat_map(|_| queue.take(FIRST, 1, u128::MAX)).collect();
        assert_eq!(order, [3, 1, 0]);
        queue.add(None, ticket(7, 1));
        queue.add(Some(THIRD), ticket(8, 1));
        assert_eq!(queue.retain(|job| job == 8), 1);
        assert_eq!(queue.take(FIRST, 1, u128::MAX), [8]);
    }
}
