//! The macro's listener: a thread that listens, checks who comes, and moves the messages of all agents.
//!
//! Whoever does not prove to know the secret gets nothing but a failed handshake, costs at most a socket for some seconds, and is
//! counted. Nothing that a stranger sends is read by more than the TLS library.

use crate::buffers::Buffers;
use crate::connection::{Gate, Limits, Outbox, prepare, pump, read_ahead, read_message, write_message};
use crate::lock;
use crate::message::{Admission, Join, LINK_VERSION, packed, unpacked};
use crate::secret::Secret;
use crate::statistics::Figures;
use crate::tls;
use protocol::PROTOCOL_VERSION;
use protocol::transport::{TransportError, Waker};
use std::collections::VecDeque;
use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::sync::{Semaphore, watch};
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;

/// How long a stranger may take to prove that he is none.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);

/// Connections that may be in their handshake at the same time; more wait in the system's queue.
const MOST_HANDSHAKES: usize = 64;

/// Longest first message.
const JOIN_LENGTH: usize = 64 << 10;

/// How long connections may take to close when the run ends.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// How the listener of a run decides.
#[derive(Clone, Debug)]
pub struct ListenerOptions {
    /// Name of the run.
    pub run: String,
    /// The shared secret.
    pub secret: Secret,
    /// Limits of every connection.
    pub limits: Limits,
    /// Content hash of the program that agents must run; see [`crate::this_program`].
    pub program: String,
}

/// What has come to the port from the connections.
pub(crate) enum Arrival {
    /// An agent was admitted.
    Opened(Peer),
    /// A message of an agent.
    Message(u64, Vec<u8>),
    /// A connection has ended.
    Closed(u64, String),
}

/// An agent as the listener hands it over.
pub(crate) struct Peer {
    /// Number of the connection.
    pub(crate) number: u64,
    /// Its host, for people.
    pub(crate) host: String,
    /// Bytes of states that it keeps.
    pub(crate) state_bytes: u64,
    /// Messages for it.
    pub(crate) outbox: Outbox,
    /// To be told when a message of it has been handled.
    pub(crate) gate: Gate,
}

#[derive(Default)]
struct ArrivalQueue {
    arrivals: VecDeque<Arrival>,
    woken: bool,
    waker: Option<Arc<dyn Waker>>,
}

/// Between the listener's thread and the port.
pub(crate) struct Shared {
    queue: Mutex<ArrivalQueue>,
    changed: Condvar,
    pub(crate) figures: Figures,
    /// Of all connections.
    pub(crate) buffers: Buffers,
}

impl Shared {
    fn new() -> Self {
        Self {
            queue: Mutex::default(),
            changed: Condvar::new(),
            figures: Figures::default(),
            buffers: Buffers::new(),
        }
    }

    fn push(&self, arrival: Arrival) {
        let waker = {
            let mut queue = lock(&self.queue);
            queue.arrivals.push_back(arrival);
            queue.waker.clone()
        };
        self.changed.notify_all();
        if let Some(waker) = waker {
            waker.wake();
        }
    }

    /// From now on arrivals also wake this one.
    pub(crate) fn set_waker(&self, waker: Arc<dyn Waker>) {
        lock(&self.queue).waker = Some(waker);
    }

