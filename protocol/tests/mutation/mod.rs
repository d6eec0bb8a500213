//! Broken messages: sound ones with a few bytes changed, cut, doubled or spliced, from a generator that is fixed by its
//! seed. Shared by the quick test and the long hunt.
#![allow(dead_code, unreachable_pub, reason = "each user compiles its own copy")]

use bytemuck::Zeroable;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::frame::{Frame, FrameKind, HEADER_LENGTH, Outgoing};
use protocol::transport::{LoadedJob, LoadedReply};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, Definition, PROTOCOL_VERSION, RveError, StateId, TangentKind, snapshot};

/// Numbers that break careless arithmetic.
const NASTY: [u64; 10] = [0, 1, 7, 8, 1 << 31, (1 << 32) - 1, 1 << 32, 1 << 63, u64::MAX - 31, u64::MAX];

/// A generator of uniform numbers (splitmix64).
#[derive(Clone, Debug)]
pub struct Dice(pub u64);

impl Dice {
    pub fn draw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// Below `limit`, which is not 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.draw() % limit as u64) as usize
    }
}

/// Sound messages of every kind, both directions, and a sealed snapshot.
pub fn sound() -> Vec<Vec<u8>> {
    let capabilities = Capabilities {
        engine: "grains".into(),
        version: "1".into(),
        dimensions: vec![2, 3],
        tangents: TangentKind::ALL.to_vec(),
        ..Capabilities::default()
    };
    let hello =
        FromWorker::Hello { protocol: PROTOCOL_VERSION, run: "a-1".into(), pid: 7, capabilities, state_cache: 64 };
    let definition = Definition { bytes: vec![5; 40] };
    let mut error = Vec::new();
    error
        .extend(rmp_serde::to_vec(&RveError::TargetTooLarge { norm: 1.0, limit: 0.5 }).expect("errors are writable"));
    let job =
        |number, state: &[u8]| TrialJob { job: number, tangent: 2, state: StateId::of(state), ..TrialJob::zeroed() };
    let (long, short) = (vec![1; 90], vec![2; 8]);
    let jobs = [LoadedJob { job: job(1, &long), state: &long }, LoadedJob { job: job(2, b""), state: b"" }];
    let done = TrialReply { state: StateId::of(&short), ..TrialReply::bare(&jobs[0].job, ReplyStatus::Done) };
    let replies = [
        LoadedReply { reply: done, state: &short, error: b"" },
        LoadedReply { reply: TrialReply::bare(&jobs[1].job, ReplyStatus::Failed), state: b"", error: &error },
    ];
    let mut sealed = Vec::new();
    snapshot::seal("grains", &[3; 50], &mut sealed);
    vec![
        Outgoing::control(&hello).to_vec(9),
        Outgoing::control(&FromWorker::DefinitionRefused { definition: definition.id(), reason: "no".into() })
            .to_vec(9),
        Outgoing::control(&FromWorker::Bye { reason: "tired".into() }).to_vec(9),
        Outgoing::control(&ToWorker::Define { definition }).to_vec(0),
        Outgoing::control(&ToWorker::Welcome { worker: 3 }).to_vec(0),
        Outgoing::Jobs(&jobs).to_vec(0),
        Outgoing::Replies(&replies).to_vec(9),
        Outgoing::Credit.to_vec(9),
        Outgoing::Close.to_vec(9),
        sealed,
    ]
}

/// Breaks a message in one to four places.
pub fn broken(sound: &[Vec<u8>], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = sound[dice.below(sound.len())].clone();
    for _ in 0..=dice.below(4) {
        let place = dice.below(bytes.len().max(1));
        match dice.below(8) {
            0 if !bytes.is_empty() => bytes[place] ^= 1 << dice.below(8),
            1 if !bytes.is_empty() => bytes[place] = dice.draw() as u8,
            2 => bytes.truncate(place),
            3 => bytes.extend(std::iter::repeat_n(dice.draw() as u8, dice.below(300))),
            // A field of eight or four bytes, where fields lie.
            4 | 5 => {
                let nasty = NASTY[dice.below(NASTY.len())].to_le_bytes();
                let width = if dice.below(2) == 0 { 8 } else { 4 };
                let start = place / width * width;
                if let Some(field) = bytes.get_mut(start..start + width) {
                    field.copy_from_slice(&nasty[..width]);
                }
            }
            6 => {
                let other = &sound[dice.below(sound.len())];
                let from = dice.below(other.len());
                bytes.splice(place.min(bytes.len()).., other[from..].iter().copied());
            }
            _ => {
                let end = (place + dice.below(40)).min(bytes.len());
                let doubled = bytes[place.min(end)..end].to_vec();
                bytes.splice(place.min(bytes.len())..place.min(bytes.len()), doubled);
            }
        }
        // Most damage would show in the length alone; often it is made to fit, so that what lies behind is reached.
        if dice.below(3) > 0 && bytes.len() >= HEADER_LENGTH {
            let length = (bytes.len() as u64).to_le_bytes();
            bytes[16..24].copy_from_slice(&length);
        }
    }
    bytes
}

/// Decodes bytes in every way in which a message is decoded; a panic is a finding. What is accepted must be made of the
/// bytes that came.
pub fn decode(bytes: &[u8]) -> bool {
    // Snapshots come as parts of replies and from files.
    let opened = snapshot::open("grains", bytes).is_ok_and(|payload| payload.len() < bytes.len());
    let Ok(frame) = Frame::parse(bytes) else { return opened };
    let jobs = frame.jobs().map(|jobs| jobs.iter().map(|one| size_of::<TrialJob>() + one.state.len()).sum::<usize>());
    let replies = frame.replies();
    let parts = |one: &LoadedReply<'_>| size_of::<TrialReply>() + one.state.len() + one.error.len();
    let length = replies.as_ref().map(|replies| replies.iter().map(parts).sum::<usize>());
    assert!(jobs.is_err() || jobs == Ok(bytes.len() - HEADER_LENGTH), "jobs that are not all of the message");
    assert!(length.is_err() || length == Ok(bytes.len() - HEADER_LENGTH), "replies that are not all of the message");
    for reply in replies.iter().flatten() {
        // What the macro does with a reply before it believes anything in it.
        let _ = (reply.reply.is_finite(), ReplyStatus::from_wire(reply.reply.status), StateId::of(reply.state));
        let _ = rmp_serde::from_slice::<RveError>(reply.error);
    }
    match frame.kind {
        FrameKind::Control => frame.control::<FromWorker>().is_ok() || frame.control::<ToWorker>().is_ok(),
        FrameKind::Jobs => jobs.is_ok(),
        FrameKind::Replies => replies.is_ok(),
        FrameKind::Credit | FrameKind::Close => true,
    }
}
