//! Turns a received frame into the event that a port hands to its owner; the same for every transport.

use super::frame::{Frame, FrameError, FrameKind};
use super::{MacroEvent, WorkerEvent, WorkerId};
use crate::control::{FromWorker, ToWorker};

/// Delivers one frame of a worker.
///
/// # Errors
/// The frame is not a sound message in this direction; nothing was delivered.
pub fn deliver_to_macro(
    worker: WorkerId,
    bytes: &[u8],
    sink: &mut dyn FnMut(MacroEvent<'_>),
) -> Result<(), FrameError> {
    let frame = Frame::parse(bytes)?;
    match frame.kind {
        FrameKind::Control => sink(MacroEvent::Control(worker, frame.control::<FromWorker>()?)),
        FrameKind::Replies => sink(MacroEvent::Replies(worker, &frame.replies()?)),
        FrameKind::Jobs | FrameKind::Credit | FrameKind::Close => return Err(FrameError::Kind(frame.kind as u32)),
    }
    Ok(())
}

/// Delivers one frame of the macro.
///
/// # Errors
/// As [`deliver_to_macro`].
pub fn deliver_to_worker(bytes: &[u8], sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<(), FrameError> {
    let frame = Frame::parse(bytes)?;
    match frame.kind {
        FrameKind::Control => sink(WorkerEvent::Control(frame.control::<ToWorker>()?)),
        FrameKind::Jobs => sink(WorkerEvent::Jobs(&frame.jobs()?)),
        FrameKind::Replies | FrameKind::Credit | FrameKind::Close => return Err(FrameError::Kind(frame.kind as u32)),
    }
    Ok(())
}
