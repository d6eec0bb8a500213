//! What the page asks of the program that shows it.

use serde_json::Value;
use std::path::Path;

/// What only the program knows.
#[derive(Clone, Copy)]
pub struct Program {
    /// Progress of the live run that writes to this folder: `begun`, `step`, `load`, `evaluations`, `time`, `fallbacks`, `workers`; `None` if no
    /// run does.
    pub live: fn(&Path) -> Option<Value>,
    /// A counter of the fallbacks as people read it, and whether it may concern the accuracy.
    pub counter: fn(&str, u64) -> (String, bool),
}
