//! Settings of a pool, fixed at the start of a run.

use protocol::transport::shared_memory::ChannelLimits;
use protocol::{OptionalResult, TangentKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;
use std::time::Duration;

/// When a silent worker counts as hung. Generous on purpose: a kill costs the work done so far, and a scheduler may
/// hold a healthy process for many milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct HangPolicy {
    /// Time that the jobs of a message may take together whatever they are expected to cost.
    #[serde(rename = "hang_floor", with = "keys::forms::seconds")]
    #[schemars(with = "f64", extend("x-unit" = "s"), range(min = 0.0, max = 2_678_400.0))]
    pub floor: Duration,
    /// Times its expected duration that a job may take in addition. Time in which the worker was ready and got no
    /// processor does not count.
    #[serde(rename = "hang_factor")]
    #[schemars(extend("x-unit" = "-"), range(min = 1.0))]
    pub factor: f64,
    /// Time that a message may take in addition while nothing is known of the throughput of an RVE definition in it. Until then its messages
    /// hold no more jobs than a worker solves side by side.
    #[serde(rename = "hang_unknown", with = "keys::forms::seconds")]
    #[schemars(with = "f64", extend("x-unit" = "s"), range(min = 0.0, max = 2_678_400.0))]
    pub unknown: Duration,
    /// How long a worker with work may be stopped (SIGSTOP, a debugger) before it is ended.
    #[serde(rename = "stopped_limit", with = "keys::forms::seconds")]
    #[schemars(with = "f64", extend("x-unit" = "s"), range(min = 0.0, max = 2_678_400.0))]
    pub stopped: Duration,
}

impl Default for HangPolicy {
    fn default() -> Self {
        Self {
            floor: Duration::from_secs(60),
            factor: 30.0,
            unknown: Duration::from_secs(600),
            stopped: Duration::from_secs(5),
        }
    }
}

impl HangPolicy {
    /// How long a message may take whose jobs are expected to take so long each (`None`: unknown) and have already taken so many workers
    /// too long. Doubles with each of these, so a job that is merely long gets through in the end; a crash tells nothing about its
    /// length. The floor counts once: it stands for what a busy machine does to a healthy process, however many jobs that has. So does the
    /// time of unknown jobs, which a worker solves side by side.
    pub fn allowance(&self, jobs: impl Iterator<Item = (Option<Duration>, u32)>) -> Duration {
        let mut sum = Duration::ZERO;
        let mut most = 0;
        let mut most_unknown = 0;
        for (expected, overruns) in jobs {
            let times = 2u32.pow(overruns.min(8));
            most = most.max(times);
            match expected {
                // A wild estimate must not overflow the clock: nothing in one step takes longer than a day.
                Some(expected) => {
                    sum += times * Duration::from_secs_f64((expected.as_secs_f64() * self.factor).min(86_400.0))
                }
                None => most_unknown = most_unknown.max(times),
            }
        }
        sum + self.floor * most + self.unknown * most_unknown
    }
}

/// When a worker has done enough; `None`: never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Recycling {
    /// Answered jobs after which a worker, of any engine, is replaced by a fresh one.
    #[serde(rename = "recycle_jobs")]
    #[schemars(extend("x-default" = "never"))]
    pub jobs: Option<u64>,
    /// Resident memory from which a worker, of any engine, is replaced by a fresh one.
    #[serde(rename = "recycle_memory")]
    #[schemars(extend("x-unit" = "MiB", "x-default" = "never"))]
    pub memory: Option<u64>,
}

