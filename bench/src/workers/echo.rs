//! The other end of a round trip: takes the bytes out of the channel, as a worker does, and sends them back.

use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedReply, WorkerEvent, WorkerPort};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, PROTOCOL_VERSION};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// Marks a socket message: its length.
type Length = [u8; 8];

/// Answers every job with its own snapshot until the macro is gone.
///
/// # Errors
/// The channel breaks.
pub(crate) fn answer_jobs(port: &mut dyn WorkerPort, run: &str) -> anyhow::Result<()> {
    let capabilities = Capabilities { engine: "echo".into(), version: "1".into(), ..Capabilities::default() };
    port.send_control(&FromWorker::Hello {
        protocol: PROTOCOL_VERSION,
        run: run.to_owned(),
        pid: std::process::id(),
        capabilities,
        state_cache: 0,
    })?;
    let mut left = false;
    let mut queue: Vec<(TrialJob, Vec<u8>)> = Vec::new();
    while !left {
        port.poll(Duration::from_secs(60), &mut |event| match event {
            WorkerEvent::Jobs(jobs) => queue.extend(jobs.iter().map(|one| (one.job, one.state.to_vec()))),
            WorkerEvent::Control(ToWorker::Bye) | WorkerEvent::MacroLost(_) => left = true,
            WorkerEvent::Control(_) => {}
        })?;
        for (job, state) in queue.drain(..) {
            let reply = TrialReply::bare(&job, ReplyStatus::Done);
            port.send_replies(&[LoadedReply { reply, state: &state, error: b"" }])?;
        }
    }
    Ok(())
}

/// One end of a socket that carries messages with their length in front.
pub(crate) struct Echo {
    stream: UnixStream,
    buffer: Vec<u8>,
}

impl Echo {
    pub(crate) fn new(stream: UnixStream) -> Self {
        Self { stream, buffer: Vec::new() }
    }

    /// Sends one message.
    ///
    /// # Errors
    /// The socket breaks.
    pub(crate) fn send(&mut self, payload: &[u8]) -> std::io::Result<()> {
        let length: Length = (payload.len() as u64).to_le_bytes();
        self.stream.write_all(&length)?;
        self.stream.write_all(payload)
    }

    /// Waits for one message; none when the other end has closed.
    ///
    /// # Errors
    /// The socket breaks.
    pub(crate) fn receive(&mut self) -> std::io::Result<Option<&[u8]>> {
        let mut length = Length::default();
        match self.stream.read_exact(&mut length) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
            outcome => outcome?,
        }
        let length = usize::try_from(u64::from_le_bytes(length)).map_err(std::io::Error::other)?;
        self.buffer.resize(length, 0);
        self.stream.read_exact(&mut self.buffer)?;
        Ok(Some(&self.buffer))
    }
}

/// Returns every message until the other end closes.
///
/// # Errors
/// There is no such socket, or it breaks.
pub(super) fn answer_socket(path: &str) -> anyhow::Result<()> {
    let mut echo = Echo::new(UnixStream::connect(path)?);
    while let Some(payload) = echo.receive()? {
        let payload = payload.to_vec();
        echo.send(&payload)?;
    }
    Ok(())
}
