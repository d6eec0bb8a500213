//! `[checkpoint]` and `[pool]`.

use keys::Located;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// `[checkpoint]`: when the state of a run is written. Changes no result.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct CheckpointTable {
    pub(crate) enabled: Option<bool>,
    pub(crate) steps: Option<Located<u64>>,
    pub(crate) seconds: Option<Located<f64>>,
}

/// `[pool]`: who solves the points and how the workers are led. Only `engine` and `points` change a result.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct PoolTable {
    pub(crate) hang_floor: Option<Located<f64>>,
    pub(crate) hang_factor: Option<Located<f64>>,
    pub(crate) hang_unknown: Option<Located<f64>>,
    pub(crate) stopped_limit: Option<Located<f64>>,
    pub(crate) patience: Option<Located<f64>>,
    pub(crate) restarts: Option<Located<u32>>,
    pub(crate) quarantine_after: Option<Located<u32>>,
    pub(crate) slice: Option<Located<usize>>,
    pub(crate) window: Option<Located<usize>>,
    pub(crate) lanes: Option<bool>,
    pub(crate) wait: Option<Located<String>>,
    pub(crate) engine: Option<String>,
    pub(crate) points: BTreeMap<String, Vec<Located<usize>>>,
    pub(crate) difference_strain: Option<Located<f64>>,
    pub(crate) difference_reuses: Option<Located<u32>>,
    pub(crate) most_workers: Option<Located<usize>>,
    pub(crate) recycle_jobs: Option<u64>,
    pub(crate) recycle_memory: Option<u64>,
}
