//! One connection: socket options, messages with their length in front, and the loop that moves them both ways.

use crate::buffers::Buffers;
use rustix::net::sockopt;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, BufReader, BufWriter};
use tokio::net::TcpStream;
use tokio::sync::Semaphore;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};
use tokio::time::timeout;

/// Where messages for the peer are put. Nothing waits here longer than the windows of the workers allow: the scheduler sends no more.
pub(crate) type Outbox = UnboundedSender<Vec<u8>>;

/// Room for small messages that are ready together, so that they travel in one piece.
const BATCH: usize = 64 << 10;

/// Bytes that are asked of the system at a time. The TLS library alone would ask for 4 kB.
const READ_AHEAD: usize = 64 << 10;

/// Most bytes that are reserved for a message before any of it has come. A stranger's are fewer: what it may say is shorter.
const AT_ONCE: usize = 2 << 20;

/// How long a peer may take to notice that the connection is closed.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// Longest time between two probes that Linux accepts.
const LONGEST_INTERVAL: Duration = Duration::from_secs(32_767);

/// Bytes that wait to be handled before no more are read from a peer, kB.
const BACKLOG: usize = 256 << 10;

/// Limits of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Time without any sign of life of the other host after which the connection counts as lost.
    pub silence: Duration,
    /// Most bytes of one message.
    pub message_bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { silence: Duration::from_secs(10), message_bytes: 64 << 20 }
    }
}

impl Limits {
    /// Longest message on the wire: a frame and its head.
    fn longest(&self) -> usize {
        self.message_bytes.saturating_add(1 << 20)
    }
}

/// Sets what the kernel is to watch: it probes a silent peer and ends the connection when probes or data stay unanswered.
///
/// # Errors
/// The system refuses an option.
pub(crate) fn prepare(socket: &TcpStream, limits: &Limits) -> io::Result<()> {
    let (interval, user_timeout) = kernel_limits(limits.silence);
    sockopt::set_tcp_nodelay(socket, true)?;
    sockopt::set_socket_keepalive(socket, true)?;
    sockopt::set_tcp_keepidle(socket, interval)?;
    sockopt::set_tcp_keepintvl(socket, interval)?;
    sockopt::set_tcp_keepcnt(socket, 3)?;
    sockopt::set_tcp_user_timeout(socket, user_timeout)?;
    Ok(())
}

/// Time between two probes of a silent peer, and how long data may stay unanswered, ms. The kernel refuses longer ones than these.
fn kernel_limits(silence: Duration) -> (Duration, u32) {
    let silence = silence.max(Duration::from_millis(300));
    // The kernel counts in whole seconds; the user timeout, in milliseconds, ends the connection in time whatever the count.
    let interval = (silence / 4).clamp(Duration::from_secs(1), LONGEST_INTERVAL);
    let user_timeout = silence.as_millis().min(i32::MAX as u128);
    (interval, user_timeout as u32)
}

/// What TLS reads from.
pub(crate) type Socket = BufReader<TcpStream>;

/// A socket that is read in large pieces; memory that nothing was read into costs nothing.
pub(crate) fn read_ahead(socket: TcpStream) -> Socket {
    BufReader::with_capacity(READ_AHEAD, socket)
}

/// The next message; `None` when the peer has closed in good order.
///
/// # Errors
/// The connection is broken, or the message longer than `longest`.
pub(crate) async fn read_message(
    stream: &mut (impl AsyncRead + Unpin),
    longest: usize,
) -> io::Result<Option<Vec<u8>>> {
    let Some(length) = read_length(stream, longest).await? else { return Ok(None) };
    read_body(stream, length, &Buffers::none()).await.map(Some)
}

async fn read_length(stream: &mut (impl AsyncRead + Unpin), longest: usize) -> io::Result<Option<usize>> {
    let mut length = [0u8; 4];
    // Only between two messages is the end of the stream one in good order.
    if stream.read(&mut length[..1]).await? == 0 {
        return Ok(None);
    }
    stream.read_exact(&mut length[1..]).await?;
    let length = u32::from_le_bytes(length) as usize;
    if length > longest {
        let text = format!("a message of {length} bytes, more than the {longest} that are allowed");
        return Err(io::Error::new(io::ErrorKind::InvalidData, text));
    }
    Ok(Some(length))
}