/// Settings of a pool; none of them changes a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct PoolSettings {
    /// Name of the run; a worker that asks for another run is refused.
    #[schemars(skip)]
    pub run: String,
    /// Space dimensions that every worker must serve, 2 or 3.
    #[schemars(skip)]
    pub dimension: u32,
    /// For each definition the engine whose workers solve it; empty = one engine for all, that of the first worker.
    #[schemars(skip)]
    pub engines: Vec<String>,
    /// Engines whose version is known before their first worker comes, with it; of any other engine the first worker's version holds.
    #[schemars(skip)]
    pub versions: Vec<(String, String)>,
    /// For each definition the optional results that its engine does not deliver: NaN in the answers of its points. Empty = not known, and
    /// answers are passed on as they come.
    #[schemars(skip)]
    pub lacking: Vec<Vec<OptionalResult>>,
    /// Tangent kinds that every worker must serve.
    #[schemars(skip)]
    pub tangents: Vec<TangentKind>,
    /// Trials per message.
    #[schemars(extend("x-default" = "64"), range(max = 4096))]
    pub jobs_per_message: NonZeroUsize,
    /// Most bytes of states in one message: what the channel carries. A message that would be longer is cut.
    #[schemars(skip)]
    pub message_bytes: usize,
    /// Messages that a worker may hold unanswered; two hide the latency of the channel.
    #[schemars(range(max = 4096))]
    pub window: NonZeroUsize,
    /// Whether bitwise equal trials within one evaluation are solved once.
    #[schemars(skip)]
    pub deduplicate: bool,
    /// When a silent worker is ended.
    #[serde(flatten)]
    pub hang: HangPolicy,
    /// When a worker has done enough and a fresh one takes its place.
    #[serde(flatten)]
    pub recycling: Recycling,
    /// How long the pool lives without any worker before it gives up.
    #[serde(with = "keys::forms::seconds")]
    #[schemars(with = "f64", extend("x-unit" = "s", "x-default" = "60, with --attach or --listen 3600"), range(min = 0.0, max = 2_678_400.0))]
    pub worker_timeout: Duration,
    /// Number of workers that one job may end before it is held to be the cause and the run stops.
    #[schemars(range(min = 1))]
    pub quarantine_after: u32,
    /// Delay of a job before the worker whose loss would quarantine it gets it. Several workers that are ended from outside end at
    /// the same time; without a delay the jobs that they held would be quarantined.
    #[schemars(skip)]
    #[serde(with = "keys::forms::seconds")]
    pub retry_delay: Duration,
}

impl Default for PoolSettings {
    /// Those of a run without a name.
    fn default() -> Self {
        Self::new("")
    }
}

impl PoolSettings {
    /// The group of workers that solves each of `definitions` definitions: the place at which its engine is first named.
    pub(super) fn groups(&self, definitions: usize) -> Vec<usize> {
        (0..definitions).map(|one| self.engines.get(one).and_then(|name| self.group_of(name)).unwrap_or(0)).collect()
    }

    /// The group of an engine's workers; `None` when no point is given to this engine.
    pub(super) fn group_of(&self, engine: &str) -> Option<usize> {
        if self.engines.is_empty() { Some(0) } else { self.engines.iter().position(|name| name == engine) }
    }

    /// The version that workers of an engine must have, if it is known beforehand.
    pub(super) fn version_of(&self, engine: &str) -> Option<&str> {
        self.versions.iter().find(|(name, _)| name == engine).map(|(_, version)| version.as_str())
    }

    /// The defaults for a plane problem of the run named `run`.
    pub fn new(run: impl Into<String>) -> Self {
        Self {
            run: run.into(),
            dimension: 2,
            engines: Vec::new(),
            versions: Vec::new(),
            lacking: Vec::new(),
            tangents: Vec::new(),
            jobs_per_message: NonZeroUsize::MIN,
            message_bytes: ChannelLimits::default().message_bytes as usize,
            window: NonZeroUsize::MIN.saturating_add(1),
            deduplicate: true,
            hang: HangPolicy::default(),
            recycling: Recycling::default(),
            worker_timeout: Duration::from_secs(60),
            quarantine_after: 3,
            retry_delay: Duration::from_millis(500),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allowance_grows_with_expectation_and_with_overruns_and_never_overflows() {
        let policy = HangPolicy::default();
        let of = |jobs: &[(Option<Duration>, u32)]| policy.allowance(jobs.iter().copied());
        let short = Some(Duration::from_millis(10));
        assert_eq!(of(&[(short, 0)]), Duration::from_secs_f64(60.3));
        assert_eq!(of(&[(short, 1)]), of(&[(short, 0)]) * 2);
        assert_eq!(of(&[(None, 0)]), Duration::from_secs(660));
        assert!(of(&[(Some(Duration::MAX), u32::MAX)]) < Duration::from_secs(86_460 * 256 + 1));
        // Every job of a message added the floor: one that hung was found after half an hour, and not after a minute.
        assert_eq!(of(&[(short, 0); 32]), Duration::from_secs_f64(69.6));
        // And every job of a definition that no one had solved yet added its ten minutes.
        assert_eq!(of(&[(None, 0); 8]), Duration::from_secs(660));
        assert_eq!(of(&[(None, 0), (None, 1), (short, 0)]), Duration::from_secs_f64(1320.3));
    }
}
