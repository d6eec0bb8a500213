//! What every transport must do, said once. The tests of each transport include this file and name themselves with `claims!`.
#![allow(unreachable_pub, missing_docs, reason = "each test file compiles its own copy")]

use bytemuck::Zeroable;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedJob, LoadedReply, MacroEvent, MacroPort, WorkerEvent, WorkerId, WorkerPort};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, PROTOCOL_VERSION};
use std::collections::BTreeMap;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub const PATIENCE: Duration = Duration::from_secs(10);

/// One transport under test.
pub trait Channel {
    type Macro: MacroPort;
    type Worker: WorkerPort;
    type Connector: Clone + Send + 'static;
    fn open() -> (Self::Macro, Self::Connector);
    fn join(connector: &Self::Connector) -> Self::Worker;
    fn send_raw(worker: &mut Self::Worker, bytes: &[u8]);
}

/// Instantiates every claim for each transport that follows.
macro_rules! claims {
    ($($name:ident: $channel:ty),* $(,)?) => {
        $(mod $name {
            #[allow(unused_imports)]
            use super::*;
            claims!(@ $channel:
                jobs_and_replies_keep_their_content_and_order,
                snapshots_of_two_megabytes_travel_both_ways,
                each_worker_hears_only_its_own_jobs,
                a_closed_worker_is_lost_after_its_last_words,
                a_killed_worker_is_lost_and_can_be_sent_nothing,
                a_closed_macro_is_noticed,
                a_waker_ends_a_wait,
                an_idle_wait_ends_in_time,
                garbage_is_refused_and_counted,
                a_worker_may_say_more_than_it_is_asked,
                more_messages_than_fit_wait_in_order,
                runs_do_not_see_each_other,
                too_large_messages_are_refused_with_both_sizes,
                replies_that_do_not_fit_one_message_come_in_several,
            );
        })*
    };
    (@ $channel:ty: $($claim:ident),* $(,)?) => { $(#[test] fn $claim() { $crate::claims::$claim::<$channel>(); })* };
}

/// What a macro heard, in its own words.
#[derive(Default)]
pub struct Heard {
    pub controls: Vec<(WorkerId, FromWorker)>,
    pub replies: Vec<(WorkerId, TrialReply, Vec<u8>, Vec<u8>)>,
    pub lost: Vec<WorkerId>,
    pub refused: usize,
    pub woken: usize,
}

impl Heard {
    pub fn until(&mut self, port: &mut dyn MacroPort, enough: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !enough(self) {
            assert!(begin.elapsed() < PATIENCE, "waited in vain; heard {}", self.summary());
            port.poll(Duration::from_secs(1), &mut |event| self.take(event)).unwrap();
        }
    }

    fn summary(&self) -> String {
        let replies = self.replies.len();
        format!("{:?}, {replies} replies, lost {:?}, refused {}", self.controls, self.lost, self.refused)
    }

    fn take(&mut self, event: MacroEvent<'_>) {
        match event {
            MacroEvent::Control(worker, message) => self.controls.push((worker, message)),
            MacroEvent::Replies(worker, loaded) => self
                .replies
                .extend(loaded.iter().map(|one| (worker, one.reply, one.state.to_vec(), one.error.to_vec()))),
            MacroEvent::Lost(worker, _) | MacroEvent::CutOff(worker, _) => self.lost.push(worker),
            MacroEvent::Refused(_) => self.refused += 1,
            MacroEvent::Woken => self.woken += 1,
        }
    }
}

pub fn hello() -> FromWorker {
    let capabilities =
        Capabilities { engine: "echo".into(), version: "1".into(), dimensions: vec![2], ..Capabilities::default() };
    FromWorker::Hello {
        protocol: PROTOCOL_VERSION,
        run: "test".into(),
        pid: std::process::id(),
        capabilities,
        state_cache: 4,
    }
}

pub fn job(number: u64) -> TrialJob {
    TrialJob { job: number, point: number + 1, ..TrialJob::zeroed() }
}

pub fn bye(port: &mut dyn MacroPort, worker: WorkerId) {
    port.send_control(worker, &ToWorker::Bye).unwrap();
}

/// A worker in its own thread that greets and answers each job with its own snapshot backwards, until dismissed.
/// Returns how many jobs it answered and whether it left because the macro was lost.
pub fn echo<C: Channel>(connector: &C::Connector) -> JoinHandle<(usize, bool)> {
    let connector = connector.clone();
    std::thread::spawn(move || {
        let mut port = C::join(&connector);
        port.send_control(&hello()).unwrap();
        let (mut answered, mut dismissed, mut lost) = (0, false, false);
        while !dismissed && !lost {
            let mut slices: Vec<Vec<(TrialJob, Vec<u8>)>> = Vec::new();
            port.poll(PATIENCE, &mut |event| match event {
                WorkerEvent::Jobs(jobs) => {
                    slices
                        .push(jobs.iter().map(|one| (one.job, one.state.iter().rev().copied().collect())).collect());
                }
                WorkerEvent::Control(ToWorker::Bye) => dismissed = true,
                WorkerEvent::Control(_) => {}
                WorkerEvent::MacroLost(_) => lost = true,
            })
            .unwrap();
            for slice in slices {
                let replies: Vec<LoadedReply<'_>> = slice
                    .iter()
                    .map(|(job, state)| LoadedReply {
                        reply: TrialReply::bare(job, ReplyStatus::Done),
                        state,
                        error: b"no error",
                    })
                    .collect();
                answered += replies.len();
                port.send_replies(&replies).unwrap();
            }
        }
        (answered, lost)
    })
}

pub fn jobs_and_replies_keep_their_content_and_order<C: Channel>() {
    let (mut port, connector) = C::open();
    let worker = echo::<C>(&connector);
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    assert_eq!(heard.controls[0].1, hello());
    let id = heard.controls[0].0;
    port.send_control(id, &ToWorker::Welcome { worker: id.0 }).unwrap();
    for round in 0..100 {
        let states = [vec![round as u8; 3], vec![], vec![1, 2, round as u8]];
        let jobs: Vec<LoadedJob<'_>> =
            (0..3).map(|place| LoadedJob { job: job(3 * round + place), state: &states[place as usize] }).collect();
        port.send_jobs(id, &jobs).unwrap();
        let count = 3 * (round as usize + 1);
        // Two slices are under way at the same time.
        heard.until(&mut port, |heard| heard.replies.len() + 3 >= count);
    }
    heard.until(&mut port, |heard| heard.replies.len() == 300);
    for (number, (from, reply, state, error)) in heard.replies.iter().enumerate() {
        assert_eq!((*from, reply.job, reply.point), (id, number as u64, number as u64 + 1));
        assert_eq!(error, b"no error");
        let round = (number / 3) as u8;
        let expected = [vec![round; 3], vec![], vec![round, 2, 1]];
        assert_eq!(state, &expected[number % 3]);
    }
    bye(&mut port, id);
    assert_eq!(worker.join().unwrap(), (300, false));
}

pub fn snapshots_of_two_megabytes_travel_both_ways<C: Channel>() {
    let (mut port, connector) = C::open();
    let worker = echo::<C>(&connector);
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    let state: Vec<u8> = (0..2_000_000u32).map(|at| ((at * 31) >> 3) as u8).collect();
    for number in 0..5 {
        port.send_jobs(WorkerId(0), &[LoadedJob { job: job(number), state: &state }]).unwrap();
        heard.until(&mut port, |heard| heard.replies.len() as u64 == number + 1);
    }
    let backwards: Vec<u8> = state.iter().rev().copied().collect();
    assert!(heard.replies.iter().all(|(_, _, state, _)| *state == backwards));
    bye(&mut port, WorkerId(0));
    worker.join().unwrap();
}

pub fn each_worker_hears_only_its_own_jobs<C: Channel>() {
    let (mut port, connector) = C::open();
    let workers = [echo::<C>(&connector), echo::<C>(&connector)];
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.controls.len() == 2);
    for number in 0..40 {
        port.send_jobs(WorkerId(number % 2), &[LoadedJob { job: job(u64::from(number)), state: b"" }]).unwrap();
    }
    heard.until(&mut port, |heard| heard.replies.len() == 40);
    let mut by_worker: BTreeMap<u32, Vec<u64>> = BTreeMap::new();
    for (worker, reply, ..) in &heard.replies {
        by_worker.entry(worker.0).or_default().push(reply.job);
    }
    for (worker, jobs) in by_worker {
        let expected: Vec<u64> = (0..20).map(|at| 2 * at + u64::from(worker)).collect();
        assert_eq!(jobs, expected);
    }
    for id in 0..2 {
        bye(&mut port, WorkerId(id));
    }
    for worker in workers {
        assert_eq!(worker.join().unwrap(), (20, false));
    }
}

pub fn a_closed_worker_is_lost_after_its_last_words<C: Channel>() {
    let (mut port, connector) = C::open();
    let worker = std::thread::spawn(move || {
        let mut port = C::join(&connector);
        port.send_control(&hello()).unwrap();
        for number in 0..3 {
            let reply = TrialReply::bare(&job(number), ReplyStatus::Done);
            port.send_replies(&[LoadedReply { reply, state: b"", error: b"" }]).unwrap();
        }
        port.send_control(&FromWorker::Bye { reason: "drained".into() }).unwrap();
    });
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.controls.len() == 2);
    let begin = Instant::now();
    heard.until(&mut port, |heard| !heard.lost.is_empty());
    assert!(begin.elapsed() < Duration::from_millis(500), "{:?}", begin.elapsed());
    worker.join().unwrap();
    assert_eq!((heard.lost.len(), heard.replies.len(), heard.controls.len()), (1, 3, 2));
    let gone = port.send_control(WorkerId(0), &ToWorker::Drain).unwrap_err();
    assert_eq!(gone.to_string(), "worker 0 is gone");
}

