//! The other end of a connection: how an agent, or a single worker, reaches the macro's listener.

use crate::buffers::Buffers;
use crate::connection::{Gate, Limits, Outbox, Socket, prepare, pump, read_ahead, read_message, write_message};
use crate::join_file::Target;
use crate::lock;
use crate::message::{Admission, Body, Join, LINK_VERSION, ToAgent, packed, unpacked, with_frame};
use crate::program::this_program;
use crate::tls;
use protocol::PROTOCOL_VERSION;
use protocol::control::FromWorker;
use protocol::transport::delivery::deliver_to_worker;
use protocol::transport::frame::Outgoing;
use protocol::transport::{LoadedReply, TransportError, Waker, WorkerEvent, WorkerId, WorkerPort};
use rustls::ClientConfig;
use rustls::pki_types::ServerName;
use std::collections::VecDeque;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use thiserror::Error;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;

/// How long one attempt to reach a listener may take.
const ATTEMPT: Duration = Duration::from_secs(5);

/// First and longest pause between two attempts.
const PAUSES: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(2)];

/// Longest answer to the first message.
const ADMISSION_LENGTH: usize = 64 << 10;

/// Why there is no connection.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum JoinError {
    /// The run does not take this agent.
    #[error("the run refused this host: {0}")]
    Refused(String),
    /// What is given here does not lead to a run.
    #[error("{0}")]
    Given(String),
    /// Nobody listens there, or the way is blocked.
    #[error("{0}")]
    Unreachable(String),
    /// Whoever listens there shows another key than ours. Keys follow from the secret, and how they do may differ between builds.
    #[error(
        "{0}: the secret is not that of the run, or the run is of another build of grainspan, or the port is not that of a run ({1}); give \
         both sides one secret and one program"
    )]
    Untrusted(String, String),
}

#[derive(Default)]
struct MessageQueue {
    messages: VecDeque<Vec<u8>>,
    closed: Option<String>,
    waker: Option<Arc<dyn Waker>>,
}

#[derive(Default)]
struct Shared {
    queue: Mutex<MessageQueue>,
    changed: Condvar,
}

impl Shared {
    fn change(&self, change: impl FnOnce(&mut MessageQueue)) {
        let waker = {
            let mut queue = lock(&self.queue);
            change(&mut queue);
            queue.waker.clone()
        };
        self.changed.notify_all();
        if let Some(waker) = waker {
            waker.wake();
        }
    }
}

/// What has arrived over a connection.
pub(crate) struct Arrived {
    /// Messages, oldest first.
    pub(crate) messages: VecDeque<Vec<u8>>,
    /// Why the connection has ended, if it has; nothing comes after that.
    pub(crate) closed: Option<String>,
}

/// A connection to a run, admitted.
pub(crate) struct Link {
    /// Name of the run.
    pub(crate) run: String,
    shared: Arc<Shared>,
    outbox: Option<Outbox>,
    gate: Gate,
    pub(crate) buffers: Buffers,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    /// One attempt to join; every endpoint is tried.
    ///
    /// # Errors
    /// [`JoinError`] of the last endpoint, or a refusal.
    pub(crate) fn join(
        target: &Target,
        state_bytes: u64,
        limits: Limits,
        waker: Option<Arc<dyn Waker>>,
    ) -> Result<Self, JoinError> {
        let unreachable = |error: &dyn std::fmt::Display| JoinError::Unreachable(error.to_string());
        let config = tls::agent_side(&target.secret).map_err(|error| unreachable(&error))?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build();
        let runtime = runtime.map_err(|error| unreachable(&error))?;
        let shared = Arc::new(Shared::default());
        lock(&shared.queue).waker = waker;
        let (outbox, outgoing) = unbounded_channel();
        let (gate, buffers) = (Gate::new(), Buffers::new());
        let (decided, decision) = channel();
        let body = {
            let (shared, gate, endpoints) = (Arc::clone(&shared), gate.clone(), target.endpoints.clone());
            let buffers = buffers.clone();
            move || {
                let conversation = run_connection(
                    &endpoints,
                    config,
                    state_bytes,
                    limits,
                    outgoing,
                    gate,
                    &buffers,
                    &shared,
                    decided,
                );
                runtime.block_on(conversation);
                runtime.shutdown_timeout(Duration::ZERO);
            }
        };
        let thread = std::thread::Builder::new().name("host link".into()).spawn(body);
        let thread = thread.map_err(|error| unreachable(&error))?;
        let run = decision.recv().map_err(|error| unreachable(&error))??;
        Ok(Self { run, shared, outbox: Some(outbox), gate, buffers, thread: Some(thread) })
    }

