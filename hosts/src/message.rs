//! Messages between the macro's listener and an agent.
//!
//! On the connection a message is its length (u32, little endian) and that many bytes: a kind, the number of the worker that it is
//! about, and a body. Bodies are frames of the protocol between macro and workers, unchanged, or MessagePack.

use crate::buffers::Buffers;
use protocol::StateId;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

/// Version of what is said between listener and agent; the frames inside have the version of the protocol.
pub const LINK_VERSION: u32 = 1;

/// First message of an agent. Its fields are named on the wire, so that any version can read the version of any other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Join {
    /// [`LINK_VERSION`].
    pub(crate) link: u32,
    /// [`protocol::PROTOCOL_VERSION`].
    pub(crate) protocol: u32,
    /// Version of the program, for people.
    #[serde(default)]
    pub(crate) version: String,
    /// [`crate::this_program`].
    #[serde(default)]
    pub(crate) program: String,
    /// Name of the host, for people.
    #[serde(default)]
    pub(crate) host: String,
    /// Bytes of states that the agent will keep for its workers.
    #[serde(default)]
    pub(crate) state_bytes: u64,
}

/// Answer to [`Join`]; named fields as there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Admission {
    /// Workers of the agent may say hello.
    Admitted {
        /// Name of the run, for their hellos.
        run: String,
    },
    /// The agent cannot take part.
    Refused {
        /// Why, with the remedy.
        reason: String,
    },
}

/// From the macro about the agent as a whole.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ToAgent {
    /// End this worker.
    Kill,
    /// Forget these states, unless a reply with number above `heard` has brought them again.
    Forget {
        /// The states.
        states: Vec<StateId>,
        /// Number of messages of the agent that the macro had handled.
        heard: u64,
    },
    /// The run has ended.
    Farewell {
        /// For the log.
        reason: String,
    },
}

/// From the agent.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum FromAgent {
    /// This worker's process has ended.
    WorkerLost {
        /// Why.
        reason: String,
    },
    /// The agent leaves on its own will, and all its workers with it.
    Leave {
        /// Why.
        reason: String,
    },
}

/// A message as it lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Body<'a> {
    /// Of a worker or for it: a frame of the protocol.
    Frame(&'a [u8]),
    /// Jobs for a worker; those at these places start from states that the agent has kept.
    Jobs {
        /// Places in the slice, little-endian u32 each.
        kept: &'a [u8],
        /// The frame.
        frame: &'a [u8],
    },
    /// MessagePack.
    Control(&'a [u8]),
}

/// Kind and number of the worker.
const HEAD: usize = 8;

const FRAME: u32 = 1;
const JOBS: u32 = 2;
const CONTROL: u32 = 3;

/// Why bytes are not a message.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub(crate) enum MessageError {
    /// Cut or too short.
    #[error("a message between hosts of {0} bytes whose parts do not add up")]
    Length(usize),
    /// Unknown kind.
    #[error("a message between hosts of unknown kind {0}")]
    Kind(u32),
    /// The body cannot be read.
    #[error("a message between hosts that cannot be read: {0}")]
    Control(String),
}

impl<'a> Body<'a> {
    /// Reads a message: the worker and the body.
    ///
    /// # Errors
    /// [`MessageError`].
    pub(crate) fn parse(bytes: &'a [u8]) -> Result<(u32, Self), MessageError> {
        let cut = || MessageError::Length(bytes.len());
        let word = |at: usize| {
            let part = bytes.get(at..at + 4).and_then(|part| part.try_into().ok());
            part.map(u32::from_le_bytes).ok_or_else(cut)
        };
        let (kind, slot) = (word(0)?, word(4)?);
        let body = &bytes[HEAD..];
        let body = match kind {
            FRAME => Self::Frame(body),
            CONTROL => Self::Control(body),
            JOBS => {
                let length = (word(HEAD)? as usize).checked_mul(4).ok_or_else(cut)?;
                let (kept, frame) = body[4..].split_at_checked(length).ok_or_else(cut)?;
                Self::Jobs { kept, frame }
            }
            other => return Err(MessageError::Kind(other)),
        };
        Ok((slot, body))
    }
}

