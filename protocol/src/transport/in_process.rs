//! A transport between threads of one process: queues under one lock, no shared memory, nothing left behind.
//!
//! It carries the same frames as the shared-memory transport, so tests over it exercise the same decoding. A dropped
//! worker port is a lost worker, a dropped macro port a lost macro; killing a worker closes its port.

use super::delivery::{deliver_to_macro, deliver_to_worker};
use super::frame::Outgoing;
use super::{
    LoadedJob, LoadedReply, MacroEvent, MacroPort, TransportError, Waker, WorkerEvent, WorkerId, WorkerPort,
};
use crate::control::{FromWorker, ToWorker};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Largest frame that an in-process channel carries, bytes.
pub const FRAME_LIMIT: usize = 64 << 20;

enum ToMacro {
    Frame(WorkerId, Vec<u8>),
    Lost(WorkerId, String),
}

#[derive(Default)]
struct Queues {
    to_macro: VecDeque<ToMacro>,
    /// Mailboxes of living workers.
    to_worker: BTreeMap<WorkerId, VecDeque<Vec<u8>>>,
    joined: u32,
    woken: bool,
    macro_gone: bool,
}

#[derive(Default)]
struct Hub {
    queues: Mutex<Queues>,
    changed: Condvar,
}

impl Hub {
    /// A thread that panicked while holding the lock left the queues sound: every change is one push or one pop.
    fn lock(&self) -> MutexGuard<'_, Queues> {
        self.queues.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Blocks until `ready` or until `wait` has passed.
    fn wait_for(&self, wait: Duration, ready: impl Fn(&Queues) -> bool) -> MutexGuard<'_, Queues> {
        let deadline = Instant::now().checked_add(wait);
        let mut queues = self.lock();
        while !ready(&queues) {
            let left = deadline.map_or(Duration::MAX, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                break;
            }
            queues = if left == Duration::MAX {
                self.changed.wait(queues).unwrap_or_else(PoisonError::into_inner)
            } else {
                self.changed.wait_timeout(queues, left).unwrap_or_else(PoisonError::into_inner).0
            };
        }
        queues
    }

    fn lose(&self, worker: WorkerId, reason: &str) {
        let mut queues = self.lock();
        if queues.to_worker.remove(&worker).is_some() {
            queues.to_macro.push_back(ToMacro::Lost(worker, reason.to_owned()));
        }
        self.changed.notify_all();
    }
}

/// Opens a channel: the macro's port and the connector through which workers join.
pub fn channel() -> (InProcessMacroPort, InProcessConnector) {
    let hub = Arc::new(Hub::default());
    (InProcessMacroPort { hub: Arc::clone(&hub) }, InProcessConnector { hub })
}

/// Lets workers join; cloned into the threads that run them.
#[derive(Clone)]
pub struct InProcessConnector {
    hub: Arc<Hub>,
}

impl InProcessConnector {
    /// A new worker's port.
    pub fn join(&self) -> InProcessWorkerPort {
        let mut queues = self.hub.lock();
        let worker = WorkerId(queues.joined);
        queues.joined += 1;
        queues.to_worker.insert(worker, VecDeque::new());
        InProcessWorkerPort { hub: Arc::clone(&self.hub), worker, loss_reported: false }
    }
}

/// The macro's end of an in-process channel.
pub struct InProcessMacroPort {
    hub: Arc<Hub>,
}

impl InProcessMacroPort {
    fn send(&self, worker: WorkerId, message: &Outgoing<'_>) -> Result<(), TransportError> {
        message.length_within(FRAME_LIMIT)?;
        let mut queues = self.hub.lock();
        queues.to_worker.get_mut(&worker).ok_or(TransportError::Gone(worker))?.push_back(message.to_vec(0));
        self.hub.changed.notify_all();
        Ok(())
    }
}

