//! How one message lies in memory: a fixed header, then an array of jobs or replies with their snapshots, or MessagePack.
//!
//! Both transports carry the same frames, so a malformed message is refused by the same code on either. Decoding never
//! panics and never reads outside the given bytes: the sender is another process and may be broken.

use super::{LoadedJob, LoadedReply, TransportError};
use crate::PROTOCOL_VERSION;
use crate::wire::{TrialJob, TrialReply};
use bytemuck::{Pod, Zeroable};
use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// First word of every frame, `GSFR` in ASCII.
pub(crate) const MAGIC: u32 = u32::from_le_bytes(*b"GSFR");

/// What a frame holds behind its header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum FrameKind {
    /// A control message in MessagePack.
    Control = 1,
    /// An array of [`TrialJob`], then the snapshots they carry, in order.
    Jobs = 2,
    /// An array of [`TrialReply`], then for each its snapshot and its error text, in order.
    Replies = 3,
    /// Nothing: a worker's permission to send it one more frame.
    Credit = 4,
    /// Nothing: the sender closes its port and says no more.
    Close = 5,
}

impl FrameKind {
    fn from_wire(number: u32) -> Option<Self> {
        [Self::Control, Self::Jobs, Self::Replies, Self::Credit, Self::Close]
            .into_iter()
            .find(|kind| *kind as u32 == number)
    }
}

/// The start of every frame.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct FrameHeader {
    /// [`MAGIC`].
    pub(crate) magic: u32,
    /// [`PROTOCOL_VERSION`] of the sender.
    pub(crate) version: u32,
    /// [`FrameKind`] as number.
    pub(crate) kind: u32,
    /// Number of array elements; 0 for control messages.
    pub(crate) count: u32,
    /// Length of the whole frame, bytes.
    pub(crate) length: u64,
    /// Who sends: a number that the sending port drew when it was opened, 0 from the macro.
    pub sender: u64,
}

/// Length of [`FrameHeader`], bytes.
pub const HEADER_LENGTH: usize = size_of::<FrameHeader>();

/// Why bytes are not a frame.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FrameError {
    /// Fewer bytes than a header.
    #[error("a message of {0} bytes is shorter than its header")]
    Short(usize),
    /// The first word is wrong.
    #[error("a message does not begin with the mark of this protocol")]
    Magic,
    /// The sender speaks another version.
    #[error("a message of protocol version {found}, but this program speaks version {PROTOCOL_VERSION}")]
    Version {
        /// Version of the sender.
        found: u32,
    },
    /// The kind is unknown or not expected in this direction.
    #[error("a message of unknown kind {0}")]
    Kind(u32),
    /// The lengths inside do not add up to the length of the message.
    #[error("a message whose parts do not add up to its {0} bytes")]
    Length(usize),
    /// Jobs or replies without a single one: nobody sends such, so something was lost on the way.
    #[error("a message of jobs or replies that holds none")]
    Empty,
    /// The control message cannot be read.
    #[error("a control message that cannot be read: {0}")]
    Control(String),
}

