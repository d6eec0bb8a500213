//! A worker's end: one client of a run.

use super::gate::{Busy, FirstPart, LastPart};
use super::polling::{Waits, poll};
use super::run_directory::{
    CleanupAfterEnd, RunDirectory, RunError, RunRecord, WORKER_ROOM, check_room, fresh_number,
};
use super::services::{Client, Listener, Notifier, Pending, Services, message_bytes, port_name};
use super::waiting::WaitState;
use super::watch::Watch;
use super::{CREDITS, WINDOW, refused};
use crate::control::{FromWorker, ToWorker};
use crate::transport::delivery::deliver_to_worker;
use crate::transport::frame::{FrameError, Outgoing};
use crate::transport::{LoadedReply, TransportError, WorkerEvent, WorkerPort};
use std::collections::VecDeque;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

/// Token of the macro's process.
const MACRO: u64 = 1;

/// Between two looks for a run that is not there yet.
const RETRY: Duration = Duration::from_millis(20);

/// How long a port that closes waits for its last words to be read: iceoryx2 drops unread messages of a client that
/// has gone in order.
const FAREWELL: Duration = Duration::from_secs(5);

/// The same after a dismissal: the macro may listen no more, and it does not need what is left to say.
const FAREWELL_DISMISSED: Duration = Duration::from_millis(250);

/// A worker's end of a run in shared memory.
pub struct SharedMemoryWorkerPort {
    /// First: the others are not to be closed while the process ends.
    _first: FirstPart,
    /// The number under which it sends.
    sender: u64,
    limit: usize,
    /// Requests that wait for an answer, oldest first; the macro answers in this order.
    open: VecDeque<Pending>,
    /// Frames that wait for a free request.
    outbox: VecDeque<Vec<u8>>,
    /// Nothing is granted before the hello: a message of an unknown worker is refused.
    greeted: bool,
    /// Whether the macro has said bye.
    dismissed: bool,
    lost: Option<String>,
    loss_reported: bool,
    /// None when macro and worker are threads of one process.
    _macro_process: Option<OwnedFd>,
    wait_state: WaitState,
    watch: Watch,
    client: Client,
    to_macro: Notifier,
    listener: Listener,
    _services: Services,
    /// Looks for what all the others have left.
    _cleanup: CleanupAfterEnd,
    /// Last, see [`FirstPart`].
    _last: LastPart,
}

