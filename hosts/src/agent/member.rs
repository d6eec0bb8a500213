//! The workers of one host as their agent knows them.

use super::Replies;
use protocol::control::FromWorker;
use protocol::transport::{LoadedJob, WorkerId};
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

/// One worker that has said hello here.
#[derive(Debug)]
pub(super) struct Member {
    /// Its process.
    pub(super) pid: u32,
    /// Its number on the present connection; none until it is announced.
    pub(super) slot: Option<u32>,
    /// Whether it has said that it leaves.
    pub(super) leaving: bool,
    /// Whether it has answered any job.
    pub(super) has_answered: bool,
    hello: FromWorker,
    /// Jobs that it owes replies to.
    owed: BTreeSet<u64>,
    /// Set while it owes replies to jobs of an earlier connection: since when.
    stale: Option<Instant>,
}

/// All of them.
#[derive(Debug, Default)]
pub(super) struct Members {
    members: BTreeMap<WorkerId, Member>,
    by_slot: BTreeMap<u32, WorkerId>,
    slots: u32,
}

impl Members {
    /// A worker has said hello; returns its process if it was not known.
    pub(super) fn add(&mut self, worker: WorkerId, hello: FromWorker) -> Option<u32> {
        let FromWorker::Hello { pid, .. } = hello else { return None };
        if self.members.contains_key(&worker) {
            return None;
        }
        let member = Member {
            pid,
            slot: None,
            leaving: false,
            has_answered: false,
            hello,
            owed: BTreeSet::new(),
            stale: None,
        };
        self.members.insert(worker, member);
        Some(pid)
    }

    /// Takes out a worker that has ended.
    pub(super) fn remove(&mut self, worker: WorkerId) -> Option<Member> {
        let gone = self.members.remove(&worker)?;
        if let Some(slot) = gone.slot {
            self.by_slot.remove(&slot);
        }
        Some(gone)
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// All of them.
    pub(super) fn all(&self) -> Vec<WorkerId> {
        self.members.keys().copied().collect()
    }

    /// The worker with this number on the connection.
    pub(super) fn at(&self, slot: u32) -> Option<WorkerId> {
        self.by_slot.get(&slot).copied()
    }

    /// Its number on the connection.
    pub(super) fn slot(&self, worker: WorkerId) -> Option<u32> {
        self.members.get(&worker)?.slot
    }

    /// Its process.
    pub(super) fn pid(&self, worker: WorkerId) -> Option<u32> {
        Some(self.members.get(&worker)?.pid)
    }

    /// It has said that it leaves.
    pub(super) fn leaves(&mut self, worker: WorkerId) {
        if let Some(member) = self.members.get_mut(&worker) {
            member.leaving = true;
        }
    }

    /// Workers that the macro can be told of and has not been told of.
    pub(super) fn announceable(&self) -> Vec<WorkerId> {
        let ready = |member: &Member| member.slot.is_none() && member.stale.is_none() && !member.leaving;
        self.members.iter().filter(|(_, member)| ready(member)).map(|(worker, _)| *worker).collect()
    }

    /// Gives a worker its number on the connection to `run`, and the hello that the macro is to hear.
    pub(super) fn announce(&mut self, worker: WorkerId, run: &str) -> Option<(u32, FromWorker)> {
        let member = self.members.get_mut(&worker)?;
        let FromWorker::Hello { protocol, capabilities, state_cache, .. } = &member.hello else { return None };
        let (protocol, capabilities, state_cache) = (*protocol, capabilities.clone(), *state_cache);
        let slot = self.slots;
        self.slots += 1;
        member.slot = Some(slot);
        self.by_slot.insert(slot, worker);
        Some((slot, FromWorker::Hello { protocol, run: run.to_owned(), pid: 0, capabilities, state_cache }))
    }

    /// It was given jobs.
    pub(super) fn given(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) {
        if let Some(member) = self.members.get_mut(&worker) {
            member.owed.extend(jobs.iter().map(|one| one.job.job));
        }
    }

    /// It has answered; returns whether the macro is to hear it: not if a connection has ended since the jobs were given.
    pub(super) fn answered(&mut self, worker: WorkerId, replies: Replies<'_>) -> bool {
        let Some(member) = self.members.get_mut(&worker) else { return false };
        member.has_answered = true;
        for one in replies {
            member.owed.remove(&one.reply.job);
        }
        let was_stale = member.stale.is_some();
        if member.owed.is_empty() {
            member.stale = None;
        }
        !was_stale
    }

    /// The connection has ended.
    pub(super) fn cut_off(&mut self, now: Instant) {
        self.by_slot.clear();
        // Slots are counted for each connection anew: no message of one reaches the other.
        self.slots = 0;
        for member in self.members.values_mut() {
            member.slot = None;
            if !member.owed.is_empty() {
                member.stale.get_or_insert(now);
            }
        }
    }

    /// Workers that have owed replies of an earlier connection for longer than `limit`; one that goes on owing is named
    /// again after as long.
    pub(super) fn overdue(&mut self, now: Instant, limit: Duration) -> Vec<WorkerId> {
        let overdue = |since: Instant| now.saturating_duration_since(since) > limit;
        let mut found = Vec::new();
        for (worker, member) in &mut self.members {
            if let Some(since) = &mut member.stale
                && overdue(*since)
            {
                *since = now;
                found.push(*worker);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use protocol::Capabilities;
    use protocol::transport::LoadedReply;
    use protocol::wire::{ReplyStatus, TrialJob, TrialReply};

    fn hello() -> FromWorker {
        let capabilities = Capabilities::default();
        FromWorker::Hello { protocol: 3, run: "here".into(), pid: 42, capabilities, state_cache: 4 }
    }

    /// A resumed run counts its jobs anew: an old reply with the number of a new job would be a wrong result.
    #[test]
    fn replies_to_jobs_of_an_earlier_connection_never_reach_the_next() {
        let (mut members, worker) = (Members::default(), WorkerId(3));
        assert_eq!(members.add(worker, hello()), Some(42));
        assert_eq!(members.add(worker, hello()), None, "said twice");
        let (slot, announced) = members.announce(worker, "there").unwrap();
        assert!(matches!(announced, FromWorker::Hello { pid: 0, ref run, .. } if run == "there"));
        let job = |number| TrialJob { job: number, ..TrialJob::zeroed() };
        members.given(worker, &[LoadedJob { job: job(5), state: b"" }, LoadedJob { job: job(6), state: b"" }]);
        let begin = Instant::now();
        members.cut_off(begin);
        assert_eq!((members.slot(worker), members.at(slot)), (None, None));
        assert!(members.announceable().is_empty(), "it still owes");
        let reply =
            |number| LoadedReply { reply: TrialReply::bare(&job(number), ReplyStatus::Done), state: b"", error: b"" };
        assert!(!members.answered(worker, &[reply(5)]));
        assert!(members.announceable().is_empty());
        let limit = Duration::from_secs(1);
        assert!(members.overdue(begin, limit).is_empty());
        assert_eq!(members.overdue(begin + 2 * limit, limit), [worker]);
        assert!(members.overdue(begin + 2 * limit, limit).is_empty(), "once");
        assert!(!members.answered(worker, &[reply(6)]));
        assert_eq!(members.announceable(), [worker]);
        members.announce(worker, "there").unwrap();
        members.given(worker, &[LoadedJob { job: job(5), state: b"" }]);
        assert!(members.answered(worker, &[reply(5)]));
    }
}
