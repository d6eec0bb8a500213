//! A channel to workers that do not exist, with a clock of its own: the pool decides as it does in a run, and thousands
//! of workers fit into one process.
//!
//! The macro handles one message at a time; a message travels for `latency`; a worker does its jobs in the order in which they came
//! and answers a message of jobs by one message of replies. Between hosts, messages also pass the network threads of the macro process.
//! Nothing else takes virtual time.

use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedJob, LoadedReply, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, Cost, PROTOCOL_VERSION, StateId};
use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

/// Times that messages take, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct MessageTimes {
    /// Of the macro, per message of jobs and per message of replies.
    pub(super) handling: f64,
    /// Of the macro, per trial: half of it to send the job, half to take the reply.
    pub(super) trial: f64,
    /// Of a network thread, per trial: taken with the reply.
    pub(super) network: f64,
    /// Network threads; none in one host.
    pub(super) network_threads: usize,
    /// From one process to another.
    pub(super) latency: f64,
}

impl MessageTimes {
    /// Trials per second that the macro can give out and take in at most, with this many jobs in a message.
    pub(super) fn supply(&self, jobs: f64) -> f64 {
        let pool = 2.0 * self.handling / jobs + self.trial;
        let network = if self.network_threads == 0 { 0.0 } else { self.network / self.network_threads as f64 };
        1.0 / pool.max(network)
    }
}

/// What happens in virtual time.
#[derive(Debug)]
pub(super) struct Play {
    /// Cost of each point's next trial, s.
    pub(super) costs: Vec<f64>,
    /// Whether replies tell what a trial has cost, so that the pool can learn.
    pub(super) tells_cost: bool,
    times: MessageTimes,
    /// The macro's clock, s.
    now: f64,
    /// When each worker has done all that it was sent, s.
    free_at: Vec<f64>,
    /// When each network thread has done all that has come, s.
    network_free_at: Vec<f64>,
    /// Ends of messages of jobs, earliest first.
    ends: BinaryHeap<Reverse<End>>,
    sent: u64,
}

/// A message of jobs that is done. Times are not negative, so their bits are ordered as they are.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct End {
    time: u64,
    /// Order of sending, for ends at the same time.
    number: u64,
    worker: u32,
    /// Number and point of each.
    jobs: Vec<[u64; 2]>,
}

/// A reply and its state.
type VirtualReply = (TrialReply, [u8; 8]);

impl Play {
    /// Workers that have all just arrived.
    pub(super) fn new(workers: usize, times: MessageTimes) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self {
            costs: Vec::new(),
            tells_cost: true,
            times,
            now: 0.0,
            free_at: vec![0.0; workers],
            network_free_at: vec![0.0; times.network_threads],
            ends: BinaryHeap::new(),
            sent: 0,
        }))
    }

    /// The macro's clock, s.
    pub(super) fn now(&self) -> f64 {
        self.now
    }

    fn send(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) {
        self.now += self.times.handling + 0.5 * self.times.trial * jobs.len() as f64;
        let arrival = self.now + self.times.latency;
        let costs = &self.costs;
        let work: f64 = jobs.iter().map(|loaded| costs[loaded.job.point as usize]).sum();
        let free_at = &mut self.free_at[worker.0 as usize];
        *free_at = free_at.max(arrival) + work;
        let time = (*free_at + self.times.latency).to_bits();
        self.sent += 1;
        let jobs = jobs.iter().map(|loaded| [loaded.job.job, loaded.job.point]).collect();
        self.ends.push(Reverse(End { time, number: self.sent, worker: worker.0, jobs }));
    }

    /// The next message of replies that the macro hears; its clock moves on.
    fn hear(&mut self) -> Option<(WorkerId, Vec<VirtualReply>)> {
        let Reverse(end) = self.ends.pop()?;
        let mut time = f64::from_bits(end.time);
        let trials = end.jobs.len() as f64;
        // The thread that is free first: connections are spread over threads, and there are many.
        if let Some(free_at) = self.network_free_at.iter_mut().min_by(|one, other| one.total_cmp(other)) {
            *free_at = free_at.max(time) + self.times.network * trials;
            time = *free_at;
        }
        self.now = self.now.max(time) + self.times.handling + 0.5 * self.times.trial * trials;
        let tells_cost = self.tells_cost;
        let costs = &self.costs;
        let replies = end.jobs.iter().map(|&[number, point]| {
            let state = number.to_le_bytes();
            let job_header = TrialJob { job: number, point, ..bytemuck::Zeroable::zeroed() };
            let mut reply = TrialReply::bare(&job_header, ReplyStatus::Done);
            reply.state = StateId::of(&state);
            reply.state_length = state.len() as u64;
            let microseconds = if tells_cost { 1e6 * costs[point as usize] } else { 0.0 };
            reply.cost = Cost { force_evaluations: microseconds as u64, ..Cost::default() };
            (reply.seal(b""), state)
        });
        Some((WorkerId(end.worker), replies.collect()))
    }
}

/// The macro's end of a channel to virtual workers.
pub(super) struct VirtualPort {
    play: Rc<RefCell<Play>>,
    run: String,
    /// Workers that have said hello.
    greeted: usize,
    /// Workers that were dismissed; they obey at once.
    dismissed: Vec<WorkerId>,
}

impl VirtualPort {
    pub(super) fn new(play: Rc<RefCell<Play>>, run: &str) -> Self {
        Self { play, run: run.to_owned(), greeted: 0, dismissed: Vec::new() }
    }

    fn greet(&mut self, sink: &mut dyn FnMut(MacroEvent<'_>)) -> usize {
        let workers = self.play.borrow().free_at.len();
        for worker in self.greeted..workers {
            let capabilities = Capabilities {
                engine: "virtual".to_owned(),
                version: "1".to_owned(),
                dimensions: vec![2],
                deterministic: true,
                ..Capabilities::default()
            };
            let hello = FromWorker::Hello {
                protocol: PROTOCOL_VERSION,
                run: self.run.clone(),
                pid: worker as u32,
                capabilities,
                state_cache: 4096,
            };
            sink(MacroEvent::Control(WorkerId(worker as u32), hello));
        }
        workers - std::mem::replace(&mut self.greeted, workers)
    }
}

impl MacroPort for VirtualPort {
    fn poll(&mut self, _wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        for worker in self.dismissed.drain(..) {
            sink(MacroEvent::Lost(worker, "dismissed".to_owned()));
        }
        let greeted = self.greet(sink);
        let heard = self.play.borrow_mut().hear();
        let Some((worker, replies)) = heard else { return Ok(greeted) };
        let replies: Vec<_> =
            replies.iter().map(|(reply, state)| LoadedReply { reply: *reply, state, error: b"" }).collect();
        sink(MacroEvent::Replies(worker, &replies));
        Ok(greeted + 1)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        if matches!(message, ToWorker::Bye) {
            self.dismissed.push(worker);
        }
        Ok(())
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        self.play.borrow_mut().send(worker, jobs);
        Ok(())
    }

    fn kill(&mut self, _worker: WorkerId) {}

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::new(NoWaker)
    }
}

struct NoWaker;

impl Waker for NoWaker {
    fn wake(&self) {}
}
