//! The macro's end: the only server of a run.

use super::empty_file_removal::EmptyFileRemoval;
use super::polling::{Waits, poll};
use super::run_directory::{ChannelLimits, RunDirectory, RunError, RunRecord, check_room};
use super::services::{Listener, Notifier, OpenRequest, Server, Services, message_bytes, port_name};
use super::waiting::WaitState;
use super::watch::{WAKER, Watch};
use super::{CREDITS, refused, system};
use crate::control::{FromWorker, ToWorker};
use crate::transport::delivery::deliver_to_macro;
use crate::transport::frame::{Frame, FrameError, FrameKind, Outgoing};
use crate::transport::{LoadedJob, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use iceoryx2::port::notifier::ListenerKey;
use iceoryx2::prelude::CallbackProgression;
use rustix::process::{Signal, pidfd_send_signal};
use std::collections::{BTreeMap, VecDeque};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Duration;

/// One worker that has said hello.
struct Peer {
    /// The number under which it sends.
    sender: u64,
    pid: u32,
    /// Requests that wait for an answer, oldest first: permissions to send it one frame each.
    credits: VecDeque<OpenRequest>,
    /// Frames that wait for a permission.
    outbox: VecDeque<Vec<u8>>,
    /// Where its wake-up goes; found at the first use.
    wake: Option<ListenerKey>,
    /// Its process; none if it shares ours (a thread) or had ended before its hello was read.
    process: Option<OwnedFd>,
    /// Why it is to be given up at the next poll.
    doomed: Option<String>,
}

/// The macro's end of a run in shared memory. Dropping it removes everything that the run has in memory.
pub struct SharedMemoryMacroPort {
    peers: BTreeMap<WorkerId, Peer>,
    by_sender: BTreeMap<u64, WorkerId>,
    joined: u32,
    wait_state: WaitState,
    watch: Watch,
    /// None only while dropping, when it must go before the workers are told.
    server: Option<Server>,
    to_workers: Notifier,
    listener: Listener,
    services: Services,
    // The last two: while iceoryx2 tidies up it may need the removal of empty files, and the files go when nothing uses them any more.
    _empty_files: EmptyFileRemoval,
    run: RunDirectory,
}

impl SharedMemoryMacroPort {
    /// Begins the run `name`; workers can join when this returns.
    ///
    /// # Errors
    /// A [`RunError`] in words, or a refusal of iceoryx2 or the system.
    pub fn create(name: &str, limits: ChannelLimits) -> Result<Self, TransportError> {
        let mut run = RunDirectory::create(name, limits).map_err(begin_error)?;
        let empty_files =
            EmptyFileRemoval::start(run.record().prefix.clone()).map_err(system("start the empty_files thread"))?;
        let services = Services::create(run.record())?;
        let server = services.server(run.record())?;
        let listener =
            services.to_macro.listener_builder().create().map_err(refused("listen for the workers' wake-ups"))?;
        let to_workers =
            services.to_worker.notifier_builder().create().map_err(refused("prepare the workers' wake-ups"))?;
        let watch = Watch::new(&listener)?;
        run.make_private().map_err(begin_error)?;
        run.announce().map_err(begin_error)?;
        Ok(Self {
            peers: BTreeMap::new(),
            by_sender: BTreeMap::new(),
            joined: 0,
            wait_state: WaitState::new(limits.waiting),
            watch,
            server: Some(server),
            to_workers,
            listener,
            services,
            _empty_files: empty_files,
            run,
        })
    }

    /// What workers read to join.
    pub fn record(&self) -> &RunRecord {
        self.run.record()
    }

    fn drain(&mut self, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        // Order matters. Wake-ups first, else one that comes between would be lost; ended processes before messages,
        // so that all that an ended process had sent is read before it is given up.
        let fired = if self.wait_state.asks_kernel() {
            self.listener.try_wait(|_| {}).map_err(refused("read wake-ups"))?;
            self.watch.fired()?
        } else {
            Vec::new()
        };
        let mut events = self.receive(sink)?;
        for token in &fired {
            if let Some(peer) = self.by_sender.get(token).and_then(|worker| self.peers.get_mut(worker)) {
                peer.doomed.get_or_insert_with(|| "its process has ended".to_owned());
            }
        }
        events += self.give_up_doomed(sink);
        if fired.contains(&WAKER) {
            sink(MacroEvent::Woken);
            events += 1;
        }
        self.flush_all()?;
        Ok(events)
    }

    fn receive(&mut self, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        let mut events = 0;
        loop {
            let server = self.server.as_ref().expect("the server lives until drop");
            let Some(request) = server.receive().map_err(refused("receive from the workers"))? else {
                return Ok(events);
            };
            events += self.take(request, sink);
        }
    }

    /// Handles one request of a worker; returns the number of events delivered.
    fn take(&mut self, request: OpenRequest, sink: &mut dyn FnMut(MacroEvent<'_>)) -> usize {
        let bytes = request.payload();
        let frame = match Frame::parse(bytes) {
            Ok(frame) => frame,
            Err(error) => {
                sink(MacroEvent::Refused(error.to_string()));
                if let Some(sender) = Frame::sender_of_stranger(bytes) {
                    self.turn_away(&request, sender, &error);
                }
                return 1;
            }
        };
        let known = self.by_sender.get(&frame.sender).copied().or_else(|| self.admit(&frame));
        let Some(worker) = known else {
            sink(MacroEvent::Refused("a message of a worker that has not said hello, or was given up".to_owned()));
            return 1;
        };
        let Some(peer) = self.peers.get_mut(&worker) else { return 0 };
        let events = match frame.kind {
            FrameKind::Credit => 0,
            FrameKind::Close => {
                peer.doomed = Some("its port was closed".to_owned());
                0
            }
            FrameKind::Control | FrameKind::Jobs | FrameKind::Replies => {
                if let Err(error) = deliver_to_macro(worker, bytes, sink) {
                    sink(MacroEvent::Refused(format!("worker {}: {error}", worker.0)));
                }
                1
            }
        };
        if peer.credits.len() < CREDITS {
            peer.credits.push_back(request);
        } else {
            // The worker has said more than it was asked: the surplus request is ended so that it can say more.
            drop(request);
            self.wake(worker);
        }
        events
    }

    /// Tells a worker of another version that it cannot take part, so that it need not wait for a welcome. What it gets is
    /// a frame of this version: that alone ends it.
    fn turn_away(&self, request: &OpenRequest, sender: u64, error: &FrameError) {
        let reason = format!("{error}; start macro and workers from the same build of grainspan");
        let refusal = Outgoing::control(&ToWorker::Refused { reason });
        // It may be gone already.
        let _ = answer(request, refusal.length(), |out| refusal.write(0, out));
        self.wake_by_name(sender, &mut None);
    }

    /// Makes a worker known by its first hello.
    fn admit(&mut self, frame: &Frame<'_>) -> Option<WorkerId> {
        if frame.kind != FrameKind::Control {
            return None;
        }
        let Ok(FromWorker::Hello { pid, .. }) = frame.control::<FromWorker>() else { return None };
        let worker = WorkerId(self.joined);
        self.joined += 1;
        let (process, doomed) = if pid == std::process::id() {
            (None, None)
        } else {
            match self.watch.process(pid, frame.sender) {
                // The number may be that of a stranger, whom a kill would hit.
                Ok(_) if !may_have_mapped(pid, &self.run.record().prefix) => (
                    None,
                    Some(format!(
                        "its process number {pid} belongs to a process that is not in this run; do macro and worker \
                         share one process id space?"
                    )),
                ),
                Ok(process) => (Some(process), None),
                Err(error) => (None, Some(format!("its process {pid} cannot be watched: {error}"))),
            }
        };
        let peer = Peer {
            sender: frame.sender,
            pid,
            credits: VecDeque::new(),
            outbox: VecDeque::new(),
            wake: None,
            process,
            doomed,
        };
        self.by_sender.insert(frame.sender, worker);
        self.peers.insert(worker, peer);
        Some(worker)
    }

    fn give_up_doomed(&mut self, sink: &mut dyn FnMut(MacroEvent<'_>)) -> usize {
        let doomed: Vec<WorkerId> =
            self.peers.iter().filter(|(_, peer)| peer.doomed.is_some()).map(|(worker, _)| *worker).collect();
        let mut processes_ended = false;
        for worker in &doomed {
            if let Some(peer) = self.peers.get_mut(worker) {
                // A port that is closing waits for its requests to end.
                peer.credits.clear();
                self.wake(*worker);
            }
            let Some(peer) = self.peers.remove(worker) else { continue };
            self.by_sender.remove(&peer.sender);
            processes_ended |= peer.process.is_some();
            sink(MacroEvent::Lost(*worker, peer.doomed.unwrap_or_default()));
        }
        if processes_ended {
            // Makes room for replacements; a process that is just being tidied up by another is skipped.
            let _ = self.services.node.try_cleanup_dead_nodes();
        }
        doomed.len()
    }

    fn send(&mut self, worker: WorkerId, message: &Outgoing<'_>) -> Result<(), TransportError> {
        let length = message.length_within(message_bytes(self.run.record()))?;
        let peer = self.peers.get_mut(&worker).filter(|peer| peer.doomed.is_none());
        let peer = peer.ok_or(TransportError::Gone(worker))?;
        if !peer.outbox.is_empty() || peer.credits.is_empty() {
            peer.outbox.push_back(message.to_vec(0));
            return Ok(());
        }
        if let Some(credit) = peer.credits.pop_front() {
            answer(&credit, length, |out| message.write(0, out))?;
        }
        self.wake(worker);
        Ok(())
    }

    /// Sends what waited for permissions that have come.
    fn flush_all(&mut self) -> Result<(), TransportError> {
        let mut served = Vec::new();
        for (worker, peer) in &mut self.peers {
            while !peer.credits.is_empty()
                && let Some(bytes) = peer.outbox.pop_front()
                && let Some(credit) = peer.credits.pop_front()
            {
                answer(&credit, bytes.len(), |out| out.copy_from_slice(&bytes))?;
                served.push(*worker);
            }
        }
        served.dedup();
        served.into_iter().for_each(|worker| self.wake(worker));
        Ok(())
    }

    /// Wakes one worker. A worker that cannot be woken is ended or about to be: its pidfd tells.
    fn wake(&mut self, worker: WorkerId) {
        let Some(peer) = self.peers.get_mut(&worker) else { return };
        let reached = peer.wake.as_ref().is_some_and(|key| self.to_workers.notify_single_listener(key).is_ok());
        if reached {
            return;
        }
        let (sender, mut found) = (peer.sender, None);
        self.wake_by_name(sender, &mut found);
        if let Some(peer) = self.peers.get_mut(&worker)
            && found.is_some()
        {
            peer.wake = found;
        }
    }

    /// Wakes the listener of the port `sender` and tells where it is.
    fn wake_by_name(&self, sender: u64, found: &mut Option<ListenerKey>) {
        let wanted = port_name(sender);
        self.to_workers.for_each_listener(|one, details| {
            if details.listener_name != wanted {
                return CallbackProgression::Continue;
            }
            *found = Some(one.listener_key());
            let _ = one.notify();
            CallbackProgression::Stop
        });
    }
}

/// Whether a process has memory of the run with this prefix mapped, as every worker has; true when the system does not
/// let us look.
fn may_have_mapped(pid: u32, prefix: &str) -> bool {
    std::fs::read_to_string(format!("/proc/{pid}/maps")).map_or(true, |maps| maps.is_empty() || maps.contains(prefix))
}

/// Answers a request in memory loaned from the channel.
fn answer(credit: &OpenRequest, length: usize, fill: impl FnOnce(&mut [u8])) -> Result<(), TransportError> {
    check_room(length as u64)
        .map_err(|error| TransportError::Channel { action: "send a message", reason: error.to_string() })?;
    let mut response = credit.loan_slice(length).map_err(refused("loan memory for a message"))?;
    fill(response.payload_mut());
    response.send().map_err(refused("send to a worker"))
}

impl Waits for SharedMemoryMacroPort {
    fn look(&mut self, limit: Duration) -> bool {
        let server = self.server.as_ref().expect("the server lives until drop");
        // An error shows in the drain that follows.
        self.wait_state.look(limit, || server.has_requests().unwrap_or(true))
    }

    fn sleep(&mut self, limit: Duration) -> Result<(), TransportError> {
        self.watch.wait(limit)?;
        self.wait_state.has_slept();
        Ok(())
    }
}

impl MacroPort for SharedMemoryMacroPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        poll(self, wait, |port| port.drain(sink))
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        self.send(worker, &Outgoing::control(message))
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        self.send(worker, &Outgoing::Jobs(jobs))
    }

    fn kill(&mut self, worker: WorkerId) {
        let Some(peer) = self.peers.get_mut(&worker) else { return };
        match &peer.process {
            // A failure means that it has already ended, which the descriptor reports as well.
            Some(process) => {
                let _ = pidfd_send_signal(process, Signal::KILL);
            }
            None => {
                let thread = peer.pid == std::process::id();
                peer.doomed = Some(if thread { "killed" } else { "its process had ended" }.to_owned());
                self.watch.waker().wake();
            }
        }
    }

    fn waker(&self) -> Arc<dyn Waker> {
        self.watch.waker()
    }
}

impl Drop for SharedMemoryMacroPort {
    fn drop(&mut self) {
        // Workers notice the end of the server when they look, so they are told to look after it has ended.
        self.peers.clear();
        self.server = None;
        let _ = self.to_workers.notify();
    }
}

fn begin_error(error: RunError) -> TransportError {
    TransportError::Channel { action: "begin the run", reason: error.to_string() }
}
