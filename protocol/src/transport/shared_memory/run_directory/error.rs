//! Why a run cannot be made or found.

use crate::PROTOCOL_VERSION;
use crate::transport::shared_memory::ICEORYX2_VERSION;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a run cannot be made or found.
#[derive(Debug, Error)]
pub enum RunError {
    /// The name cannot be part of a path, or is too long for the system's socket addresses.
    #[error("`{name}` cannot be the name of a run: {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A living run has the name.
    #[error("a run named `{name}` is alive (process {pid}); choose another name or end that run")]
    Taken {
        /// The name.
        name: String,
        /// Process of its macro.
        pid: u32,
    },
    /// No living run has the name.
    #[error("no run named `{name}` is alive; living runs: {living}")]
    Unknown {
        /// The name.
        name: String,
        /// Names of those that are, for the reader.
        living: String,
    },
    /// The run was started by another version of this program.
    #[error(
        "run `{name}` speaks protocol {found_protocol} over iceoryx2 {found_iceoryx2}, but this program speaks protocol \
         {PROTOCOL_VERSION} over iceoryx2 {ICEORYX2_VERSION}; start macro and workers from the same build of grainspan"
    )]
    Version {
        /// The name.
        name: String,
        /// Protocol version of the run.
        found_protocol: u32,
        /// iceoryx2 version of the run.
        found_iceoryx2: String,
        /// Its prefix of shared-memory names, which tells it from later runs of the name.
        prefix: String,
    },
    /// Shared memory is full. Writing to memory that the system cannot provide would end the process without a word.
    #[error(
        "shared memory is full: {} kB are free in /dev/shm and {} kB are needed; `grainspan clean` removes what dead runs \
         have left, a container gets more with --shm-size",
        free / 1024, needed / 1024
    )]
    Room {
        /// Bytes that are free.
        free: u64,
        /// Bytes that are needed.
        needed: u64,
    },
    /// The operating system refused.
    #[error("could not {action} `{}`: {source}", path.display())]
    System {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}

/// The system's refusal of an action on a path.
pub(super) fn system(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    move |source| RunError::System { action, path: path.to_owned(), source }
}