/// A frame with its head, made by `fill` in place, in used memory if there is some.
pub(crate) fn with_frame(slot: u32, length: usize, buffers: &Buffers, fill: impl FnOnce(&mut [u8])) -> Vec<u8> {
    let mut bytes = buffers.take(HEAD + length).unwrap_or_default();
    // What an earlier message left there is overwritten, all of it.
    bytes.resize(HEAD + length, 0);
    bytes[..4].copy_from_slice(&FRAME.to_le_bytes());
    bytes[4..HEAD].copy_from_slice(&slot.to_le_bytes());
    fill(&mut bytes[HEAD..]);
    bytes
}

/// Jobs of which some start from states that the agent has.
pub(crate) fn with_jobs(slot: u32, kept: &[u32], length: usize, fill: impl FnOnce(&mut [u8])) -> Vec<u8> {
    let before = HEAD + 4 + 4 * kept.len();
    let mut bytes = head(JOBS, slot, before + length);
    bytes.extend_from_slice(&(kept.len() as u32).to_le_bytes());
    kept.iter().for_each(|place| bytes.extend_from_slice(&place.to_le_bytes()));
    bytes.resize(before + length, 0);
    fill(&mut bytes[before..]);
    bytes
}

/// A control message.
pub(crate) fn with_control<T: Serialize>(slot: u32, message: &T) -> Vec<u8> {
    let mut bytes = head(CONTROL, slot, HEAD);
    bytes.extend(packed(message));
    bytes
}

fn head(kind: u32, slot: u32, capacity: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(capacity);
    bytes.extend_from_slice(&kind.to_le_bytes());
    bytes.extend_from_slice(&slot.to_le_bytes());
    bytes
}

/// MessagePack with named fields.
pub(crate) fn packed<T: Serialize>(message: &T) -> Vec<u8> {
    // Plain structs of numbers and texts have no part that cannot be written.
    rmp_serde::to_vec_named(message).expect("writing MessagePack to memory cannot fail")
}

/// The opposite of [`packed`].
///
/// # Errors
/// [`MessageError::Control`].
pub(crate) fn unpacked<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, MessageError> {
    rmp_serde::from_slice(bytes).map_err(|error| MessageError::Control(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_survive_and_broken_ones_are_refused() {
        let bytes = with_jobs(7, &[0, 5], 3, |out| out.copy_from_slice(b"abc"));
        let kept = [0u32.to_le_bytes(), 5u32.to_le_bytes()].concat();
        assert_eq!(Body::parse(&bytes), Ok((7, Body::Jobs { kept: &kept, frame: b"abc" })));
        for length in 0..bytes.len() - 3 {
            assert!(Body::parse(&bytes[..length]).is_err(), "{length} bytes");
        }
        let bytes = with_control(2, &ToAgent::Kill);
        let Ok((2, Body::Control(body))) = Body::parse(&bytes) else { panic!("{bytes:?}") };
        assert_eq!(unpacked::<ToAgent>(body), Ok(ToAgent::Kill));
        assert!(unpacked::<FromAgent>(body).is_err());
        let mut wild = head(JOBS, 0, 12);
        wild.extend_from_slice(&u32::MAX.to_le_bytes());
        assert!(Body::parse(&wild).is_err());
        assert_eq!(Body::parse(&[9, 0, 0, 0, 0, 0, 0, 0]), Err(MessageError::Kind(9)));
    }

    #[test]
    fn nothing_of_the_message_before_is_left_in_used_memory() {
        let buffers = Buffers::new();
        for (slot, length) in [(1, 40_000), (2, 20_000), (3, 30_000)] {
            let bytes = with_frame(slot, length, &buffers, |out| out.fill(slot as u8));
            let expected = vec![slot as u8; length];
            assert_eq!(Body::parse(&bytes), Ok((slot, Body::Frame(&expected))));
            buffers.give(bytes);
        }
    }

    #[test]
    fn a_join_of_a_later_version_can_still_be_read() {
        #[derive(Serialize)]
        struct Later {
            news: [u8; 3],
            link: u32,
            protocol: u32,
        }
        let join: Join = unpacked(&packed(&Later { news: [1, 2, 3], link: 9, protocol: 8 })).unwrap();
        assert_eq!((join.link, join.protocol, join.program.as_str()), (9, 8, ""));
    }
}
