//! What happened at the listener of a run and on its connections; figures for people, never input to a result.

use crate::lock;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex};

/// Totals of one run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HostsStatistics {
    /// Agents that were admitted, each time that they joined.
    pub agents_joined: u64,
    /// Agents that left in good order.
    pub agents_left: u64,
    /// Agents whose connection was lost before the end of the run.
    pub agents_lost: u64,
    /// Agents that were given up because they kept sending what is no message.
    pub agents_faulty: u64,
    /// Connections that did not prove to know the secret, or did not say in time who they are.
    pub strangers_refused: u64,
    /// Agents with the secret that were refused for their version or build.
    pub agents_refused: u64,
    /// Snapshots that jobs did not have to carry because their host had them already.
    pub states_kept: u64,
    /// Bytes of these snapshots.
    pub bytes_saved: u64,
    /// Bytes sent to agents, before encryption.
    pub bytes_sent: u64,
    /// Bytes received from agents, after decryption.
    pub bytes_received: u64,
    /// Messages sent to agents.
    pub messages_sent: u64,
    /// Messages received from agents.
    pub messages_received: u64,
}

/// A handle to the figures of a running listener.
#[derive(Clone, Debug, Default)]
pub struct Figures(Arc<Mutex<HostsStatistics>>);

impl Figures {
    /// The figures now.
    pub fn now(&self) -> HostsStatistics {
        lock(&self.0).clone()
    }

    /// Changes them.
    pub(crate) fn count(&self, change: impl FnOnce(&mut HostsStatistics)) {
        change(&mut lock(&self.0));
    }
}