/// A frame whose header has been checked; `body` may still be malformed.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Kind of the body.
    pub kind: FrameKind,
    /// See [`FrameHeader::sender`].
    pub sender: u64,
    count: usize,
    body: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Checks the header of `bytes`. Bytes beyond the frame's own length are not allowed.
    ///
    /// # Errors
    /// See [`FrameError`].
    pub fn parse(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let (head, body) = bytes.split_at_checked(HEADER_LENGTH).ok_or(FrameError::Short(bytes.len()))?;
        let header: FrameHeader = bytemuck::pod_read_unaligned(head);
        if header.magic != MAGIC {
            return Err(FrameError::Magic);
        }
        if header.version != PROTOCOL_VERSION {
            return Err(FrameError::Version { found: header.version });
        }
        let kind = FrameKind::from_wire(header.kind).ok_or(FrameError::Kind(header.kind))?;
        if header.length != bytes.len() as u64 {
            return Err(FrameError::Length(bytes.len()));
        }
        Ok(Self { kind, sender: header.sender, count: header.count as usize, body })
    }

    /// Who sends a frame of another version: the header is the same in all of them.
    pub fn sender_of_stranger(bytes: &[u8]) -> Option<u64> {
        let header: FrameHeader = bytemuck::pod_read_unaligned(bytes.get(..HEADER_LENGTH)?);
        (header.magic == MAGIC && header.version != PROTOCOL_VERSION).then_some(header.sender)
    }

    /// The control message inside.
    ///
    /// # Errors
    /// [`FrameError::Control`].
    pub fn control<T: DeserializeOwned>(&self) -> Result<T, FrameError> {
        rmp_serde::from_slice(self.body).map_err(|error| FrameError::Control(error.to_string()))
    }

    /// The jobs inside, with their snapshots.
    ///
    /// # Errors
    /// [`FrameError::Length`], [`FrameError::Empty`].
    pub fn jobs(&self) -> Result<Vec<LoadedJob<'a>>, FrameError> {
        let (jobs, mut tail) = self.array::<TrialJob>()?;
        let loaded = jobs
            .map(|job| Ok(LoadedJob { job, state: self.take(&mut tail, job.state_length)? }))
            .collect::<Result<Vec<_>, FrameError>>()?;
        self.nothing_left(tail).map(|()| loaded)
    }

    /// The replies inside, with their snapshots and error texts.
    ///
    /// # Errors
    /// [`FrameError::Length`], [`FrameError::Empty`].
    pub fn replies(&self) -> Result<Vec<LoadedReply<'a>>, FrameError> {
        let (replies, mut tail) = self.array::<TrialReply>()?;
        let loaded = replies
            .map(|reply| {
                let state = self.take(&mut tail, reply.state_length)?;
                let error = self.take(&mut tail, reply.error_length)?;
                Ok(LoadedReply { reply, state, error })
            })
            .collect::<Result<Vec<_>, FrameError>>()?;
        self.nothing_left(tail).map(|()| loaded)
    }

    /// The array at the start of the body and the bytes behind it.
    fn array<T: Pod>(&self) -> Result<(impl Iterator<Item = T> + 'a, &'a [u8]), FrameError> {
        if self.count == 0 {
            return Err(FrameError::Empty);
        }
        let length = self.count.checked_mul(size_of::<T>()).ok_or(self.malformed())?;
        let (array, tail) = self.body.split_at_checked(length).ok_or(self.malformed())?;
        Ok((array.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned), tail))
    }

    fn take(&self, tail: &mut &'a [u8], length: u64) -> Result<&'a [u8], FrameError> {
        let length = usize::try_from(length).map_err(|_| self.malformed())?;
        let (part, rest) = tail.split_at_checked(length).ok_or(self.malformed())?;
        *tail = rest;
        Ok(part)
    }

    fn nothing_left(&self, tail: &[u8]) -> Result<(), FrameError> {
        if tail.is_empty() { Ok(()) } else { Err(self.malformed()) }
    }

    fn malformed(&self) -> FrameError {
        FrameError::Length(HEADER_LENGTH + self.body.len())
    }
}

/// A message about to be written into loaned memory.
#[derive(Debug)]
pub enum Outgoing<'a> {
    /// MessagePack of a control message.
    Control(Vec<u8>),
    /// A job slice.
    Jobs(&'a [LoadedJob<'a>]),
    /// Answers.
    Replies(&'a [LoadedReply<'a>]),
    /// A credit.
    Credit,
    /// A farewell of the port.
    Close,
}

impl<'a> Outgoing<'a> {
    /// A control message, encoded.
    pub fn control<T: Serialize>(message: &T) -> Self {
        Self::Control(rmp_serde::to_vec(message).expect("control messages have no unserialisable parts"))
    }

    /// Length of the frame, bytes.
    pub fn length(&self) -> usize {
        HEADER_LENGTH
            + match self {
                Self::Control(bytes) => bytes.len(),
                Self::Jobs(jobs) => jobs.iter().map(|job| size_of::<TrialJob>() + job.state.len()).sum(),
                Self::Replies(replies) => {
                    replies.iter().map(|reply| size_of::<TrialReply>() + reply.state.len() + reply.error.len()).sum()
                }
                Self::Credit | Self::Close => 0,
            }
    }

    /// The length, if it fits a channel of `limit` bytes.
    ///
    /// # Errors
    /// [`TransportError::TooLarge`].
    pub fn length_within(&self, limit: usize) -> Result<usize, TransportError> {
        let size = self.length();
        if size > limit { Err(TransportError::TooLarge { size, limit }) } else { Ok(size) }
    }

    /// Writes the frame into `out`, whose length is [`Outgoing::length`]. Lengths inside jobs and
    /// replies, and the checksums of replies, are set here.
    pub fn write(&self, sender: u64, out: &mut [u8]) {
        let (kind, count) = match self {
            Self::Control(_) => (FrameKind::Control, 0),
            Self::Jobs(jobs) => (FrameKind::Jobs, jobs.len()),
            Self::Replies(replies) => (FrameKind::Replies, replies.len()),
            Self::Credit => (FrameKind::Credit, 0),
            Self::Close => (FrameKind::Close, 0),
        };
        let header = FrameHeader {
            magic: MAGIC,
            version: PROTOCOL_VERSION,
            kind: kind as u32,
            count: u32::try_from(count).expect("a slice of fewer than 2^32 jobs"),
            length: out.len() as u64,
            sender,
        };
        let mut cursor = Cursor { out, at: 0 };
        cursor.put(bytemuck::bytes_of(&header));
        match self {
            Self::Control(bytes) => cursor.put(bytes),
            Self::Jobs(jobs) => {
                for loaded in *jobs {
                    let job = TrialJob { state_length: loaded.state.len() as u64, ..loaded.job };
                    cursor.put(bytemuck::bytes_of(&job));
                }
                jobs.iter().for_each(|loaded| cursor.put(loaded.state));
            }
            Self::Replies(replies) => {
                for loaded in *replies {
                    let reply = TrialReply {
                        state_length: loaded.state.len() as u64,
                        error_length: loaded.error.len() as u64,
                        ..loaded.reply
                    };
                    cursor.put(bytemuck::bytes_of(&reply.seal(loaded.error)));
                }
                for loaded in *replies {
                    cursor.put(loaded.state);
                    cursor.put(loaded.error);
                }
            }
            Self::Credit | Self::Close => {}
        }
    }