pub fn a_killed_worker_is_lost_and_can_be_sent_nothing<C: Channel>() {
    let (mut port, connector) = C::open();
    let mut worker = C::join(&connector);
    worker.send_control(&hello()).unwrap();
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    port.kill(WorkerId(0));
    heard.until(&mut port, |heard| !heard.lost.is_empty());
    assert!(port.send_jobs(WorkerId(0), &[]).is_err());
    // A worker that closes waits for a macro that lives to hear its last words.
    drop(port);
}

pub fn a_closed_macro_is_noticed<C: Channel>() {
    let (mut port, connector) = C::open();
    let worker = echo::<C>(&connector);
    Heard::default().until(&mut port, |heard| !heard.controls.is_empty());
    let begin = Instant::now();
    drop(port);
    assert_eq!(worker.join().unwrap(), (0, true));
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
}

pub fn a_waker_ends_a_wait<C: Channel>() {
    let (mut port, _door) = C::open();
    let waker = port.waker();
    let mut heard = Heard::default();
    // A call before the wait is not lost, a call during the wait ends it.
    waker.wake();
    heard.until(&mut port, |heard| heard.woken == 1);
    let caller = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(20));
        waker.wake();
    });
    let begin = Instant::now();
    port.poll(PATIENCE, &mut |event| heard.take(event)).unwrap();
    assert_eq!(heard.woken, 2);
    assert!(begin.elapsed() < PATIENCE);
    caller.join().unwrap();
}

