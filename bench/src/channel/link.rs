//! Ways from one address space to another and back, all under the same load: the payload is written on one side, copied
//! out on the other, written again and read.

use crate::workers::{Echo, HelperProcess, Role, answer_jobs, fresh_name};
use anyhow::{Context, bail};
use bytemuck::Zeroable;
use protocol::control::ToWorker;
use protocol::transport::in_process::{InProcessMacroPort, channel};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, Waiting};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort, WorkerId};
use protocol::wire::TrialJob;
use std::hint::black_box;
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const TIMEOUT: Duration = Duration::from_secs(10);

/// Room for the largest payload and its headers, bytes.
const MESSAGE_BYTES: u64 = 5 << 20;

/// What a socket holds for sure without a reader, bytes.
const SOCKET_BUFFER: usize = 64 << 10;

/// A channel in both directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    /// The channel of a run, between two processes.
    SharedMemory(Waiting),
    /// A stream socket between two processes, both blocking.
    Socket,
    /// The channel of tests, between two threads.
    InProcess,
    /// No channel: the payload is copied there and back by a function.
    Call,
}

impl Channel {
    pub(super) const ALL: [Self; 6] = [
        Self::SharedMemory(Waiting::Block),
        Self::SharedMemory(Waiting::Hybrid),
        Self::SharedMemory(Waiting::Spin),
        Self::Socket,
        Self::InProcess,
        Self::Call,
    ];

    pub(super) fn name(self) -> String {
        match self {
            Self::SharedMemory(waiting) => format!("shared memory, {}", waiting.keyword()),
            Self::Socket => "Unix socket".to_owned(),
            Self::InProcess => "threads".to_owned(),
            Self::Call => "call".to_owned(),
        }
    }

    pub(super) fn open(self) -> anyhow::Result<Box<dyn Link>> {
        Ok(match self {
            Self::SharedMemory(waiting) => Box::new(shared_memory(waiting)?),
            Self::Socket => Box::new(SocketLink::open()?),
            Self::InProcess => Box::new(in_process()?),
            Self::Call => Box::new(CallLink::default()),
        })
    }
}

/// An open channel.
pub(super) trait Link {
    /// Sends a payload.
    fn send(&mut self, payload: &[u8]) -> anyhow::Result<()>;

    /// Waits until payloads have come back and returns how many.
    fn receive(&mut self) -> anyhow::Result<usize>;

    /// How many payloads of this size may be in flight.
    fn depth(&self, _payload: usize) -> usize {
        2
    }
}

/// A macro's port with one worker that echoes.
struct PortLink<P: MacroPort, C> {
    port: P,
    // Dropped after the port: it ends because the port does.
    _helper: C,
}

impl<P: MacroPort, C> PortLink<P, C> {
    fn await_hello(mut self) -> anyhow::Result<Self> {
        let begun = Instant::now();
        let mut joined = false;
        while !joined {
            self.port.poll(TIMEOUT, &mut |event| joined |= matches!(event, MacroEvent::Control(..)))?;
            if begun.elapsed() > TIMEOUT {
                bail!("the other side does not answer");
            }
        }
        Ok(self)
    }
}

impl<P: MacroPort, C> Link for PortLink<P, C> {
    fn send(&mut self, payload: &[u8]) -> anyhow::Result<()> {
        Ok(self.port.send_jobs(WorkerId(0), &[LoadedJob { job: TrialJob::zeroed(), state: payload }])?)
    }

    fn receive(&mut self) -> anyhow::Result<usize> {
        let mut received = 0;
        let begun = Instant::now();
        while received == 0 {
            self.port.poll(TIMEOUT, &mut |event| {
                if let MacroEvent::Replies(_, replies) = event {
                    // The pool copies snapshots out of the channel, too.
                    replies.iter().for_each(|one| drop(black_box(one.state.to_vec())));
                    received += replies.len();
                }
            })?;
            if begun.elapsed() > TIMEOUT {
                bail!("the other side does not answer");
            }
        }
        Ok(received)
    }
}

impl<P: MacroPort, C> Drop for PortLink<P, C> {
    fn drop(&mut self) {
        // Who has gone already needs no farewell.
        let _ = self.port.send_control(WorkerId(0), &ToWorker::Bye);
    }
}

fn shared_memory(waiting: Waiting) -> anyhow::Result<PortLink<SharedMemoryMacroPort, HelperProcess>> {
    let run = fresh_name();
    let limits = ChannelLimits { message_bytes: MESSAGE_BYTES, workers: 2, waiting };
    let port = SharedMemoryMacroPort::create(&run, limits)?;
    let helper = HelperProcess::start(Role::Echo, &run)?;
    PortLink { port, _helper: helper }.await_hello()
}

/// A thread that is waited for.
struct Joined(Option<JoinHandle<()>>);

impl Drop for Joined {
    fn drop(&mut self) {
        let _ = self.0.take().map(JoinHandle::join);
    }
}

fn in_process() -> anyhow::Result<PortLink<InProcessMacroPort, Joined>> {
    let (port, connector) = channel();
    let thread = std::thread::spawn(move || {
        // Its only failure is the end of the link.
        let _ = answer_jobs(&mut connector.join(), "threads");
    });
    PortLink { port, _helper: Joined(Some(thread)) }.await_hello()
}

struct SocketLink {
    echo: Echo,
    path: PathBuf,
    _helper: HelperProcess,
}

impl SocketLink {
    fn open() -> anyhow::Result<Self> {
        let path = std::env::temp_dir().join(fresh_name());
        let listener = UnixListener::bind(&path).with_context(|| format!("no socket at {}", path.display()))?;
        let helper = HelperProcess::start(Role::SocketEcho, path.to_str().context("the path is not UTF-8")?)?;
        let (stream, _) = listener.accept()?;
        Ok(Self { echo: Echo::new(stream), path, _helper: helper })
    }
}

impl Link for SocketLink {
    fn send(&mut self, payload: &[u8]) -> anyhow::Result<()> {
        Ok(self.echo.send(payload)?)
    }

    fn receive(&mut self) -> anyhow::Result<usize> {
        let payload = self.echo.receive()?.context("the other side has closed")?;
        black_box(payload);
        Ok(1)
    }

    /// Beyond the socket's buffer both sides would wait for the other to read.
    fn depth(&self, payload: usize) -> usize {
        if payload > SOCKET_BUFFER { 1 } else { 2 }
    }
}

impl Drop for SocketLink {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Copies the payload out, and back.
#[derive(Default)]
struct CallLink {
    waiting: Vec<Vec<u8>>,
}

impl Link for CallLink {
    fn send(&mut self, payload: &[u8]) -> anyhow::Result<()> {
        self.waiting.push(black_box(payload).to_vec());
        Ok(())
    }

    fn receive(&mut self) -> anyhow::Result<usize> {
        let payload = self.waiting.pop().context("nothing is in flight")?;
        black_box(black_box(&payload).to_vec());
        Ok(1)
    }
}
