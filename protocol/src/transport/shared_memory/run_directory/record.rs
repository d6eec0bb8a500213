//! The record of a run, `run.json`: everything that a worker needs to join, and whether the run lives.

use crate::process::ProcessStat;
use crate::transport::shared_memory::waiting::Waiting;
use serde::{Deserialize, Serialize};
use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// How much a run's channel carries, and how its ends wait. Memory is reserved by address and used only as touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChannelLimits {
    /// Largest message, bytes: a job slice or its replies with all snapshots.
    pub message_bytes: u64,
    /// Workers at the same time, the not yet cleaned up dead ones included.
    pub workers: u32,
    /// How both ends wait for messages.
    #[serde(default)]
    pub waiting: Waiting,
}

impl Default for ChannelLimits {
    fn default() -> Self {
        Self { message_bytes: 4 << 20, workers: 64, waiting: Waiting::default() }
    }
}

impl ChannelLimits {
    /// Largest message that this process can hold, bytes.
    pub fn message_length(&self) -> usize {
        usize::try_from(self.message_bytes).unwrap_or(usize::MAX)
    }
}

/// What a worker must know to join a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunRecord {
    /// [`PROTOCOL_VERSION`] of the macro.
    pub protocol: u32,
    /// Version of iceoryx2; every process of a run needs the same one.
    pub iceoryx2: String,
    /// Name of the run.
    pub name: String,
    /// Process of the macro.
    pub pid: u32,
    /// When that process started, clock ticks since boot: tells it from a later process with the same number.
    pub pid_started: u64,
    /// The kernel's name of the PID namespace in which that number holds; none in records of older programs.
    #[serde(default)]
    pub pid_namespace: Option<String>,
    /// Prefix of all shared-memory names of the run.
    pub prefix: String,
    /// iceoryx2's root directory.
    pub root: PathBuf,
    /// Capacity.
    pub limits: ChannelLimits,
    /// Whether the services exist, so that a worker can join.
    pub ready: bool,
}

impl RunRecord {
    /// Whether the macro's process lives. Process numbers of another container that shares `/dev/shm` say nothing here; the
    /// lock that the macro holds on its directory is seen by all.
    pub fn is_alive(&self) -> bool {
        if self.is_foreign() {
            return self.root.parent().is_some_and(is_locked);
        }
        process_start(self.pid) == Some(self.pid_started)
    }

    /// Whether the macro lives in another PID namespace: its process cannot be watched from here.
    pub fn is_foreign(&self) -> bool {
        let own = pid_namespace();
        self.pid_namespace.is_some() && own.is_some() && self.pid_namespace != own
    }
}

/// One entry of [`RunDirectory::list`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunListing {
    /// Name of the run.
    pub name: String,
    /// Its record, if one can be read.
    pub record: Option<RunRecord>,
    /// Whether its macro lives (or may be about to begin).
    pub alive: bool,
}

/// The record in a run's directory, if one can be read.
pub(super) fn record_in(directory: &Path) -> Option<RunRecord> {
    serde_json::from_slice(&fs::read(directory.join("run.json")).ok()?).ok()
}

/// Start time of a process in clock ticks since boot; `None` when it does not live.
pub(super) fn process_start(pid: u32) -> Option<u64> {
    ProcessStat::of(pid).filter(ProcessStat::is_alive).map(|stat| stat.started)
}

/// The kernel's name of this process's PID namespace.
pub(super) fn pid_namespace() -> Option<String> {
    fs::read_link("/proc/self/ns/pid").ok()?.into_os_string().into_string().ok()
}

/// Whether somebody holds the lock of a run's directory. What cannot be judged counts as held.
fn is_locked(directory: &Path) -> bool {
    match File::open(directory) {
        Ok(file) => matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock | TryLockError::Error(_))),
        Err(error) => error.kind() != ErrorKind::NotFound,
    }
}