impl SharedMemoryWorkerPort {
    /// Joins the run `name`, waiting up to `timeout` for it to appear.
    ///
    /// # Errors
    /// No such run, another version, no room for another worker, or a refusal of iceoryx2 or the system; in words.
    pub fn join(name: &str, timeout: Duration) -> Result<Self, TransportError> {
        // None: longer than clocks count.
        let deadline = Instant::now().checked_add(timeout);
        loop {
            let failure = match RunDirectory::open(name) {
                Ok(Some(record)) => match Self::join_found(&record) {
                    Ok(port) => return Ok(port),
                    Err(error) => error,
                },
                Ok(None) => join_error("it is still being set up"),
                Err(error @ (RunError::Name { .. } | RunError::Version { .. })) => return Err(join_error(error)),
                Err(error) => join_error(error),
            };
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                return Err(failure);
            }
            std::thread::sleep(RETRY);
        }
    }

    /// Joins a run whose record was found.
    ///
    /// # Errors
    /// No room for another worker, the run has ended meanwhile, or a refusal of iceoryx2 or the system; in words.
    pub fn join_found(record: &RunRecord) -> Result<Self, TransportError> {
        Self::enter(record).map_err(|error| match error {
            // One of the several limits of iceoryx2, all of which follow from ours.
            TransportError::Channel { reason, .. } if reason.contains("ExceedsMax") => {
                TransportError::NoRoom { limit: record.limits.workers }
            }
            error => error,
        })
    }

    fn enter(record: &RunRecord) -> Result<Self, TransportError> {
        if record.is_foreign() {
            return Err(join_error("it lives in another PID namespace (another container); start its workers there"));
        }
        let _busy = Busy::begin();
        let cleanup = CleanupAfterEnd(record.clone());
        check_room(WORKER_ROOM).map_err(join_error)?;
        let services = Services::open(record)?;
        let sender = fresh_number();
        let listener = services
            .to_worker
            .listener_builder()
            .name(&port_name(sender))
            .create()
            .map_err(refused("listen for the macro's wake-ups"))?;
        let to_macro =
            services.to_macro.notifier_builder().create().map_err(refused("prepare the macro's wake-ups"))?;
        let client = services.client(record)?;
        let watch = Watch::new(&listener)?;
        let same_process = record.pid == std::process::id();
        let macro_process = if same_process { None } else { Some(watch.process(record.pid, MACRO)?) };
        let (first, last) = FirstPart::open(record);
        Ok(Self {
            _first: first,
            sender,
            limit: message_bytes(record),
            open: VecDeque::new(),
            outbox: VecDeque::new(),
            greeted: false,
            dismissed: false,
            lost: None,
            loss_reported: false,
            _macro_process: macro_process,
            wait_state: WaitState::new(record.limits.waiting),
            watch,
            client,
            to_macro,
            listener,
            _services: services,
            _cleanup: cleanup,
            _last: last,
        })
    }

    /// Sends bytes as they are: how tests play a broken worker.
    ///
    /// # Errors
    /// As [`WorkerPort::send_control`].
    pub fn send_raw(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        self.send_with(bytes.len(), |out| out.copy_from_slice(bytes))
    }

    fn drain(&mut self, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        if self.wait_state.asks_kernel() {
            self.listener.try_wait(|_| {}).map_err(refused("read wake-ups"))?;
            if self.watch.fired()?.contains(&MACRO) {
                self.lost.get_or_insert_with(|| "the macro's process has ended".to_owned());
            }
        }
        let mut events = self.receive(sink)?;
        if self.lost.is_none() {
            self.flush()?;
            self.grant()?;
        }
        if let Some(reason) = &self.lost
            && !self.loss_reported
        {
            self.loss_reported = true;
            sink(WorkerEvent::MacroLost(reason.clone()));
            events += 1;
        }
        Ok(events)
    }

    /// Delivers the answers that have come. Requests are answered in order, so only the oldest is looked at.
    fn receive(&mut self, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        let mut events = 0;
        while let Some(oldest) = self.open.front() {
            match oldest.receive().map_err(refused("receive from the macro"))? {
                Some(response) => {
                    let dismissed = &mut self.dismissed;
                    let delivered = deliver_to_worker(response.payload(), &mut |event| {
                        *dismissed |= matches!(event, WorkerEvent::Control(ToWorker::Bye));
                        sink(event);
                    });
                    match delivered {
                        Ok(()) => {}
                        // Nothing that follows would be understood either.
                        Err(error @ FrameError::Version { .. }) => {
                            let reason = format!("{error}; start macro and workers from the same build of grainspan");
                            self.lost.get_or_insert(reason);
                        }
                        Err(error) => tracing::warn!(%error, "dropped a message of the macro"),
                    }
                    events += 1;
                }
                None if oldest.is_connected() => break,
                // It may have been answered between the two looks.
                None if oldest.has_response() => continue,
                None => {}
            }
            self.open.pop_front();
        }
        self.open.retain(|request| request.is_connected() || request.has_response());
        Ok(events)
    }

    /// Sends what waited for a free request.
    fn flush(&mut self) -> Result<(), TransportError> {
        while self.open.len() < WINDOW
            && self.lost.is_none()
            && let Some(bytes) = self.outbox.pop_front()
        {
            self.request(bytes.len(), |out| out.copy_from_slice(&bytes))?;
        }
        Ok(())
    }

    /// Keeps enough permissions at the macro.
    fn grant(&mut self) -> Result<(), TransportError> {
        while self.greeted && self.lost.is_none() && self.open.len() < CREDITS {
            let (credit, sender) = (Outgoing::Credit, self.sender);
            self.request(credit.length(), |out| credit.write(sender, out))?;
        }
        Ok(())
    }

    fn send(&mut self, message: &Outgoing<'_>) -> Result<(), TransportError> {
        let sender = self.sender;
        self.send_with(message.length(), |out| message.write(sender, out))
    }

    fn send_with(&mut self, size: usize, fill: impl FnOnce(&mut [u8])) -> Result<(), TransportError> {
        if size > self.limit {
            return Err(TransportError::TooLarge { size, limit: self.limit });
        }
        if self.outbox.is_empty() && self.open.len() < WINDOW {
            self.request(size, fill)?;
        } else {
            let mut bytes = vec![0; size];
            fill(&mut bytes);
            self.outbox.push_back(bytes);
        }
        self.grant()
    }

    /// Sends one request in memory loaned from the channel and wakes the macro. A macro that is not there any more is
    /// no error: the next poll tells.
    fn request(&mut self, size: usize, fill: impl FnOnce(&mut [u8])) -> Result<(), TransportError> {
        check_room(size as u64)
            .map_err(|error| TransportError::Channel { action: "send a message", reason: error.to_string() })?;
        let mut request = self.client.loan_slice(size).map_err(refused("loan memory for a message"))?;
        fill(request.payload_mut());
        let pending = request.send().map_err(refused("send to the macro"))?;
        if pending.number_of_server_connections() == 0 {
            self.lost.get_or_insert_with(|| "the macro has closed its channel".to_owned());
            return Ok(());
        }
        self.open.push_back(pending);
        let _ = self.to_macro.notify();
        Ok(())
    }
}

