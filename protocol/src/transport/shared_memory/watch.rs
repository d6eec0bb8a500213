//! One blocking wait for everything that can wake a port: messages, a peer's death, a signal handler's call.

use super::services::{Listener, Service};
use super::{refused, system};
use crate::transport::{TransportError, Waker};
use iceoryx2::prelude::*;
use rustix::event::{EventfdFlags, epoll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::Arc;
use std::time::Duration;

/// Longest time between two looks at what has come. A notifier of iceoryx2 0.10 that fails to reach a new listener at
/// its first attempt, or finds its socket gone, does not try again before the set of listeners changes: its wake-ups are
/// lost. Without this limit a worker that joins while others die may sleep over its jobs for ever.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// Token of the waker among the tokens of watched processes.
pub(super) const WAKER: u64 = u64::MAX;

/// Our own set of descriptors (pidfds and the waker), itself a descriptor that iceoryx2 can wait for.
#[derive(Debug)]
struct OwnDescriptors {
    descriptor: FileDescriptor,
    epoll: OwnedFd,
}

impl FileDescriptorBased for OwnDescriptors {
    fn file_descriptor(&self) -> &FileDescriptor {
        &self.descriptor
    }
}

impl SynchronousMultiplexing for OwnDescriptors {}

/// Waits for a listener, for processes to end and for a waker.
pub(super) struct Watch {
    waits: WaitSet<Service>,
    own: OwnDescriptors,
    alarm: Arc<Alarm>,
}

impl Watch {
    /// Watches `listener`, which must live as long as this.
    pub(super) fn new(listener: &Listener) -> Result<Self, TransportError> {
        let epoll = epoll::create(epoll::CreateFlags::CLOEXEC).map_err(system("create an epoll set"))?;
        let event = rustix::event::eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)
            .map_err(system("create an event descriptor"))?;
        epoll::add(&epoll, &event, epoll::EventData::new_u64(WAKER), epoll::EventFlags::IN)
            .map_err(system("watch the waker"))?;
        let descriptor = FileDescriptor::non_owning_new(epoll.as_raw_fd()).ok_or(TransportError::Channel {
            action: "wait for an epoll set",
            reason: "bad descriptor".to_owned(),
        })?;
        let own = OwnDescriptors { descriptor, epoll };
        let waits = WaitSetBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(refused("create a wait set"))?;
        let action = "attach to a wait set";
        // A guard's only task is to detach, and both attachments stay until the set itself goes.
        std::mem::forget(waits.attach_notification(listener).map_err(refused(action))?);
        std::mem::forget(waits.attach_notification(&own).map_err(refused(action))?);
        Ok(Self { waits, own, alarm: Arc::new(Alarm { event }) })
    }

    /// Reports `token` when the process ends; dropping the descriptor ends the watch.
    ///
    /// # Errors
    /// The system's reason, notably that there is no such process.
    pub(super) fn process(&self, pid: u32, token: u64) -> Result<OwnedFd, TransportError> {
        let action = "watch a process";
        let pid = i32::try_from(pid)
            .ok()
            .and_then(Pid::from_raw)
            .ok_or(TransportError::Channel { action, reason: format!("{pid} is not a process number") })?;
        let pidfd = pidfd_open(pid, PidfdFlags::empty()).map_err(system(action))?;
        epoll::add(&self.own.epoll, &pidfd, epoll::EventData::new_u64(token), epoll::EventFlags::IN)
            .map_err(system(action))?;
        Ok(pidfd)
    }

    /// Blocks until something happens or `limit` has passed, or [`LOOK_AGAIN`] if that is shorter.
    pub(super) fn wait(&self, limit: Duration) -> Result<(), TransportError> {
        let limit = limit.min(LOOK_AGAIN);
        self.waits
            .wait_and_process_once_with_timeout(|_| CallbackProgression::Continue, limit)
            .map(|_| ())
            .map_err(refused("wait for messages"))
    }

    /// Tokens of processes that have ended, and [`WAKER`] if somebody called; the call is taken back.
    pub(super) fn fired(&self) -> Result<Vec<u64>, TransportError> {
        let zero = rustix::event::Timespec { tv_sec: 0, tv_nsec: 0 };
        let mut events: Vec<epoll::Event> = Vec::with_capacity(16);
        match epoll::wait(&self.own.epoll, rustix::buffer::spare_capacity(&mut events), Some(&zero)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(system("look for ended processes")(error)),
        }
        let tokens: Vec<u64> = events.iter().map(|event| event.data.u64()).collect();
        if tokens.contains(&WAKER) {
            let mut count = [0u8; 8];
            // Nothing to read means that the call was already taken back.
            let _ = rustix::io::read(&self.alarm.event, &mut count);
        }
        Ok(tokens)
    }

    /// A handle that interrupts the wait.
    pub(super) fn waker(&self) -> Arc<dyn Waker> {
        Arc::clone(&self.alarm) as Arc<dyn Waker>
    }
}

struct Alarm {
    event: OwnedFd,
}

impl Waker for Alarm {
    fn wake(&self) {
        // The counter can only be full, and then the port is awake anyway.
        let _ = rustix::io::write(&self.event, &1u64.to_ne_bytes());
    }
}
