//! Messages of the conversation that are not jobs or replies; MessagePack on every transport.

use crate::capabilities::Capabilities;
use crate::engine::Definition;
use crate::identity::DefinitionId;
use serde::{Deserialize, Serialize};

/// From a worker to the macro.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum FromWorker {
    /// First message of every worker.
    Hello {
        /// [`crate::PROTOCOL_VERSION`] of the worker.
        protocol: u32,
        /// Run that the worker wants to join.
        run: String,
        /// Process id, watched by the macro.
        pid: u32,
        /// What its engine can do.
        capabilities: Capabilities,
        /// How many states the worker keeps; the macro counts on the most recent ones.
        state_cache: u32,
    },
    /// A definition was refused.
    DefinitionRefused {
        /// Which.
        definition: DefinitionId,
        /// Why.
        reason: String,
    },
    /// The worker leaves on its own will; jobs it still holds go to others.
    Bye {
        /// Why, for the log.
        reason: String,
    },
}

/// From the macro to one worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToWorker {
    /// The hello was accepted.
    Welcome {
        /// Number of this worker in the run, for logs.
        worker: u32,
    },
    /// The hello was refused; the worker prints the reason and exits with code 2.
    Refused {
        /// Why, with the remedy.
        reason: String,
    },
    /// Makes an RVE definition known; answered only when refused.
    Define {
        /// The definition; its id is the hash of its bytes.
        definition: Definition,
    },
    /// Finish the queued jobs, then leave.
    Drain,
    /// Leave now.
    Bye,
}