impl Waits for SharedMemoryWorkerPort {
    fn look(&mut self, limit: Duration) -> bool {
        let open = &self.open;
        self.wait_state.look(limit, || open.front().is_some_and(|oldest| oldest.has_response()))
    }

    fn sleep(&mut self, limit: Duration) -> Result<(), TransportError> {
        self.watch.wait(limit)?;
        self.wait_state.has_slept();
        Ok(())
    }
}

impl WorkerPort for SharedMemoryWorkerPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        poll(self, wait, |port| port.drain(sink))
    }

    fn send_control(&mut self, message: &FromWorker) -> Result<(), TransportError> {
        self.greeted |= matches!(message, FromWorker::Hello { .. });
        self.send(&Outgoing::control(message))
    }

    fn send_replies(&mut self, replies: &[LoadedReply<'_>]) -> Result<(), TransportError> {
        match self.send(&Outgoing::Replies(replies)) {
            // Nobody knows how large the states of an engine are before the first of them: each half may fit.
            Err(TransportError::TooLarge { .. }) if replies.len() > 1 => {
                let (first, second) = replies.split_at(replies.len() / 2);
                self.send_replies(first)?;
                self.send_replies(second)
            }
            sent => sent,
        }
    }
}

impl Drop for SharedMemoryWorkerPort {
    fn drop(&mut self) {
        let known = std::mem::take(&mut self.greeted);
        if !known || self.lost.is_some() || self.send(&Outgoing::Close).is_err() {
            return;
        }
        let deadline = Instant::now() + if self.dismissed { FAREWELL_DISMISSED } else { FAREWELL };
        // The macro ends all requests of a worker that has closed.
        while !(self.outbox.is_empty() && self.open.is_empty()) && self.lost.is_none() && Instant::now() < deadline {
            let waited = self.watch.wait(Duration::from_millis(20));
            if waited.is_err() || self.drain(&mut |_| {}).is_err() {
                return;
            }
        }
    }
}

fn join_error(reason: impl std::fmt::Display) -> TransportError {
    TransportError::Channel { action: "join the run", reason: reason.to_string() }
}
