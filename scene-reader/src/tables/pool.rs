//! `[pool]`: the settings of the pool and of those who use it.

use crate::BUILT_IN_ENGINE;
use macro_solver::material::difference::DifferencePlan;
use macro_solver::pool::PoolSettings;
use protocol::transport::shared_memory::Waiting;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// `[pool]`.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "it lists the keys; each of its parts reads its own from those that are written")]
pub(crate) struct PoolTable {
    #[serde(flatten)]
    pool: PoolSettings,
    #[serde(flatten)]
    difference: DifferencePlan,
    #[serde(flatten)]
    run: PoolRunKeys,
}

/// The keys of `[pool]` that are settled before there is a pool.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct PoolRunKeys {
    /// Whether a worker solves trials of cells side by side in SIMD lanes. Without, a message holds one trial, whatever
    /// `jobs_per_message` says; the bits are the same.
    pub(crate) lanes: bool,
    /// How macro solver and workers wait for messages; `--wait` overrides it.
    #[schemars(extend("x-default" = "\"block\""))]
    pub(crate) wait: Option<Waiting>,
    /// Replacements of workers in a row that may end without a reply. Those after useful workers are not counted.
    #[schemars(extend("x-default" = "20"))]
    pub(crate) restarts: Option<u32>,
    /// Most workers that `--workers` may ask for, all engines together. More are refused before any is started.
    #[schemars(extend("x-default" = "64, on large machines 8 per core"), range(min = 1))]
    pub(crate) most_workers: Option<usize>,
    /// Engine of all points that `points` does not give to another: the one of this program, or one of the catalogue. `--engine`
    /// overrides it. With `[rve] frame` it is `boundary-frame` unless another is named.
    pub(crate) engine: String,
    /// Gauss points of other engines, for example `{ lammps = [0, 4] }`.
    pub(crate) points: BTreeMap<String, Vec<usize>>,
}

impl Default for PoolRunKeys {
    fn default() -> Self {
        let engine = BUILT_IN_ENGINE.to_owned();
        Self { lanes: true, wait: None, restarts: None, most_workers: None, engine, points: BTreeMap::new() }
    }
}
