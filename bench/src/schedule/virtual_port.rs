//! A channel to workers that do not exist, with a clock of its own: the pool decides as it does in a run, and thousands
//! of workers fit into one process.
//!
//! The macro handles one message at a time and each takes it `handling`; a message travels for `latency`; a worker does
//! its jobs in the order in which they came. Nothing else takes virtual time.

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
    /// Of the macro, per message.
    pub(super) handling: f64,
    /// From one process to another.
    pub(super) latency: f64,
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
    /// Ends of jobs, earliest first.
    ends: BinaryHeap<Reverse<End>>,
    sent: u64,
}

/// The end of one job. Times are not negative, so their bits are ordered as they are.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct End {
    time: u64,
    /// Order of sending, for ends at the same time.
    number: u64,
    worker: u32,
    job: [u64; 2],
}

impl Play {
    /// Workers that have all just arrived.
    pub(super) fn new(workers: usize, times: MessageTimes) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self {
            costs: Vec::new(),
            tells_cost: true,
            times,
            now: 0.0,
            free_at: vec![0.0; workers],
            ends: BinaryHeap::new(),
            sent: 0,
        }))
    }

    /// The macro's clock, s.
    pub(super) fn now(&self) -> f64 {
        self.now
    }

    fn send(&mut self, worker: WorkerId, job: &TrialJob) {
        self.now += self.times.handling;
        let arrival = self.now + self.times.latency;
        let free_at = &mut self.free_at[worker.0 as usize];
        *free_at = free_at.max(arrival) + self.costs[job.point as usize];
        let time = (*free_at + self.times.latency).to_bits();
        self.sent += 1;
        self.ends.push(Reverse(End { time, number: self.sent, worker: worker.0, job: [job.job, job.point] }));
    }

    /// The next end that the macro hears of; its clock moves on.
    fn hear(&mut self) -> Option<(WorkerId, TrialReply, [u8; 8])> {
        let Reverse(end) = self.ends.pop()?;
        self.now = self.now.max(f64::from_bits(end.time)) + self.times.handling;
        let [number, point] = end.job;
        let state = end.number.to_le_bytes();
        let job_header = TrialJob { job: number, point, ..bytemuck::Zeroable::zeroed() };
        let mut reply = TrialReply::bare(&job_header, ReplyStatus::Done);
        reply.state = StateId::of(&state);
        reply.state_length = state.len() as u64;
        let microseconds = if self.tells_cost { 1e6 * self.costs[point as usize] } else { 0.0 };
        reply.cost = Cost { force_evaluations: microseconds as u64, ..Cost::default() };
        Some((WorkerId(end.worker), reply.seal(b""), state))
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
        let Some((worker, reply, state)) = heard else { return Ok(greeted) };
        sink(MacroEvent::Replies(worker, &[LoadedReply { reply, state: &state, error: b"" }]));
        Ok(greeted + 1)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        if matches!(message, ToWorker::Bye) {
            self.dismissed.push(worker);
        }
        Ok(())
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        let mut play = self.play.borrow_mut();
        jobs.iter().for_each(|loaded| play.send(worker, &loaded.job));
        Ok(())
    }

    fn kill(&mut self, _worker: WorkerId) {}

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::new(NobodyWaits)
    }
}

struct NobodyWaits;

impl Waker for NobodyWaits {
    fn wake(&self) {}
}
