//! Fixed-layout messages that are loaned in shared memory: jobs and replies.
//!
//! No pointers, no `usize`, no `bool`, explicit padding. A **job slice** holds one or more trials so that a worker may
//! solve several RVEs side by side. In a message, the array of [`TrialJob`] is followed by the snapshots it carries,
//! in job order; likewise [`TrialReply`] by snapshots and error texts.

use crate::identity::{DefinitionId, StateId};
use crate::observed::{Observables, Observed};
use crate::rve_error::RveError;
use crate::tangent_kind::TangentKind;
use crate::tensor::{Tensor2, Tensor4};
use crate::trial::{Cost, Scalars, TrialFlags, TrialOptions, TrialResult};
use bytemuck::{Pod, Zeroable};
use xxhash_rust::xxh3::Xxh3;

/// One trial to be done.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrialJob {
    /// Unique within a run; a re-issued job keeps it.
    pub job: u64,
    /// Gauss point, for logs and error texts.
    pub point: u64,
    /// What RVE this is.
    pub definition: DefinitionId,
    /// Committed state to start from; [`StateId::NONE`] is the definition's initial state.
    pub state: StateId,
    /// Total target `H = F - I` from the committed state.
    pub target: Tensor2,
    /// [`TangentKind`] as number.
    pub tangent: u32,
    /// [`TrialOptions::ramp_steps`].
    pub ramp_steps: u32,
    /// [`Observables`] bits.
    pub observables: u32,
    /// 0 on first issue, then counted up. Not part of what is computed: the answer does not depend on it.
    pub attempt: u32,
    /// Length of the snapshot carried for `state`; 0 when the worker is believed to hold it.
    pub state_length: u64,
    /// [`TrialOptions::friction_reduction`].
    pub friction_reduction: f64,
}

impl TrialJob {
    /// The options of the trial.
    ///
    /// # Errors
    /// An unknown tangent kind.
    pub fn options(&self) -> Result<TrialOptions, RveError> {
        let tangent = TangentKind::from_wire(self.tangent)
            .ok_or_else(|| RveError::Unsupported(format!("tangent kind number {}", self.tangent)))?;
        Ok(TrialOptions {
            tangent,
            ramp_steps: self.ramp_steps,
            observables: Observables(self.observables),
            friction_reduction: self.friction_reduction,
        })
    }
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ReplyStatus {
    /// Stress and everything asked for are valid.
    Done = 0,
    /// The engine refused or failed; the text says why.
    Failed = 1,
    /// The worker no longer holds the state; send the job again with its snapshot.
    NeedState = 2,
    /// The worker does not know the definition; send it, then the job again.
    NeedDefinition = 3,
}

impl ReplyStatus {
    /// The status with this wire number.
    pub fn from_wire(number: u32) -> Option<Self> {
        [Self::Done, Self::Failed, Self::NeedState, Self::NeedDefinition]
            .into_iter()
            .find(|status| *status as u32 == number)
    }
}

/// The answer to one [`TrialJob`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrialReply {
    /// The job answered.
    pub job: u64,
    /// Its Gauss point.
    pub point: u64,
    /// Identity of the trial state; its snapshot follows when `state_length > 0`.
    pub state: StateId,
    /// [`ReplyStatus`] as number.
    pub status: u32,
    /// [`TrialFlags`] bits.
    pub flags: u32,
    /// [`TangentKind`] delivered, as number; `None` if no tangent was asked for.
    pub tangent_kind: u32,
    /// Trials that were solved again to rebuild the committed state: work of an engine whose states are paths.
    pub replayed: u32,
    /// Length of the trial state's snapshot behind the replies.
    pub state_length: u64,
    /// Length of the error text (an [`RveError`] in MessagePack) behind the snapshot.
    pub error_length: u64,
    /// Time the worker spent outside the solver on this job (restore, snapshot, hashing), ns.
    pub overhead_nanoseconds: u64,
    /// See [`TrialReply::seal`].
    pub checksum: u64,
    /// What it cost.
    pub cost: Cost,
    /// Cheap scalars.
    pub scalars: Scalars,
    /// Optional results.
    pub observed: Observed,
    /// Cauchy stress, Pa, tension positive.
    pub stress: Tensor2,
    /// Tangent, Pa.
    pub tangent: Tensor4,
}

