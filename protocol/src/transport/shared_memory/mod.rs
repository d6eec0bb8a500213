//! The transport between processes: iceoryx2 shared memory, blocking waits, process death seen by the kernel.
//!
//! # Shape
//!
//! One request-response service carries everything. The **macro is its only server, every worker a client**, because a
//! request reaches all servers and a queue of work must reach one worker. Each request is at the same time an uplink
//! message and the permission for one downlink message: a worker keeps a few requests open, the macro answers them in
//! the order in which they came. No permission, no message: nobody can be flooded, and no send ever blocks. Two event
//! services wake the sides; both wait in the kernel and burn no core, unless the run asks for another [`Waiting`].
//!
//! # Life and death
//!
//! Both sides hold a pidfd of the other, so a killed process is noticed within a millisecond, after everything it had
//! sent was delivered. iceoryx2's own view of who lives is not used: it changes only when somebody cleans up. A port
//! that is closed in order says so. A run's files carry one prefix below one directory ([`RunDirectory`]) and are
//! removed when the macro's port is dropped; what a killed macro leaves, [`RunDirectory::clean`] removes.

mod empty_file_removal;
mod gate;
mod macro_port;
mod polling;
mod run_directory;
pub(crate) mod services;
mod waiting;
mod watch;
mod worker_port;

pub use gate::sweep_before_exit;
pub use macro_port::SharedMemoryMacroPort;
pub use run_directory::{ChannelLimits, RunDirectory, RunError, RunListing, RunRecord};
pub use waiting::Waiting;
pub use worker_port::SharedMemoryWorkerPort;

use super::TransportError;
use std::fmt::Debug;

/// The version of iceoryx2 that Cargo pins; every process of a run needs exactly this one.
pub const ICEORYX2_VERSION: &str = "0.10.0";

/// Requests that a worker keeps open: two job slices in its queue and two control messages never wait for a permission.
pub(crate) const CREDITS: usize = 4;

/// Requests that a worker may have open at most; the surplus over [`CREDITS`] is what it says unasked.
pub(crate) const WINDOW: usize = 8;

/// Wraps a refusal of iceoryx2; its error types share no trait but `Debug`.
fn refused<E: Debug>(action: &'static str) -> impl FnOnce(E) -> TransportError {
    move |error| TransportError::Channel { action, reason: with_remedy(format!("{error:?}")) }
}

/// What the layer said, with what to look at where it found no memory.
fn with_remedy(said: String) -> String {
    if said.contains("DataSegment") {
        format!(
            "{said}; the memory of the channel cannot be mapped: look at the limit of this process (`ulimit -v`) and at the room in /dev/shm"
        )
    } else {
        said
    }
}

/// Wraps a refusal of the operating system.
fn system<E: Into<std::io::Error>>(action: &'static str) -> impl FnOnce(E) -> TransportError {
    move |error| TransportError::System { action, source: error.into() }
}

#[cfg(test)]
mod tests {
    use super::{ICEORYX2_VERSION, with_remedy};

    #[test]
    fn memory_that_cannot_be_mapped_is_told_with_what_to_look_at() {
        assert!(with_remedy("UnableToCreateDataSegment".into()).contains("ulimit -v"));
        assert_eq!(with_remedy("ServiceInCorruptedState".into()), "ServiceInCorruptedState");
    }

    /// The name that processes compare is the version that they were built with.
    #[test]
    fn the_version_is_the_one_in_the_lock_file() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.lock");
        let lock = std::fs::read_to_string(path).unwrap();
        let package = lock.split("[[package]]").find(|package| package.contains("name = \"iceoryx2\"\n")).unwrap();
        assert!(package.contains(&format!("version = \"{ICEORYX2_VERSION}\"\n")), "{package}");
    }
}
