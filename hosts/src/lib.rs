//! Workers on other hosts.
//!
//! One **agent** per host runs that host's own workers over shared memory and joins them to a run. To the macro process each of these
//! workers is a worker like any other: the scheduler, the checks of replies and the counters are the same. The agent only passes
//! messages on and keeps the states that its host has seen, so that they need not travel twice.
//!
//! Between hosts there is one TCP connection per agent, encrypted and mutually authenticated by TLS 1.3 (rustls) with raw public keys
//! that both sides derive from a shared secret. The kernel detects lost connections (keep-alive and user timeout). The reasons and
//! the measurements are in `docs/concepts/hosts.md` and `docs/lab-book/hosts.md`.
//!
//! Nothing here can change a result: a trial is a pure function, and replies are checked as those of local workers are.
#![cfg(feature = "network")]

pub mod agent;
mod buffers;
mod connection;
mod join_file;
mod joined;
mod listener;
mod macro_port;
mod message;
mod program;
mod secret;
mod state_mirror;
mod statistics;
mod tls;
mod worker_port;

pub use connection::Limits;
pub use join_file::{JoinFile, JoinFileError, Target};
pub use joined::JoinedPort;
pub use macro_port::{ListenerOptions, NetworkMacroPort};
pub use message::LINK_VERSION;
pub use program::this_program;
pub use secret::{Secret, SecretError};
pub use statistics::{Figures, HostsStatistics};
pub use worker_port::{JoinError, NetworkWorkerPort};

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks; a thread that panicked while it held the lock left the content sound, since every change is one assignment or one push.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