async fn read_body(stream: &mut (impl AsyncRead + Unpin), length: usize, buffers: &Buffers) -> io::Result<Vec<u8>> {
    // Beyond this it grows with what arrives: a length alone costs no memory.
    let mut body = buffers.take(length).unwrap_or_else(|| Vec::with_capacity(length.min(AT_ONCE)));
    body.clear();
    let got = stream.take(length as u64).read_to_end(&mut body).await?;
    if got < length { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(body) }
}

/// Writes one message.
///
/// # Errors
/// The connection is broken.
pub(crate) async fn write_message(stream: &mut (impl AsyncWrite + Unpin), message: &[u8]) -> io::Result<()> {
    let length = u32::try_from(message.len()).map_err(|_| io::Error::from(io::ErrorKind::InvalidInput))?;
    stream.write_all(&length.to_le_bytes()).await?;
    stream.write_all(message).await
}

/// Lets a peer send as much as has been handled: taken for a message that arrives, given back when it has been handled.
#[derive(Clone, Debug)]
pub(crate) struct Gate(Arc<Semaphore>);

impl Gate {
    /// An open gate.
    pub(crate) fn new() -> Self {
        Self(Arc::new(Semaphore::new(BACKLOG)))
    }

    fn share(length: usize) -> u32 {
        u32::try_from((length >> 10).clamp(1, BACKLOG)).unwrap_or(u32::MAX)
    }

    /// A message of this length has been handled.
    pub(crate) fn handled(&self, length: usize) {
        self.0.add_permits(Self::share(length) as usize);
    }

    async fn enter(&self, length: usize) {
        if let Ok(permit) = self.0.acquire_many(Self::share(length)).await {
            permit.forget();
        }
    }
}

/// Moves messages until either side closes or the connection breaks; returns why it ended. Ends in good order when all senders of
/// `outbox` are gone: what they had put in is delivered first.
pub(crate) async fn pump<S: AsyncRead + AsyncWrite>(
    stream: S,
    mut outbox: UnboundedReceiver<Vec<u8>>,
    limits: Limits,
    gate: Gate,
    buffers: &Buffers,
    mut deliver: impl FnMut(Vec<u8>),
) -> String {
    let (mut input, output) = tokio::io::split(stream);
    let mut output = BufWriter::with_capacity(BATCH, output);
    let receive = async {
        loop {
            let length = match read_length(&mut input, limits.longest()).await {
                Ok(Some(length)) => length,
                Ok(None) => return "the other side closed the connection".to_owned(),
                Err(error) => return in_words(&error),
            };
            gate.enter(length).await;
            match read_body(&mut input, length, buffers).await {
                Ok(message) => deliver(message),
                Err(error) => return in_words(&error),
            }
        }
    };
    let send = async {
        while let Some(mut message) = outbox.recv().await {
            loop {
                write_message(&mut output, &message).await?;
                buffers.give(message);
                match outbox.try_recv() {
                    Ok(next) => message = next,
                    Err(_) => break,
                }
            }
            output.flush().await?;
        }
        output.shutdown().await
    };
    tokio::pin!(receive, send);
    tokio::select! {
        ended = &mut receive => ended,
        sent = &mut send => match sent {
            // Unread bytes of the peer would make the system reset the connection, and the peer lose our last words.
            Ok(()) => timeout(CLOSE_TIMEOUT, receive).await.unwrap_or_else(|_| "closed".to_owned()),
            // What the peer had sent before it ended may still be there.
            Err(error) => timeout(CLOSE_TIMEOUT, receive).await.unwrap_or_else(|_| in_words(&error)),
        },
    }
}

/// What the system says, for people who run clusters.
fn in_words(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::TimedOut => "the other host has not answered in time".to_owned(),
        io::ErrorKind::ConnectionReset | io::ErrorKind::BrokenPipe => {
            "the process at the other end has ended".to_owned()
        }
        io::ErrorKind::UnexpectedEof => "the connection ended in the middle of a message".to_owned(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_silence_becomes_limits_that_the_kernel_accepts() {
        let seconds = Duration::from_secs;
        assert_eq!(kernel_limits(seconds(10)), (Duration::from_millis(2500), 10_000));
        assert_eq!(kernel_limits(Duration::ZERO), (seconds(1), 300));
        assert_eq!(kernel_limits(seconds(40 * 3600)), (LONGEST_INTERVAL, 144_000_000));
        assert_eq!(kernel_limits(Duration::MAX), (LONGEST_INTERVAL, i32::MAX as u32));
    }
}