    /// As [`Link::join`], again and again with growing pauses until `timeout` is over or `go_on` says no. A refusal is final.
    ///
    /// # Errors
    /// A refusal, or the last failure.
    pub(crate) fn join_within(
        target: &dyn Fn() -> Result<Target, JoinError>,
        state_bytes: u64,
        limits: Limits,
        waker: Option<&Arc<dyn Waker>>,
        timeout: Duration,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Self, JoinError> {
        let (begin, [mut pause, longest]) = (Instant::now(), PAUSES);
        loop {
            let joined = target().and_then(|target| Self::join(&target, state_bytes, limits, waker.cloned()));
            let error = match joined {
                Ok(link) => return Ok(link),
                Err(error @ (JoinError::Refused(_) | JoinError::Given(_))) => return Err(error),
                Err(error) => error,
            };
            if begin.elapsed() + pause > timeout || !go_on() {
                return Err(error);
            }
            tracing::debug!(%error, "could not join, trying again");
            std::thread::sleep(pause);
            pause = (pause * 2).min(longest);
        }
    }

    /// What has arrived, waiting up to `wait` for the first.
    pub(crate) fn take(&self, wait: Duration) -> Arrived {
        let end = Instant::now().checked_add(wait);
        let mut queue = lock(&self.shared.queue);
        while queue.messages.is_empty() && queue.closed.is_none() {
            let left = end.map_or(Duration::from_secs(3600), |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                break;
            }
            queue = match self.shared.changed.wait_timeout(queue, left) {
                Ok((queue, _)) => queue,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
        let messages = std::mem::take(&mut queue.messages);
        messages.iter().for_each(|message| self.gate.handled(message.len()));
        Arrived { messages, closed: queue.closed.clone() }
    }

    /// Sends a frame of a worker.
    pub(crate) fn send_frame(&self, slot: u32, outgoing: &Outgoing<'_>) -> bool {
        self.send(with_frame(slot, outgoing.length(), &self.buffers, |out| outgoing.write(0, out)))
    }

    /// Sends a message; one that is sent to a closed connection is lost, and [`Link::take`] reports the end.
    pub(crate) fn send(&self, message: Vec<u8>) -> bool {
        self.outbox.as_ref().is_some_and(|outbox| outbox.send(message).is_ok())
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // Everything that was sent leaves before the connection closes, if the other side takes it.
        self.outbox = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[allow(clippy::too_many_arguments, reason = "the state of one conversation, handed over once")]
async fn run_connection(
    endpoints: &[String],
    config: Arc<ClientConfig>,
    state_bytes: u64,
    limits: Limits,
    outgoing: UnboundedReceiver<Vec<u8>>,
    gate: Gate,
    buffers: &Buffers,
    shared: &Shared,
    decided: Sender<Result<String, JoinError>>,
) {
    let mut reached = Err(JoinError::Unreachable("no endpoint is given".to_owned()));
    for endpoint in endpoints {
        reached = timeout(ATTEMPT, reach(endpoint, Arc::clone(&config), state_bytes, &limits))
            .await
            .unwrap_or_else(|_| Err(JoinError::Unreachable(format!("{endpoint} does not answer"))));
        if matches!(reached, Ok(_) | Err(JoinError::Refused(_) | JoinError::Given(_))) {
            break;
        }
    }
    match reached {
        Err(error) => {
            // Whoever asked may have given up.
            let _ = decided.send(Err(error));
        }
        Ok((run, stream)) => {
            if decided.send(Ok(run)).is_err() {
                return;
            }
            let deliver = |message| shared.change(|queue| queue.messages.push_back(message));
            let reason = pump(stream, outgoing, limits, gate, buffers, deliver).await;
            shared.change(|queue| queue.closed = Some(reason));
        }
    }
}

/// Connects to one endpoint and is admitted: the name of the run, and the connection.
async fn reach(
    endpoint: &str,
    config: Arc<ClientConfig>,
    state_bytes: u64,
    limits: &Limits,
) -> Result<(String, TlsStream<Socket>), JoinError> {
    let unreachable =
        |error: &dyn std::fmt::Display| JoinError::Unreachable(format!("{endpoint} cannot be reached: {error}"));
    let untrusted = |error: &dyn std::fmt::Display| JoinError::Untrusted(endpoint.to_owned(), error.to_string());
    let socket = TcpStream::connect(endpoint).await.map_err(|error| unreachable(&error))?;
    prepare(&socket, limits).map_err(|error| unreachable(&error))?;
    let name = ServerName::try_from("grainspan").map_err(|error| unreachable(&error))?;
    let connector = TlsConnector::from(config);
    let mut stream = connector.connect(name, read_ahead(socket)).await.map_err(|error| untrusted(&error))?;
    let join = Join {
        link: LINK_VERSION,
        protocol: PROTOCOL_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        program: this_program().to_owned(),
        host: rustix::system::uname().nodename().to_string_lossy().into_owned(),
        state_bytes,
    };
    let answer = async {
        write_message(&mut stream, &packed(&join)).await?;
        stream.flush().await?;
        read_message(&mut stream, ADMISSION_LENGTH).await
    };
    // In TLS 1.3 the listener's decision about our key arrives with its first answer.
    let answer = answer.await.map_err(|error| untrusted(&error))?.ok_or_else(|| untrusted(&"it closed"))?;
    match unpacked(&answer).map_err(|error| untrusted(&error))? {
        Admission::Admitted { run } => Ok((run, stream)),
        Admission::Refused { reason } => Err(JoinError::Refused(reason)),
    }
}

/// A single worker's end of a connection, without an agent in between. It keeps no states beyond its own.
pub struct NetworkWorkerPort {
    link: Link,
    limits: Limits,
    loss_reported: bool,
}

impl NetworkWorkerPort {
    /// Joins the run at `target`; tries again until `timeout` is over.
    ///
    /// # Errors
    /// [`JoinError`].
    pub fn join(target: &Target, limits: Limits, timeout: Duration) -> Result<Self, JoinError> {
        let link = Link::join_within(&|| Ok(target.clone()), 0, limits, None, timeout, &|| true)?;
        Ok(Self { link, limits, loss_reported: false })
    }

    /// Name of the run that was joined.
    pub fn run(&self) -> &str {
        &self.link.run
    }

    /// Sends bytes as they are in place of a frame: how tests play a broken worker.
    ///
    /// # Errors
    /// As [`WorkerPort::send_control`].
    pub fn send_raw(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        let message = with_frame(0, bytes.len(), &self.link.buffers, |out| out.copy_from_slice(bytes));
        if self.link.send(message) { Ok(()) } else { Err(TransportError::Gone(WorkerId(0))) }
    }

    fn send(&mut self, outgoing: &Outgoing<'_>) -> Result<(), TransportError> {
        outgoing.length_within(self.limits.message_bytes)?;
        if self.link.send_frame(0, outgoing) { Ok(()) } else { Err(TransportError::Gone(WorkerId(0))) }
    }
}

impl WorkerPort for NetworkWorkerPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        if self.loss_reported {
            return Ok(0);
        }
        let arrived = self.link.take(wait);
        let (mut events, mut ended) = (0, arrived.closed);
        for bytes in arrived.messages {
            match Body::parse(&bytes) {
                Ok((0, Body::Frame(frame))) => match deliver_to_worker(frame, sink) {
                    Ok(()) => events += 1,
                    Err(error) => tracing::warn!(%error, "dropped a message of the macro"),
                },
                Ok((_, Body::Control(body))) => match unpacked(body) {
                    Ok(ToAgent::Kill) => ended = Some("the run has ended this worker".to_owned()),
                    Ok(ToAgent::Farewell { reason }) => ended = Some(reason),
                    Ok(ToAgent::Forget { .. }) => {}
                    Err(error) => tracing::warn!(%error, "dropped a message of the macro"),
                },
                Ok(_) => tracing::warn!("dropped a message for another worker"),
                Err(error) => tracing::warn!(%error, "dropped a message of the macro"),
            }
            self.link.buffers.give(bytes);
        }
        if let Some(reason) = ended {
            self.loss_reported = true;
            sink(WorkerEvent::MacroLost(reason));
            events += 1;
        }
        Ok(events)
    }

    fn send_control(&mut self, message: &FromWorker) -> Result<(), TransportError> {
        self.send(&Outgoing::control(message))
    }

    fn send_replies(&mut self, replies: &[LoadedReply<'_>]) -> Result<(), TransportError> {
        let outgoing = Outgoing::Replies(replies);
        if replies.len() > 1 && outgoing.length() > self.limits.message_bytes {
            let (first, second) = replies.split_at(replies.len() / 2);
            self.send_replies(first)?;
            return self.send_replies(second);
        }
        self.send(&outgoing)
    }
}
