//! What an engine says that it can do.

use crate::observed::OptionalResult;
use crate::tangent_kind::TangentKind;
use serde::{Deserialize, Serialize};

/// What a snapshot of an engine holds. Both are opaque bytes to everybody else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SnapshotKind {
    /// The whole state: restoring it costs no solving.
    #[default]
    State,
    /// The path of committed targets: restoring it solves them again from the initial state, unless the worker still
    /// holds the end of the path. Costs grow with the length of the run.
    Path,
}

/// What an engine can do; declared in its hello and checked before a run starts.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capabilities {
    /// Engine name as in snapshots.
    pub engine: String,
    /// Engine version, for people.
    pub version: String,
    /// Space dimensions served, 2 and/or 3.
    pub dimensions: Vec<u32>,
    /// Tangent kinds served beside [`TangentKind::None`].
    pub tangents: Vec<TangentKind>,
    /// Contact laws served, by the keywords of scene files.
    #[serde(default)]
    pub laws: Vec<String>,
    /// What its snapshots hold.
    #[serde(default)]
    pub snapshot: SnapshotKind,
    /// Whether the same request has the same result, bit for bit, in every worker of this engine and version.
    #[serde(default)]
    pub deterministic: bool,
    /// Trials of one definition that a worker solves side by side, in little more time than it takes for one of them; 0 is read as 1.
    #[serde(default)]
    pub side_by_side: u32,
    /// Whether it follows [`TrialOptions::friction_reduction`](crate::trial::TrialOptions::friction_reduction).
    #[serde(default)]
    pub reduces_friction: bool,
    /// Optional results that it delivers when they are requested, by the keywords of [`OptionalResult`]. Words that are not known stand for
    /// results of later versions.
    #[serde(default)]
    pub observables: Vec<String>,
    /// What it follows of the parts of definitions that not every engine follows, by their keys in scenes. The list of them belongs to
    /// those who write definitions.
    #[serde(default)]
    pub features: Vec<String>,
}

impl Capabilities {
    /// The optional results that the engine does not deliver.
    pub fn lacking(&self) -> Vec<OptionalResult> {
        let is_missing = |result: &OptionalResult| !self.observables.iter().any(|word| word == result.keyword());
        OptionalResult::ALL.into_iter().filter(is_missing).collect()
    }
}