    /// The frame as a vector of its own.
    pub fn to_vec(&self, sender: u64) -> Vec<u8> {
        let mut bytes = vec![0; self.length()];
        self.write(sender, &mut bytes);
        bytes
    }
}

struct Cursor<'a> {
    out: &'a mut [u8],
    at: usize,
}

impl Cursor<'_> {
    fn put(&mut self, bytes: &[u8]) {
        self.out[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        self.at += bytes.len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ToWorker;
    use crate::wire::ReplyStatus;
    use proptest::prelude::*;

    #[test]
    fn jobs_and_replies_survive_the_frame_with_their_snapshots() {
        let job = TrialJob { job: 7, ..TrialJob::zeroed() };
        let jobs = [LoadedJob { job, state: b"abc" }, LoadedJob { job, state: b"" }];
        let bytes = Outgoing::Jobs(&jobs).to_vec(5);
        let frame = Frame::parse(&bytes).unwrap();
        assert_eq!((frame.kind, frame.sender), (FrameKind::Jobs, 5));
        let back = frame.jobs().unwrap();
        assert_eq!((back[0].state, back[1].state, back[1].job.job), (&b"abc"[..], &b""[..], 7));

        let replies = [
            LoadedReply { reply: TrialReply::bare(&job, ReplyStatus::Failed), state: b"", error: b"why" },
            LoadedReply { reply: TrialReply::bare(&job, ReplyStatus::Done), state: b"state", error: b"" },
        ];
        let bytes = Outgoing::Replies(&replies).to_vec(1);
        let back = Frame::parse(&bytes).unwrap().replies().unwrap();
        assert_eq!((back[0].error, back[1].state), (&b"why"[..], &b"state"[..]));
        assert_eq!(back[1].reply.status, ReplyStatus::Done as u32);
    }

    /// Found by the hunt for broken replies: cut down to its header, a message said nothing and was not counted.
    #[test]
    fn a_message_that_holds_nothing_is_refused() {
        for outgoing in [Outgoing::Replies(&[]), Outgoing::Jobs(&[])] {
            let bytes = outgoing.to_vec(1);
            let frame = Frame::parse(&bytes).unwrap();
            assert_eq!(frame.replies().map(|_| ()), Err(FrameError::Empty));
            assert_eq!(frame.jobs().map(|_| ()), Err(FrameError::Empty));
        }
    }

    #[test]
    fn truncated_and_foreign_frames_are_refused() {
        let bytes = Outgoing::control(&ToWorker::Drain).to_vec(0);
        assert_eq!(Frame::parse(&bytes[..10]).unwrap_err(), FrameError::Short(10));
        assert_eq!(Frame::parse(&bytes[..bytes.len() - 1]).unwrap_err(), FrameError::Length(bytes.len() - 1));
        let mut other = bytes.clone();
        other[0] ^= 1;
        assert_eq!(Frame::parse(&other).unwrap_err(), FrameError::Magic);
        let mut other = bytes.clone();
        other[4] = 99;
        assert_eq!(Frame::parse(&other).unwrap_err(), FrameError::Version { found: 99 });
        let mut other = bytes;
        other[8] = 77;
        assert_eq!(Frame::parse(&other).unwrap_err(), FrameError::Kind(77));
    }

    /// Reads a frame in every way and reports whether any way accepted it.
    fn accepts(bytes: &[u8]) -> bool {
        Frame::parse(bytes).is_ok_and(|frame| {
            let control = frame.control::<ToWorker>().is_ok();
            control | frame.jobs().is_ok() | frame.replies().is_ok()
        })
    }

    proptest! {
        #[test]
        fn random_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..3000)) {
            prop_assert!(!accepts(&bytes));
        }

        /// A sound header in front of noise: lengths inside the noise must never lead outside the bytes.
        #[test]
        fn noise_behind_a_sound_header_never_panics(
            noise in proptest::collection::vec(any::<u8>(), 0..3000), kind in 1u32..4, count in any::<u32>(),
        ) {
            let length = (HEADER_LENGTH + noise.len()) as u64;
            let header = FrameHeader { magic: MAGIC, version: PROTOCOL_VERSION, kind, count, length, sender: 0 };
            let mut bytes = bytemuck::bytes_of(&header).to_vec();
            bytes.extend_from_slice(&noise);
            let frame = Frame::parse(&bytes).unwrap();
            let fits = |size: usize| (count as usize).saturating_mul(size) <= noise.len();
            prop_assert!(fits(size_of::<TrialJob>()) || frame.jobs().is_err());
            prop_assert!(fits(size_of::<TrialReply>()) || frame.replies().is_err());
            let _ = frame.control::<ToWorker>();
        }
    }
}
