//! The macro's end: the workers of all agents as workers of one port.

use crate::connection::{Gate, Outbox};
pub use crate::listener::ListenerOptions;
use crate::listener::{AgentListener, Arrival, Peer};
use crate::message::{Body, FromAgent, MessageError, ToAgent, unpacked, with_control, with_frame, with_jobs};
use crate::state_mirror::StateMirror;
use crate::statistics::Figures;
use protocol::StateId;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::delivery::deliver_to_macro;
use protocol::transport::frame::{Frame, FrameError, FrameKind, Outgoing};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;

/// Workers that one agent may bring.
const MOST_WORKERS: usize = 4096;

/// Messages of an agent that are none before it is given up.
const MOST_REFUSED: u32 = 100;

/// Why a message of an agent was refused.
#[derive(Debug, Error)]
enum RefusedMessage {
    /// It cannot be read.
    #[error(transparent)]
    Message(#[from] MessageError),
    /// What it carries for a worker that is not known yet cannot be read.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// What a known worker sent cannot be read.
    #[error("worker {}: {error}", .worker.0)]
    Worker { worker: WorkerId, error: FrameError },
    #[error("jobs, from an agent")]
    Jobs,
    #[error("a message of a worker that has not said hello")]
    NoHello,
    #[error("more than {MOST_WORKERS} workers")]
    TooManyWorkers,
}

/// One connected agent.
struct Agent {
    host: String,
    outbox: Outbox,
    gate: Gate,
    workers: BTreeMap<u32, WorkerId>,
    /// Numbers of workers that have ended; what they still had under way is ignored.
    ended: BTreeSet<u32>,
    /// None if the agent keeps no states.
    mirror: Option<StateMirror>,
    /// Messages handled.
    heard: u64,
    /// Messages that were none.
    refused: u32,
    leaving: bool,
}

/// The macro's end of all connections to agents. It listens as long as it lives; dropping it ends the connections in good order.
pub struct NetworkMacroPort {
    agents: BTreeMap<u64, Agent>,
    /// Agent and number there, of each worker.
    routes: BTreeMap<WorkerId, (u64, u32)>,
    joined: u32,
    /// Ends of workers that are to be reported at the next poll.
    ended: Vec<MacroEvent<'static>>,
    message_bytes: usize,
    listener: AgentListener,
}

impl NetworkMacroPort {
    /// Listens for agents at `endpoint`, as `0.0.0.0:7400`; port 0 takes a free one.
    ///
    /// # Errors
    /// The endpoint is taken or not of this host.
    pub fn listen(endpoint: &str, options: ListenerOptions) -> Result<Self, TransportError> {
        let message_bytes = options.limits.message_bytes;
        let listener = AgentListener::open(endpoint, options)?;
        Ok(Self {
            agents: BTreeMap::new(),
            routes: BTreeMap::new(),
            joined: 0,
            ended: Vec::new(),
            message_bytes,
            listener,
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.listener.address()
    }

    /// What has happened at the listener and on the connections.
    pub fn figures(&self) -> Figures {
        self.listener.shared.figures.clone()
    }

    /// Ends all connections at once and listens no more, as when this process is killed: for tests.
    #[doc(hidden)]
    pub fn cut_connections(&self) {
        self.listener.cut();
    }

    /// From now on whatever arrives also wakes this one.
    pub(crate) fn set_waker(&self, waker: Arc<dyn Waker>) {
        self.listener.shared.set_waker(waker);
    }

    fn open(&mut self, peer: Peer) {
        let agent = Agent {
            host: peer.host,
            outbox: peer.outbox,
            gate: peer.gate,
            workers: BTreeMap::new(),
            ended: BTreeSet::new(),
            mirror: (peer.state_bytes > 0).then(|| StateMirror::new(peer.state_bytes)),
            heard: 0,
            refused: 0,
            leaving: false,
        };
        self.agents.insert(peer.number, agent);
    }

    /// Handles a message of an agent; returns the number of events.
    fn take(&mut self, number: u64, bytes: &[u8], sink: &mut dyn FnMut(MacroEvent<'_>)) -> usize {
        let Some(agent) = self.agents.get_mut(&number) else { return 0 };
        agent.gate.handled(bytes.len());
        agent.heard += 1;
        self.listener.shared.figures.count(|figures| {
            figures.messages_received += 1;
            figures.bytes_received += bytes.len() as u64;
        });
        let events = match Body::parse(bytes) {
            Ok((slot, Body::Frame(frame))) => self.take_from_worker(number, slot, frame, sink),
            Ok((slot, Body::Control(body))) => match unpacked(body) {
                Ok(message) => Ok(self.take_from_agent(number, slot, message, sink)),
                Err(error) => Err(error.into()),
            },
            Ok((_, Body::Jobs { .. })) => Err(RefusedMessage::Jobs),
            Err(error) => Err(error.into()),
        };
        match events {
            Ok(events) => events,
            Err(reason) => self.refuse(number, &reason, sink),
        }
    }

    /// Counts what is no message. An agent that goes on with it is given up.
    fn refuse(&mut self, number: u64, reason: &RefusedMessage, sink: &mut dyn FnMut(MacroEvent<'_>)) -> usize {
        let Some(agent) = self.agents.get_mut(&number) else { return 0 };
        agent.refused += 1;
        sink(MacroEvent::Refused(format!("host {}: {reason}", agent.host)));
        if agent.refused < MOST_REFUSED {
            return 1;
        }
        self.listener.shared.figures.count(|figures| figures.agents_faulty += 1);
        1 + self.close(number, "it keeps sending what is no message", sink)
    }

    fn take_from_worker(
        &mut self,
        number: u64,
        slot: u32,
        bytes: &[u8],
        sink: &mut dyn FnMut(MacroEvent<'_>),
    ) -> Result<usize, RefusedMessage> {
        let Some(agent) = self.agents.get_mut(&number) else { return Ok(0) };
        if agent.ended.contains(&slot) {
            self.note_states_of_ended(number, slot, bytes);
            return Ok(0);
        }
        let worker = match agent.workers.get(&slot) {
            Some(worker) => *worker,
            None => {
                let frame = Frame::parse(bytes)?;
                let greets = frame.kind == FrameKind::Control
                    && matches!(frame.control::<FromWorker>(), Ok(FromWorker::Hello { .. }));
                if !greets {
                    return Err(RefusedMessage::NoHello);
                }
                if agent.workers.len() >= MOST_WORKERS {
                    return Err(RefusedMessage::TooManyWorkers);
                }
                let worker = WorkerId(self.joined);
                self.joined += 1;
                agent.workers.insert(slot, worker);
                self.routes.insert(worker, (number, slot));
                worker
            }
        };
        let mirror = &mut agent.mirror;
        let delivered = deliver_to_macro(worker, bytes, &mut |event| {
            if let Some(mirror) = mirror.as_mut() {
                note_states(mirror, &event);
            }
            sink(event);
        });
        delivered.map_err(|error| RefusedMessage::Worker { worker, error })?;
        self.forget_surplus(number);
        Ok(1)
    }

    /// What a worker still sends after its end counts for nothing, but the agent keeps the states that pass through it.
    fn note_states_of_ended(&mut self, number: u64, slot: u32, bytes: &[u8]) {
        let Some(mirror) = self.agents.get_mut(&number).and_then(|agent| agent.mirror.as_mut()) else { return };
        // What cannot be read, the agent has not kept either.
        let _ = deliver_to_macro(WorkerId(slot), bytes, &mut |event| note_states(mirror, &event));
        self.forget_surplus(number);
    }

    fn take_from_agent(
        &mut self,
        number: u64,
        slot: u32,
        message: FromAgent,
        sink: &mut dyn FnMut(MacroEvent<'_>),
    ) -> usize {
        let Some(agent) = self.agents.get_mut(&number) else { return 0 };
        match message {
            FromAgent::WorkerLost { reason } => {
                agent.ended.insert(slot);
                let Some(worker) = agent.workers.remove(&slot) else { return 0 };
                self.routes.remove(&worker);
                sink(MacroEvent::Lost(worker, format!("{reason} (host {})", agent.host)));
                1
            }
            FromAgent::Leave { reason } => {
                tracing::info!(host = agent.host, reason, "an agent leaves");
                agent.leaving = true;
                self.listener.shared.figures.count(|figures| figures.agents_left += 1);
                let workers: Vec<WorkerId> = agent.workers.values().copied().collect();
                for worker in &workers {
                    sink(MacroEvent::Control(*worker, FromWorker::Bye { reason: reason.clone() }));
                }
                workers.len()
            }
        }
    }

    /// A connection has ended, or is ended: all its workers are cut off.
    fn close(&mut self, number: u64, reason: &str, sink: &mut dyn FnMut(MacroEvent<'_>)) -> usize {
        let Some(agent) = self.agents.remove(&number) else { return 0 };
        if !agent.leaving {
            tracing::warn!(host = agent.host, workers = agent.workers.len(), reason, "agent lost");
            self.listener.shared.figures.count(|figures| figures.agents_lost += 1);
        }
        for worker in agent.workers.values() {
            self.routes.remove(worker);
            sink(MacroEvent::CutOff(*worker, format!("{reason} (host {})", agent.host)));
        }
        agent.workers.len()
    }

    /// Tells an agent which states are beyond what it said it would keep.
    fn forget_surplus(&mut self, number: u64) {
        let Some(agent) = self.agents.get_mut(&number) else { return };
        let states = agent.mirror.as_mut().map(StateMirror::surplus).unwrap_or_default();
        if !states.is_empty() {
            // A closed connection is reported by itself.
            let _ = agent.outbox.send(with_control(0, &ToAgent::Forget { states, heard: agent.heard }));
        }
    }

    fn post(&mut self, worker: WorkerId, message: Vec<u8>) -> Result<(), TransportError> {
        let gone = TransportError::Gone(worker);
        let Some((number, _)) = self.routes.get(&worker) else { return Err(gone) };
        let Some(agent) = self.agents.get(number) else { return Err(gone) };
        self.listener.shared.figures.count(|figures| {
            figures.messages_sent += 1;
            figures.bytes_sent += message.len() as u64;
        });
        agent.outbox.send(message).map_err(|_| gone)
    }

    fn slot(&self, worker: WorkerId) -> Result<(u64, u32), TransportError> {
        self.routes.get(&worker).copied().ok_or(TransportError::Gone(worker))
    }
}

/// Notes the states of replies, which have passed through the agent.
fn note_states(mirror: &mut StateMirror, event: &MacroEvent<'_>) {
    if let MacroEvent::Replies(_, replies) = event {
        replies.iter().for_each(|one| mirror.note(one.reply.state, one.state.len()));
    }
}

impl MacroPort for NetworkMacroPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        let wait = if self.ended.is_empty() { wait } else { Duration::ZERO };
        let (arrivals, woken) = self.listener.shared.take(wait);
        let mut events = self.ended.len() + usize::from(woken);
        std::mem::take(&mut self.ended).into_iter().for_each(&mut *sink);
        for arrival in arrivals {
            match arrival {
                Arrival::Opened(peer) => self.open(peer),
                Arrival::Message(number, bytes) => {
                    events += self.take(number, &bytes, sink);
                    self.listener.shared.buffers.give(bytes);
                }
                Arrival::Closed(number, reason) => events += self.close(number, &reason, sink),
            }
        }
        if woken {
            sink(MacroEvent::Woken);
        }
        Ok(events)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        let (_, slot) = self.slot(worker)?;
        let outgoing = Outgoing::control(message);
        let length = outgoing.length_within(self.message_bytes)?;
        let message = with_frame(slot, length, &self.listener.shared.buffers, |out| outgoing.write(0, out));
        self.post(worker, message)
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        let (number, slot) = self.slot(worker)?;
        let mut jobs = jobs.to_vec();
        let (mut kept, mut saved) = (Vec::new(), 0);
        // States that this message brings. The mirror takes note of them once it is sent: one that is too long brings none.
        let mut brought: Vec<(StateId, usize)> = Vec::new();
        if let Some(mirror) = self.agents.get_mut(&number).and_then(|agent| agent.mirror.as_mut()) {
            for (place, one) in jobs.iter_mut().enumerate().filter(|(_, one)| !one.state.is_empty()) {
                let state = one.job.state;
                if mirror.holds(state) || brought.iter().any(|(other, _)| *other == state) {
                    saved += one.state.len() as u64;
                    kept.push(place as u32);
                    one.state = &[];
                } else if state != StateId::NONE {
                    brought.push((state, one.state.len()));
                }
            }
        }
        let outgoing = Outgoing::Jobs(&jobs);
        let length = outgoing.length_within(self.message_bytes)?;
        let fill = |out: &mut [u8]| outgoing.write(0, out);
        let message = if kept.is_empty() {
            with_frame(slot, length, &self.listener.shared.buffers, fill)
        } else {
            with_jobs(slot, &kept, length, fill)
        };
        self.post(worker, message)?;
        if let Some(mirror) = self.agents.get_mut(&number).and_then(|agent| agent.mirror.as_mut()) {
            brought.into_iter().for_each(|(state, length)| mirror.note(state, length));
            self.listener.shared.figures.count(|figures| {
                figures.states_kept += kept.len() as u64;
                figures.bytes_saved += saved;
            });
        }
        self.forget_surplus(number);
        Ok(())
    }

    fn kill(&mut self, worker: WorkerId) {
        let Ok((number, slot)) = self.slot(worker) else { return };
        // The agent is told, and may be slow or out of reach; here the worker is gone at once, and what it still sends is ignored.
        let is_told = self.post(worker, with_control(slot, &ToAgent::Kill)).is_ok();
        self.routes.remove(&worker);
        if let Some(agent) = self.agents.get_mut(&number) {
            agent.workers.remove(&slot);
            agent.ended.insert(slot);
        }
        // Without a connection nothing is known of the worker itself: its jobs must not be suspected to have ended it.
        self.ended.push(match is_told {
            true => MacroEvent::Lost(worker, "killed".to_owned()),
            false => MacroEvent::CutOff(worker, "the connection to its host has ended".to_owned()),
        });
        self.listener.shared.wake();
    }

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::clone(&self.listener.shared) as Arc<dyn Waker>
    }
}

impl Drop for NetworkMacroPort {
    fn drop(&mut self) {
        let farewell = with_control(0, &ToAgent::Farewell { reason: "the run has ended".to_owned() });
        for agent in self.agents.values() {
            let _ = agent.outbox.send(farewell.clone());
        }
        // Connections end when their outboxes do.
        self.agents.clear();
        for arrival in self.listener.shared.take(Duration::ZERO).0 {
            drop(arrival);
        }
        self.listener.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::worker_port::Link;
    use crate::{Limits, Secret, Target, this_program};
    use bytemuck::Zeroable;
    use protocol::transport::LoadedReply;
    use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
    use protocol::{Capabilities, PROTOCOL_VERSION};
    use std::time::Instant;

    const PATIENCE: Duration = Duration::from_secs(10);

    /// A port and the connection of an agent that keeps `state_bytes` and has one worker, which has said hello.
    fn connected(state_bytes: u64) -> (NetworkMacroPort, Link) {
        let secret = Secret::draw().unwrap();
        let (limits, program) = (Limits::default(), this_program().to_owned());
        let options = ListenerOptions { run: "test".into(), secret: secret.clone(), limits, program };
        let mut port = NetworkMacroPort::listen("127.0.0.1:0", options).unwrap();
        let target = Target { endpoints: vec![port.address().to_string()], secret };
        let link = Link::join(&target, state_bytes, limits, None).unwrap();
        let (run, capabilities) = ("test".to_owned(), Capabilities::default());
        let hello = FromWorker::Hello { protocol: PROTOCOL_VERSION, run, pid: 0, capabilities, state_cache: 4 };
        assert!(link.send_frame(0, &Outgoing::control(&hello)));
        hear(&mut port, |event| matches!(event, MacroEvent::Control(WorkerId(0), FromWorker::Hello { .. })));
        (port, link)
    }

    /// Polls until an event is the expected one.
    fn hear(port: &mut NetworkMacroPort, is_expected: impl Fn(&MacroEvent<'_>) -> bool) {
        let (begin, mut is_heard) = (Instant::now(), false);
        while !is_heard {
            assert!(begin.elapsed() < PATIENCE, "waited in vain");
            port.poll(Duration::from_millis(20), &mut |event| is_heard |= is_expected(&event)).unwrap();
        }
    }

    /// The agent keeps what passes through it; what the macro gave no account of would be kept for ever.
    #[test]
    fn states_of_a_worker_that_was_killed_are_forgotten_like_all_others() {
        let (mut port, link) = connected(3);
        port.kill(WorkerId(0));
        hear(&mut port, |event| matches!(event, MacroEvent::Lost(WorkerId(0), _)));
        let state = StateId::of(b"state");
        let reply = TrialReply { state, ..TrialReply::bare(&TrialJob::zeroed(), ReplyStatus::Done) };
        let replies = [LoadedReply { reply, state: b"state", error: b"" }];
        assert!(link.send_frame(0, &Outgoing::Replies(&replies)));
        let (begin, mut forgotten) = (Instant::now(), None);
        while forgotten.is_none() {
            assert!(begin.elapsed() < PATIENCE, "waited in vain");
            port.poll(Duration::from_millis(20), &mut |event| panic!("{event:?}")).unwrap();
            for bytes in link.take(Duration::ZERO).messages {
                if let Ok((_, Body::Control(body))) = Body::parse(&bytes)
                    && let Ok(ToAgent::Forget { states, heard }) = unpacked(body)
                {
                    forgotten = Some((states, heard));
                }
            }
        }
        assert_eq!(forgotten, Some((vec![state], 2)));
    }

    #[test]
    fn a_worker_that_is_killed_after_its_connection_has_ended_was_cut_off() {
        let (mut port, _link) = connected(0);
        port.cut_connections();
        let begin = Instant::now();
        while port.send_control(WorkerId(0), &ToWorker::Drain).is_ok() {
            assert!(begin.elapsed() < PATIENCE, "the connection does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
        port.kill(WorkerId(0));
        hear(&mut port, |event| matches!(event, MacroEvent::CutOff(WorkerId(0), _)));
    }
}