pub fn an_idle_wait_ends_in_time<C: Channel>() {
    let (mut port, _door) = C::open();
    let begin = Instant::now();
    assert_eq!(port.poll(Duration::from_millis(30), &mut |_| {}).unwrap(), 0);
    assert!(begin.elapsed() >= Duration::from_millis(25), "{:?}", begin.elapsed());
}

pub fn garbage_is_refused_and_counted<C: Channel>() {
    let (mut port, connector) = C::open();
    let mut worker = C::join(&connector);
    worker.send_control(&hello()).unwrap();
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    for garbage in [&b"x"[..], &[0; 32], &[255; 2000]] {
        C::send_raw(&mut worker, garbage);
    }
    worker.send_control(&FromWorker::Bye { reason: "still here".into() }).unwrap();
    heard.until(&mut port, |heard| heard.controls.len() == 2);
    assert_eq!(heard.refused, 3);
    drop(port);
}

pub fn a_worker_may_say_more_than_it_is_asked<C: Channel>() {
    let (mut port, connector) = C::open();
    let worker = std::thread::spawn(move || {
        let mut port = C::join(&connector);
        port.send_control(&hello()).unwrap();
        for number in 0..200 {
            let reply = TrialReply::bare(&job(number), ReplyStatus::Done);
            port.send_replies(&[LoadedReply { reply, state: b"abc", error: b"" }]).unwrap();
        }
    });
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.lost.is_empty());
    worker.join().unwrap();
    let order: Vec<u64> = heard.replies.iter().map(|(_, reply, ..)| reply.job).collect();
    assert_eq!(order, (0..200).collect::<Vec<u64>>());
    assert_eq!(heard.refused, 0);
}

