//! Channels between one macro and its workers, behind two small traits.
//!
//! [`MacroPort`] and [`WorkerPort`] have two implementations here: `shared_memory` (iceoryx2, between processes) and
//! `in_process` (threads and channels, for tests and single-process runs). The crate `grainspan-hosts` adds a third, between hosts. A
//! port belongs to one thread.

pub mod delivery;
pub mod frame;
pub mod in_process;
pub mod shared_memory;

use crate::control::{FromWorker, ToWorker};
use crate::wire::{TrialJob, TrialReply};
use std::time::Duration;
use thiserror::Error;

/// A worker as the macro's port numbers it; never re-used within a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkerId(pub u32);

/// A job with the snapshot it carries; an empty slice when the worker is believed to hold the state.
#[derive(Clone, Copy, Debug)]
pub struct LoadedJob<'a> {
    /// The fixed-layout part. `state_length` is set by the port.
    pub job: TrialJob,
    /// Snapshot of `job.state`, or empty.
    pub state: &'a [u8],
}

/// A reply with the snapshot and error that came with it.
#[derive(Clone, Copy, Debug)]
pub struct LoadedReply<'a> {
    /// The fixed-layout part.
    pub reply: TrialReply,
    /// Snapshot of the trial state, or empty.
    pub state: &'a [u8],
    /// MessagePack of an [`crate::RveError`], or empty.
    pub error: &'a [u8],
}

/// What the macro hears.
#[derive(Debug)]
pub enum MacroEvent<'a> {
    /// A control message; a worker is known from its first hello on.
    Control(WorkerId, FromWorker),
    /// Answers to a job slice.
    Replies(WorkerId, &'a [LoadedReply<'a>]),
    /// The worker's process has ended or its channel is broken. Everything it had sent was delivered before this.
    Lost(WorkerId, String),
    /// The connection to the worker's host was lost or ended. As [`Lost`](Self::Lost), but nothing is known of the worker itself, so its
    /// jobs are not suspected to have ended it.
    CutOff(WorkerId, String),
    /// Somebody sent something that is not a message of this protocol; it was dropped and is to be counted.
    Refused(String),
    /// [`Waker::wake`] was called.
    Woken,
}

/// What a worker hears.
#[derive(Debug)]
pub enum WorkerEvent<'a> {
    /// A control message.
    Control(ToWorker),
    /// A job slice.
    Jobs(&'a [LoadedJob<'a>]),
    /// The macro has ended or vanished.
    MacroLost(String),
}

/// Why a port failed.
#[derive(Debug, Error)]
pub enum TransportError {
    /// The peer is gone.
    #[error("worker {} is gone", .0.0)]
    Gone(WorkerId),
    /// A message is larger than the channel can carry.
    #[error(
        "a message of {size} bytes does not fit the channel's {limit} bytes: one state of the engine is too large for a run; \
         keep less in it"
    )]
    TooLarge {
        /// Bytes needed.
        size: usize,
        /// Bytes available.
        limit: usize,
    },
    /// The run has as many workers as it has room for.
    #[error("the run has no room for another worker: {limit} is the most; end some, or start another run")]
    NoRoom {
        /// Workers that the run has room for.
        limit: u32,
    },
    /// The shared-memory layer refused an operation.
    #[error("could not {action}: {reason}")]
    Channel {
        /// What was tried.
        action: &'static str,
        /// What the layer said.
        reason: String,
    },
    /// Operating system error.
    #[error("could not {action}: {source}")]
    System {
        /// What was tried.
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Interrupts a waiting [`MacroPort::poll`] from another thread (a signal handler, say).
pub trait Waker: Send + Sync {
    /// Makes the current or next poll return with [`MacroEvent::Woken`].
    fn wake(&self);
}

/// The macro's end: many workers.
pub trait MacroPort {
    /// Delivers everything that has arrived; blocks up to `wait` when nothing has. Returns the number of events.
    ///
    /// # Errors
    /// Only failures of the port itself; a lost worker is an event.
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError>;

    /// Sends a control message.
    ///
    /// # Errors
    /// [`TransportError::Gone`] when the worker is lost (its `Lost` event comes or has come).
    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError>;

    /// Sends a job slice; the memory is loaned from the channel and filled in place.
    ///
    /// # Errors
    /// As [`MacroPort::send_control`], and [`TransportError::TooLarge`].
    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError>;

    /// Ends a worker that does not answer (SIGKILL for a process); its `Lost` event follows.
    fn kill(&mut self, worker: WorkerId);

    /// A handle that interrupts `poll` from another thread.
    fn waker(&self) -> std::sync::Arc<dyn Waker>;
}

/// A worker's end: one macro.
pub trait WorkerPort {
    /// Delivers everything that has arrived; blocks up to `wait` when nothing has. Returns the number of events.
    ///
    /// # Errors
    /// Failures of the port itself; a lost macro is an event.
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError>;

    /// Sends a control message.
    ///
    /// # Errors
    /// The channel is broken.
    fn send_control(&mut self, message: &FromWorker) -> Result<(), TransportError>;

    /// Sends the answers to a job slice, in several messages if they do not fit one.
    ///
    /// # Errors
    /// The channel is broken, or [`TransportError::TooLarge`].
    fn send_replies(&mut self, replies: &[LoadedReply<'_>]) -> Result<(), TransportError>;
}
