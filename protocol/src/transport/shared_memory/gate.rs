//! Who may make or remove files of a run while this process ends.
//!
//! Closing a worker's channels takes iceoryx2 some files that it makes and removes. A thread that ends the process in that
//! moment leaves them behind, and with the run removed nobody looks for them any more.

use super::RunRecord;
use super::run_directory::{CleanupAfterEnd, RunDirectory};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

#[derive(Debug)]
struct State {
    /// Ports that are being opened or closed.
    busy: usize,
    /// The process ends: nobody begins any more.
    ending: bool,
    /// Runs that worker ports of this process have joined.
    joined: Vec<RunRecord>,
}

static STATE: Mutex<State> = Mutex::new(State { busy: 0, ending: false, joined: Vec::new() });
static CHANGED: Condvar = Condvar::new();

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Lives as long as a port is being opened or closed.
#[derive(Debug)]
pub(super) struct Busy(());

impl Busy {
    /// Waits for ever once the process ends.
    pub(super) fn begin() -> Self {
        let mut state = CHANGED.wait_while(state(), |state| state.ending).unwrap_or_else(PoisonError::into_inner);
        state.busy += 1;
        Self(())
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        state().busy -= 1;
        CHANGED.notify_all();
    }
}

/// The first and the last part of an open worker port: what lies between them is closed while the gate is passed.
#[derive(Debug)]
pub(super) struct FirstPart;

/// See [`FirstPart`].
#[derive(Debug)]
pub(super) struct LastPart(pub(super) RunRecord);

impl FirstPart {
    /// Notes that a run was joined.
    pub(super) fn open(record: &RunRecord) -> (Self, LastPart) {
        state().joined.push(record.clone());
        (Self, LastPart(record.clone()))
    }
}

impl Drop for FirstPart {
    fn drop(&mut self) {
        // Handed to the last part, which ends it.
        std::mem::forget(Busy::begin());
    }
}

impl Drop for LastPart {
    fn drop(&mut self) {
        let mut state = state();
        state.busy -= 1;
        if let Some(place) = state.joined.iter().position(|record| record.prefix == self.0.prefix) {
            state.joined.remove(place);
        }
        CHANGED.notify_all();
    }
}

/// Removes what the dead run `name` has left, after ports of this process that are being closed have been closed, for up to
/// `timeout` each. Afterwards no port of this process can be opened or closed: call it and end the process.
pub fn sweep_before_exit(name: &str, timeout: Duration) {
    let mut held = state();
    held.ending = true;
    let (held, _) =
        CHANGED.wait_timeout_while(held, timeout, |state| state.busy > 0).unwrap_or_else(PoisonError::into_inner);
    let joined = held.joined.clone();
    drop(held);
    // Every worker of the run tries: whoever comes second finds nothing, and there is nobody to tell.
    let _ = RunDirectory::remove_once_dead(name, timeout);
    joined.into_iter().for_each(|record| drop(CleanupAfterEnd(record)));
}