    /// All arrivals, waiting up to `wait` for the first, and whether somebody called.
    pub(crate) fn take(&self, wait: Duration) -> (VecDeque<Arrival>, bool) {
        let end = Instant::now().checked_add(wait);
        let mut queue = lock(&self.queue);
        while queue.arrivals.is_empty() && !queue.woken {
            let left = end.map_or(Duration::from_secs(3600), |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                break;
            }
            queue = match self.changed.wait_timeout(queue, left) {
                Ok((queue, _)) => queue,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
        (std::mem::take(&mut queue.arrivals), std::mem::take(&mut queue.woken))
    }
}

impl Waker for Shared {
    fn wake(&self) {
        lock(&self.queue).woken = true;
        self.changed.notify_all();
    }
}

/// The thread behind a port.
pub(crate) struct AgentListener {
    pub(crate) shared: Arc<Shared>,
    address: SocketAddr,
    /// True: close in good order; false: cut.
    closing: watch::Sender<Option<bool>>,
    thread: Option<JoinHandle<()>>,
}

impl AgentListener {
    /// Listens at `endpoint`.
    ///
    /// # Errors
    /// The endpoint cannot be listened at, or the system gives no thread.
    pub(crate) fn open(endpoint: &str, options: ListenerOptions) -> Result<Self, TransportError> {
        let channel = |action| move |reason: String| TransportError::Channel { action, reason };
        let system = |action| move |source| TransportError::System { action, source };
        let listening = |source: std::io::Error| TransportError::Channel {
            action: "listen for agents",
            reason: format!("{endpoint}: {source}; give ADDRESS:PORT of this host, port 0 for any free one"),
        };
        let listener = TcpListener::bind(endpoint).map_err(listening)?;
        listener.set_nonblocking(true).map_err(listening)?;
        let address = listener.local_addr().map_err(listening)?;
        let acceptor =
            tls::macro_side(&options.secret).map_err(|error| channel("prepare the encryption")(error.to_string()))?;
        // Decryption takes most of the time of a message. The threads sleep unless hosts send more than one of them can take.
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(network_threads())
            .thread_name("hosts")
            .enable_io()
            .enable_time()
            .build()
            .map_err(system("start the network threads"))?;
        let shared = Arc::new(Shared::new());
        let (closing, closed) = watch::channel(None);
        let context = Arc::new(ListenerContext {
            options,
            acceptor: TlsAcceptor::from(acceptor),
            handshaking: Arc::new(Semaphore::new(MOST_HANDSHAKES)),
            shared: Arc::clone(&shared),
        });
        let body = move || {
            // On one of the threads of the runtime: this one would take connections only between two of its own.
            let listening = runtime.spawn(listen(listener, context, closed));
            // A panic there has been printed by itself.
            let _ = runtime.block_on(listening);
            // Connections whose peers do not answer are cut.
            runtime.shutdown_timeout(Duration::ZERO);
        };
        let thread = std::thread::Builder::new().name("hosts".into()).spawn(body);
        let thread = thread.map_err(system("start the network thread"))?;
        Ok(Self { shared, address, closing, thread: Some(thread) })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Ends all connections at once.
    pub(crate) fn cut(&self) {
        let _ = self.closing.send(Some(false));
    }

    /// Ends all connections, whose outboxes must be gone by now, in good order if their peers answer.
    pub(crate) fn close(&mut self) {
        let _ = self.closing.send(Some(true));
        if let Some(thread) = self.thread.take() {
            // A panic of the network thread has been printed by itself.
            let _ = thread.join();
        }
    }
}

/// Threads for the connections of a run: a quarter of the cores, eight at most.
fn network_threads() -> usize {
    std::thread::available_parallelism().map_or(1, |cores| (cores.get() / 4).clamp(1, 8))
}

/// What all connections share.
struct ListenerContext {
    options: ListenerOptions,
    acceptor: TlsAcceptor,
    handshaking: Arc<Semaphore>,
    shared: Arc<Shared>,
}

async fn listen(listener: TcpListener, context: Arc<ListenerContext>, mut closed: watch::Receiver<Option<bool>>) {
    let listener = match tokio::net::TcpListener::from_std(listener) {
        Ok(listener) => listener,
        Err(error) => return tracing::error!(%error, "could not listen for agents"),
    };
    let mut connections = tokio::task::JoinSet::new();
    let mut number = 0;
    loop {
        tokio::select! {
            _ = closed.changed() => break,
            // Finished ones are taken out, so that the set does not grow with strangers.
            Some(_) = connections.join_next() => {}
            accepted = async {
                let permit = Arc::clone(&context.handshaking).acquire_owned().await;
                (listener.accept().await, permit)
            } => match accepted {
                (Ok((socket, from)), permit) => {
                    number += 1;
                    connections.spawn(serve_connection(Arc::clone(&context), socket, from, number, permit.ok()));
                }
                (Err(error), _) => {
                    // Too many open files, say: the others go on, and this passes.
                    tracing::warn!(%error, "a connection could not be accepted");
                    tokio::time::sleep(Duration::from_millis(100)).await;
                }
            },
        }
    }
    drop(listener);
    if *closed.borrow() == Some(false) {
        return;
    }
    let _ = timeout(CLOSE_TIMEOUT, async { while connections.join_next().await.is_some() {} }).await;
}

/// One connection from its first byte to its last.
async fn serve_connection(
    context: Arc<ListenerContext>,
    socket: TcpStream,
    from: SocketAddr,
    number: u64,
    handshaking: Option<tokio::sync::OwnedSemaphorePermit>,
) {
    let (shared, options) = (&context.shared, &context.options);
    let refuse_stranger = |reason: String| {
        tracing::warn!(%from, reason, "a stranger was refused");
        shared.figures.count(|figures| figures.strangers_refused += 1);
    };
    let proof = async {
        prepare(&socket, &options.limits).map_err(|error| error.to_string())?;
        let mut stream = context.acceptor.accept(read_ahead(socket)).await.map_err(|error| error.to_string())?;
        match read_message(&mut stream, JOIN_LENGTH).await {
            Ok(Some(bytes)) => unpacked::<Join>(&bytes).map(|join| (stream, join)).map_err(|error| error.to_string()),
            Ok(None) => Err("it said nothing".to_owned()),
            Err(error) => Err(error.to_string()),
        }
    };
    let (mut stream, join) = match timeout(HANDSHAKE_TIMEOUT, proof).await {
        Ok(Ok(proven)) => proven,
        Ok(Err(reason)) => return refuse_stranger(reason),
        Err(_) => return refuse_stranger("it took too long to prove who it is".to_owned()),
    };
    drop(handshaking);
    let refusal = refusal(&join, options);
    let admission = match &refusal {
        Some(reason) => Admission::Refused { reason: reason.clone() },
        None => Admission::Admitted { run: options.run.clone() },
    };
    if refusal.is_some() {
        shared.figures.count(|figures| figures.agents_refused += 1);
    }
    let said = timeout(HANDSHAKE_TIMEOUT, async {
        write_message(&mut stream, &packed(&admission)).await?;
        stream.flush().await
    });
    let said = said.await;
    if let Some(reason) = refusal {
        tracing::warn!(%from, host = join.host, reason, "an agent was refused");
        // It may have gone already; else it closes when it has read why.
        let _ = timeout(HANDSHAKE_TIMEOUT, async {
            let _ = stream.shutdown().await;
            let _ = read_message(&mut stream, JOIN_LENGTH).await;
        })
        .await;
        return;
    }
    if !matches!(said, Ok(Ok(()))) {
        return tracing::warn!(%from, host = join.host, "an agent was gone before it was admitted");
    }
    tracing::info!(%from, host = join.host, "agent joined");
    shared.figures.count(|figures| figures.agents_joined += 1);
    let (outbox, outgoing): (Outbox, UnboundedReceiver<Vec<u8>>) = unbounded_channel();
    let gate = Gate::new();
    let peer = Peer { number, host: join.host, state_bytes: join.state_bytes, outbox, gate: gate.clone() };
    shared.push(Arrival::Opened(peer));
    let deliver = |message| shared.push(Arrival::Message(number, message));
    let reason = pump(stream, outgoing, options.limits, gate, &shared.buffers, deliver).await;
    shared.push(Arrival::Closed(number, reason));
}

/// Why an agent cannot take part, with the remedy.
fn refusal(join: &Join, options: &ListenerOptions) -> Option<String> {
    if join.link != LINK_VERSION || join.protocol != PROTOCOL_VERSION {
        return Some(format!(
            "the agent ({}) speaks versions {} and {}, this run ({}) versions {LINK_VERSION} and {PROTOCOL_VERSION}; start \
             macro and agents from the same build of grainspan",
            join.version,
            join.link,
            join.protocol,
            env!("CARGO_PKG_VERSION")
        ));
    }
    (join.program != options.program).then(|| {
        format!(
            "the agent's program ({}, content {}) is not the one of this run ({}, content {}), and equal results are promised \
             for one binary only; copy the program of the run to the agent's host",
            join.version,
            join.program,
            env!("CARGO_PKG_VERSION"),
            options.program
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_versions_and_builds_are_refused_with_both_named() {
        let options = ListenerOptions {
            run: "test".into(),
            secret: Secret::draw().unwrap(),
            limits: Limits::default(),
            program: "aa".into(),
        };
        let join = Join {
            link: LINK_VERSION,
            protocol: PROTOCOL_VERSION,
            version: "0.0.9".into(),
            program: "aa".into(),
            host: "node7".into(),
            state_bytes: 0,
        };
        assert_eq!(refusal(&join, &options), None);
        let old = refusal(&Join { protocol: PROTOCOL_VERSION - 1, ..join.clone() }, &options).unwrap();
        assert!(old.contains("0.0.9") && old.contains("same build"), "{old}");
        assert!(refusal(&Join { link: LINK_VERSION + 1, ..join.clone() }, &options).is_some());
        let other = refusal(&Join { program: "bb".into(), ..join }, &options).unwrap();
        assert!(other.contains("bb") && other.contains("aa"), "{other}");
    }
}