impl TrialReply {
    /// An empty reply to `job` with a status and nothing else.
    pub fn bare(job: &TrialJob, status: ReplyStatus) -> Self {
        Self { job: job.job, point: job.point, status: status as u32, ..Self::zeroed() }
    }

    /// Packs an engine's answer.
    pub fn done(job: &TrialJob, answer: &TrialResult, state: StateId, state_length: u64) -> Self {
        Self {
            state,
            state_length,
            flags: answer.flags.0,
            tangent_kind: if answer.tangent.is_some() { job.tangent } else { TangentKind::None as u32 },
            cost: answer.cost,
            scalars: answer.scalars,
            observed: answer.observed,
            stress: answer.stress,
            tangent: answer.tangent.as_deref().copied().unwrap_or(Tensor4::ZERO),
            ..Self::bare(job, ReplyStatus::Done)
        }
    }

    /// Writes the checksum; done by the port that sends, when everything else stands. `error` is the error text behind
    /// the reply. The snapshot needs none: its name is the hash of its content.
    #[must_use]
    pub fn seal(self, error: &[u8]) -> Self {
        Self { checksum: self.sum(error), ..self }
    }

    /// Whether nothing has changed in the reply and its error text since they were sealed. Guards against damage between
    /// two processes, such as a stray write of an engine into the channel, not against a worker that means harm.
    pub fn is_sealed(&self, error: &[u8]) -> bool {
        self.checksum == self.sum(error)
    }

    /// XXH3 (64 bit) of the record with a checksum of 0, followed by the error text.
    fn sum(&self, error: &[u8]) -> u64 {
        let blank = Self { checksum: 0, ..*self };
        let mut hash = Xxh3::new();
        hash.update(bytemuck::bytes_of(&blank));
        hash.update(error);
        hash.digest()
    }

    /// The engine's answer, unpacked.
    pub fn answer(&self) -> TrialResult {
        TrialResult {
            stress: self.stress,
            tangent: (self.tangent_kind != TangentKind::None as u32).then(|| Box::new(self.tangent)),
            scalars: self.scalars,
            observed: self.observed,
            cost: self.cost,
            flags: TrialFlags(self.flags),
        }
    }

    /// Whether every number in it is finite: the check at the process border.
    pub fn is_finite(&self) -> bool {
        let scalars: &[f64] = bytemuck::cast_slice(std::slice::from_ref(&self.scalars));
        let observed: &[f64] = bytemuck::cast_slice(std::slice::from_ref(&self.observed));
        self.stress.is_finite()
            && self.tangent.is_finite()
            && scalars.iter().chain(observed).all(|value| value.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The layout is a contract with engines in other languages: a change needs a new protocol version.
    #[test]
    fn layout_of_wire_types_is_fixed() {
        assert_eq!(size_of::<TrialJob>(), 152);
        assert_eq!(size_of::<TrialReply>(), 1088);
        assert_eq!(std::mem::offset_of!(TrialJob, target), 48);
        assert_eq!(std::mem::offset_of!(TrialReply, stress), 368);
        assert_eq!(std::mem::offset_of!(TrialReply, tangent), 440);
    }

    #[test]
    fn every_changed_bit_of_a_reply_and_its_error_breaks_the_seal() {
        let mut reply = TrialReply::bare(&TrialJob::zeroed(), ReplyStatus::Failed);
        reply.stress.0[3] = -1e5;
        let reply = reply.seal(b"why");
        assert!(reply.is_sealed(b"why") && !reply.is_sealed(b"whx"));
        for bit in 0..8 * size_of::<TrialReply>() {
            let mut changed = reply;
            bytemuck::bytes_of_mut(&mut changed)[bit / 8] ^= 1 << (bit % 8);
            assert!(!changed.is_sealed(b"why"), "bit {bit}");
        }
    }

    #[test]
    fn non_finite_numbers_are_caught_wherever_they_hide() {
        let job = TrialJob::zeroed();
        let mut reply = TrialReply::bare(&job, ReplyStatus::Done);
        assert!(reply.is_finite());
        reply.observed.mean_rotation[2] = f64::NAN;
        assert!(!reply.is_finite());
        reply.observed.mean_rotation = [0.0; 3];
        reply.tangent.0[80] = f64::INFINITY;
        assert!(!reply.is_finite());
    }
}