pub fn more_messages_than_fit_wait_in_order<C: Channel>() {
    let (mut port, connector) = C::open();
    let worker = echo::<C>(&connector);
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    for number in 0..200 {
        port.send_jobs(WorkerId(0), &[LoadedJob { job: job(number), state: b"" }]).unwrap();
        port.send_control(WorkerId(0), &ToWorker::Drain).unwrap();
    }
    bye(&mut port, WorkerId(0));
    heard.until(&mut port, |heard| !heard.lost.is_empty());
    // A worker that is dismissed in the middle of a batch answers that batch and leaves.
    let order: Vec<u64> = heard.replies.iter().map(|(_, reply, ..)| reply.job).collect();
    assert_eq!(order, (0..200).collect::<Vec<u64>>());
    assert_eq!(worker.join().unwrap(), (200, false));
}

pub fn runs_do_not_see_each_other<C: Channel>() {
    let (mut one, door_one) = C::open();
    let (mut two, door_two) = C::open();
    let workers = [echo::<C>(&door_one), echo::<C>(&door_two)];
    let (mut heard_one, mut heard_two) = (Heard::default(), Heard::default());
    heard_one.until(&mut one, |heard| !heard.controls.is_empty());
    heard_two.until(&mut two, |heard| !heard.controls.is_empty());
    one.send_jobs(WorkerId(0), &[LoadedJob { job: job(1), state: b"" }]).unwrap();
    two.send_jobs(WorkerId(0), &[LoadedJob { job: job(2), state: b"" }]).unwrap();
    heard_one.until(&mut one, |heard| !heard.replies.is_empty());
    heard_two.until(&mut two, |heard| !heard.replies.is_empty());
    drop(one);
    // The end of one run leaves the other at work.
    two.send_jobs(WorkerId(0), &[LoadedJob { job: job(3), state: b"" }]).unwrap();
    heard_two.until(&mut two, |heard| heard.replies.len() == 2);
    bye(&mut two, WorkerId(0));
    let [first, second] = workers.map(|worker| worker.join().unwrap());
    assert_eq!((first, second), ((1, true), (2, false)));
    assert_eq!((heard_one.controls.len(), heard_one.replies[0].1.job), (1, 1));
    assert_eq!(heard_two.replies.iter().map(|(_, reply, ..)| reply.job).collect::<Vec<_>>(), [2, 3]);
}

pub fn too_large_messages_are_refused_with_both_sizes<C: Channel>() {
    let (mut port, connector) = C::open();
    let mut worker = C::join(&connector);
    worker.send_control(&hello()).unwrap();
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    let state = vec![0; 65 << 20];
    let error = port.send_jobs(WorkerId(0), &[LoadedJob { job: job(0), state: &state }]).unwrap_err();
    assert!(error.to_string().contains(&(state.len() + size_of::<TrialJob>() + 32).to_string()), "{error}");
    let reply = TrialReply::bare(&job(0), ReplyStatus::Done);
    assert!(worker.send_replies(&[LoadedReply { reply, state: &state, error: b"" }]).is_err());
    drop(port);
}

/// Nobody knows how large the states of an engine are before its first reply.
pub fn replies_that_do_not_fit_one_message_come_in_several<C: Channel>() {
    let (mut port, connector) = C::open();
    let mut worker = C::join(&connector);
    worker.send_control(&hello()).unwrap();
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.controls.is_empty());
    let state = vec![7; 3 << 20];
    let reply =
        |number| TrialReply { state_length: state.len() as u64, ..TrialReply::bare(&job(number), ReplyStatus::Done) };
    let replies: Vec<_> =
        (0..5).map(|number| LoadedReply { reply: reply(number), state: &state, error: b"" }).collect();
    worker.send_replies(&replies).unwrap();
    heard.until(&mut port, |heard| heard.replies.len() == 5);
    let numbers: Vec<u64> = heard.replies.iter().map(|(_, reply, ..)| reply.job).collect();
    assert!(numbers == [0, 1, 2, 3, 4] && heard.replies.iter().all(|(_, _, came, _)| *came == state));
    drop(port);
}
