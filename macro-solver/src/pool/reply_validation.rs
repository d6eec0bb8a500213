//! The check at the process boundary: a reply counts only when everything in it fits the job.

use super::batch::Job;
use super::points::PointState;
use protocol::transport::LoadedReply;
use protocol::wire::ReplyStatus;
use protocol::{RveError, StateId, TangentKind, TrialFlags, TrialResult};
use thiserror::Error;

/// Most force evaluations that are taken for a count: months of any machine.
const MOST_FORCE_EVALUATIONS: u64 = 1 << 53;

/// Largest component of a target that rounding may hide in the state behind it.
const UNSEEN_STRAIN: f64 = 1e-9;

/// A reply that has passed the check.
#[derive(Clone, Debug)]
pub(super) enum ValidatedReply {
    /// The trial was solved.
    Done {
        /// Stress and all other results.
        answer: Box<TrialResult>,
        /// The trial state.
        state: PointState,
        /// Time that the worker spent outside the solver, ns.
        overhead_nanoseconds: u64,
        /// Trials solved again to rebuild the state that the trial started from.
        replayed: u32,
    },
    /// The engine refused or failed.
    Failed(RveError),
    /// The worker lacks the committed state.
    NeedState,
    /// The worker lacks the definition.
    NeedDefinition,
}

/// Why a reply cannot be trusted, and with it the worker that sent it.
#[derive(Clone, Debug, Error, PartialEq)]
pub(super) enum InvalidReply {
    /// Damage on the way between the processes.
    #[error("the checksum of the reply does not match its content")]
    Checksum,
    /// A status number that the protocol does not have.
    #[error("unknown reply status {0}")]
    Status(u32),
    /// Job and Gauss point do not belong together.
    #[error("job {job} is about Gauss point {expected}, the reply about {found}")]
    Point {
        /// Number of the job.
        job: u64,
        /// Its point.
        expected: u64,
        /// Point of the reply.
        found: u64,
    },
    /// The error of a failed trial cannot be decoded.
    #[error("the error text of a failed trial is unreadable: {0}")]
    ErrorText(String),
    /// The pool has checked this snapshot against its identity when it arrived, so the worker is at fault.
    #[error("a valid snapshot was refused: {0}")]
    SnapshotRefused(String),
    /// A defect of this engine in this process, such as a panic. Another worker may well answer; to accept it as the answer of
    /// the point would make the result depend on the worker.
    #[error("the engine broke down: {0}")]
    EngineFault(String),
    /// An initial state has no snapshot.
    #[error("asks for the snapshot of an initial state")]
    NeedsInitialState,
    /// NaN or infinity.
    #[error("a value in the reply is not a finite number")]
    NotFinite,
    /// A cell turned inside out.
    #[error("the volume of the cell is {0:e} times that at the start, which is negative")]
    Volume(f64),
    /// A number of force evaluations that no trial takes; sums of them would wrap around.
    #[error("{0} force evaluations are more than any trial takes")]
    ForceEvaluations(u64),
    /// The state after a strain is that before it, so what happened in the trial is lost with it.
    #[error(
        "the state behind a strain of {0:.1e} is the one before it: the snapshots of the engine do not hold its state"
    )]
    StateUnmoved(f64),
    /// A solved trial without its end state.
    #[error("the trial state is missing")]
    StateMissing,
    /// The identity of the trial state is not the hash of its content.
    #[error("the content of the trial state does not match its identity")]
    StateDamaged,
    /// A tangent kind number that the protocol does not have.
    #[error("unknown tangent kind {0}")]
    UnknownTangent(u32),
    /// Another tangent than the requested one, and not the fallback.
    #[error("tangent `{}` was requested, `{}` came", requested.keyword(), delivered.keyword())]
    OtherTangent {
        /// Kind requested.
        requested: TangentKind,
        /// Kind of the reply.
        delivered: TangentKind,
    },
}

/// Reads a reply to `job`.
///
/// # Errors
/// What is wrong with it; a worker that sends such a reply cannot be trusted any more.
pub(super) fn validate_reply(job: &Job, loaded: &LoadedReply<'_>) -> Result<ValidatedReply, InvalidReply> {
    let reply = &loaded.reply;
    if !reply.is_sealed(loaded.error) {
        return Err(InvalidReply::Checksum);
    }
    let status = ReplyStatus::from_wire(reply.status).ok_or(InvalidReply::Status(reply.status))?;
    let point = job.trial.point as u64;
    if reply.point != point {
        return Err(InvalidReply::Point { job: job.number, expected: point, found: reply.point });
    }
    match status {
        ReplyStatus::Done => validate_result(job, loaded),
        ReplyStatus::Failed => match read_error(loaded.error)? {
            RveError::Snapshot(text) => Err(InvalidReply::SnapshotRefused(text)),
            RveError::EngineFault(text) => Err(InvalidReply::EngineFault(text)),
            reason => Ok(ValidatedReply::Failed(reason)),
        },
        ReplyStatus::NeedState if job.state.id == StateId::NONE => Err(InvalidReply::NeedsInitialState),
        ReplyStatus::NeedState => Ok(ValidatedReply::NeedState),
        ReplyStatus::NeedDefinition => Ok(ValidatedReply::NeedDefinition),
    }
}

fn validate_result(job: &Job, loaded: &LoadedReply<'_>) -> Result<ValidatedReply, InvalidReply> {
    let reply = &loaded.reply;
    if !reply.is_finite() {
        return Err(InvalidReply::NotFinite);
    }
    if reply.scalars.volume_ratio < 0.0 {
        return Err(InvalidReply::Volume(reply.scalars.volume_ratio));
    }
    if reply.cost.force_evaluations > MOST_FORCE_EVALUATIONS {
        return Err(InvalidReply::ForceEvaluations(reply.cost.force_evaluations));
    }
    if loaded.state.is_empty() {
        return Err(InvalidReply::StateMissing);
    }
    let state = PointState::from_snapshot(loaded.state.into());
    if state.id != reply.state {
        return Err(InvalidReply::StateDamaged);
    }
    let strain = job.trial.target.0.iter().fold(0.0f64, |largest, component| largest.max(component.abs()));
    if state.id == job.state.id && strain > UNSEEN_STRAIN {
        return Err(InvalidReply::StateUnmoved(strain));
    }
    let delivered =
        TangentKind::from_wire(reply.tangent_kind).ok_or(InvalidReply::UnknownTangent(reply.tangent_kind))?;
    let fell_back = TrialFlags(reply.flags).contains(TrialFlags::TANGENT_FALLBACK) && delivered != TangentKind::None;
    if delivered != job.trial.options.tangent && !fell_back {
        return Err(InvalidReply::OtherTangent { requested: job.trial.options.tangent, delivered });
    }
    Ok(ValidatedReply::Done {
        answer: Box::new(reply.answer()),
        state,
        overhead_nanoseconds: reply.overhead_nanoseconds,
        replayed: reply.replayed,
    })
}

fn read_error(bytes: &[u8]) -> Result<RveError, InvalidReply> {
    rmp_serde::from_slice(bytes).map_err(|error| InvalidReply::ErrorText(error.to_string()))
}
