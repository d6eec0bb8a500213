//! The check at the process border: a reply is believed only when everything in it fits the job.

use protocol::transport::LoadedReply;
use protocol::wire::{ReplyStatus, TrialJob};
use protocol::{RveError, StateId, TangentKind, TrialAnswer, TrialFlags};
use std::sync::Arc;

/// What a sound reply says.
#[derive(Clone, Debug)]
pub(super) enum Verdict {
    /// The trial was solved.
    Done {
        /// Stress and all.
        answer: Box<TrialAnswer>,
        /// Identity of the trial state.
        state: StateId,
        /// Its snapshot.
        bytes: Arc<[u8]>,
        /// Time the worker spent outside the solver, ns.
        overhead_nanoseconds: u64,
        /// Trials solved again to rebuild the state that it started from.
        replayed: u32,
    },
    /// The engine refused or failed.
    Failed(RveError),
    /// The worker lacks the committed state.
    NeedState,
    /// The worker lacks the definition.
    NeedDefinition,
}

/// Reads a reply to `job`.
///
/// # Errors
/// What is wrong with it, as text; a worker that sends such a reply cannot be trusted any more.
pub(super) fn judge(job: &TrialJob, loaded: &LoadedReply<'_>) -> Result<Verdict, String> {
    let reply = &loaded.reply;
    if !reply.is_sealed(loaded.error) {
        return Err("the reply was damaged on its way: its checksum is another".into());
    }
    let status =
        ReplyStatus::from_wire(reply.status).ok_or_else(|| format!("unknown reply status {}", reply.status))?;
    if reply.point != job.point {
        return Err(format!("job {} is about Gauss point {}, the reply about {}", job.job, job.point, reply.point));
    }
    match status {
        ReplyStatus::Done => judge_answer(job, loaded),
        ReplyStatus::Failed => {
            let reason: RveError = read_error(loaded.error)?;
            match reason {
                // The macro checked this snapshot against its name when it arrived: the refusal is the worker's fault.
                RveError::Snapshot(text) => Err(format!("a sound snapshot was refused: {text}")),
                // A defect of this engine in this process, such as a panic. Elsewhere the question may well be answered;
                // taking it for the point's answer would make the result depend on the worker.
                RveError::EngineFault(text) => Err(format!("the engine broke down: {text}")),
                reason => Ok(Verdict::Failed(reason)),
            }
        }
        ReplyStatus::NeedState if job.state == StateId::NONE => {
            Err("asks for the snapshot of an initial state".into())
        }
        ReplyStatus::NeedState => Ok(Verdict::NeedState),
        ReplyStatus::NeedDefinition => Ok(Verdict::NeedDefinition),
    }
}

fn judge_answer(job: &TrialJob, loaded: &LoadedReply<'_>) -> Result<Verdict, String> {
    let reply = &loaded.reply;
    if !reply.is_finite() {
        return Err("a value in the reply is not a finite number".into());
    }
    if loaded.state.is_empty() {
        return Err("the trial state is missing".into());
    }
    if StateId::of(loaded.state) != reply.state {
        return Err("the trial state does not have the content that its name promises".into());
    }
    let delivered = TangentKind::from_wire(reply.tangent_kind)
        .ok_or_else(|| format!("unknown tangent kind {}", reply.tangent_kind))?;
    let fell_back = TrialFlags(reply.flags).contains(TrialFlags::TANGENT_FALLBACK) && delivered != TangentKind::None;
    if reply.tangent_kind != job.tangent && !fell_back {
        return Err(format!("tangent kind {} was asked for, {} came", job.tangent, delivered.keyword()));
    }
    Ok(Verdict::Done {
        answer: Box::new(reply.answer()),
        state: reply.state,
        bytes: loaded.state.into(),
        overhead_nanoseconds: reply.overhead_nanoseconds,
        replayed: reply.replayed,
    })
}

fn read_error(bytes: &[u8]) -> Result<RveError, String> {
    rmp_serde::from_slice(bytes).map_err(|error| format!("the error text of a failed trial is unreadable: {error}"))
}