impl MacroPort for InProcessMacroPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        let (arrived, woken) = {
            let mut queues = self.hub.wait_for(wait, |queues| queues.woken || !queues.to_macro.is_empty());
            (std::mem::take(&mut queues.to_macro), std::mem::take(&mut queues.woken))
        };
        let count = arrived.len() + usize::from(woken);
        for message in arrived {
            match message {
                ToMacro::Lost(worker, reason) => sink(MacroEvent::Lost(worker, reason)),
                ToMacro::Frame(worker, bytes) => {
                    if let Err(error) = deliver_to_macro(worker, &bytes, sink) {
                        sink(MacroEvent::Refused(format!("worker {}: {error}", worker.0)));
                    }
                }
            }
        }
        if woken {
            sink(MacroEvent::Woken);
        }
        Ok(count)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        self.send(worker, &Outgoing::control(message))
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        self.send(worker, &Outgoing::Jobs(jobs))
    }

    fn kill(&mut self, worker: WorkerId) {
        self.hub.lose(worker, "killed");
    }

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::new(InProcessWaker { hub: Arc::clone(&self.hub) })
    }
}

impl Drop for InProcessMacroPort {
    fn drop(&mut self) {
        self.hub.lock().macro_gone = true;
        self.hub.changed.notify_all();
    }
}

struct InProcessWaker {
    hub: Arc<Hub>,
}

impl Waker for InProcessWaker {
    fn wake(&self) {
        self.hub.lock().woken = true;
        self.hub.changed.notify_all();
    }
}

/// A worker's end of an in-process channel.
pub struct InProcessWorkerPort {
    hub: Arc<Hub>,
    worker: WorkerId,
    loss_reported: bool,
}

impl InProcessWorkerPort {
    /// Sends bytes as they are: how tests play a broken worker.
    ///
    /// # Errors
    /// As [`WorkerPort::send_control`].
    pub fn send_raw(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        self.push(bytes.to_vec())
    }

    fn send(&self, message: &Outgoing<'_>) -> Result<(), TransportError> {
        message.length_within(FRAME_LIMIT)?;
        self.push(message.to_vec(u64::from(self.worker.0)))
    }

    fn push(&self, bytes: Vec<u8>) -> Result<(), TransportError> {
        let mut queues = self.hub.lock();
        if queues.macro_gone || !queues.to_worker.contains_key(&self.worker) {
            return Err(TransportError::Gone(self.worker));
        }
        queues.to_macro.push_back(ToMacro::Frame(self.worker, bytes));
        self.hub.changed.notify_all();
        Ok(())
    }
}

impl WorkerPort for InProcessWorkerPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        let worker = self.worker;
        let closed = |queues: &Queues| queues.macro_gone || !queues.to_worker.contains_key(&worker);
        let reported = self.loss_reported;
        let (arrived, lost) = {
            let mut queues = self.hub.wait_for(wait, |queues| {
                (closed(queues) && !reported) || queues.to_worker.get(&worker).is_some_and(|mail| !mail.is_empty())
            });
            let arrived = queues.to_worker.get_mut(&worker).map(std::mem::take).unwrap_or_default();
            (arrived, closed(&queues) && !reported)
        };
        let count = arrived.len() + usize::from(lost);
        for bytes in arrived {
            if let Err(error) = deliver_to_worker(&bytes, sink) {
                tracing::warn!(%error, "dropped a message of the macro");
            }
        }
        if lost {
            self.loss_reported = true;
            sink(WorkerEvent::MacroLost("the channel was closed".to_owned()));
        }
        Ok(count)
    }

    fn send_control(&mut self, message: &FromWorker) -> Result<(), TransportError> {
        self.send(&Outgoing::control(message))
    }

    fn send_replies(&mut self, replies: &[LoadedReply<'_>]) -> Result<(), TransportError> {
        self.send(&Outgoing::Replies(replies))
    }
}

impl Drop for InProcessWorkerPort {
    fn drop(&mut self) {
        self.hub.lose(self.worker, "its port was closed");
    }
}
