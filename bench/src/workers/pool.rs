//! A pool of worker processes that a study sends trials to.

use super::{HelperProcess, Role};
use anyhow::Context;
use macro_solver::material::{PointMaterial, PointTrial};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, PoolStatistics};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, Waiting};
use protocol::{Definition, TangentKind, Tensor2, TrialOptions};
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// A name that no other run of this user has.
pub(crate) fn fresh_name() -> String {
    static OPENED: AtomicU32 = AtomicU32::new(0);
    format!("bench{}-{}", std::process::id(), OPENED.fetch_add(1, Ordering::Relaxed))
}

/// Strain of one call: that of an increment of the shipped scenes.
const STRAIN: f64 = 1e-4;

/// Processor time of a thread, s, if the system reports it. `thread-self` is the calling thread.
pub(crate) fn measured_processor_seconds(thread: &str) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{thread}/schedstat")).ok()?;
    Some(1e-9 * text.split_whitespace().next()?.parse::<f64>().ok()?)
}

/// The same; 0 if the system does not report it.
pub(crate) fn processor_seconds(thread: &str) -> f64 {
    measured_processor_seconds(thread).unwrap_or(0.0)
}

/// The 400 discs of the shipped scene with its contact law.
///
/// # Errors
/// None in a sound build: the packing travels in the program.
pub(crate) fn grain_definition() -> anyhow::Result<Definition> {
    let packing: PackingFile = serde_json::from_str(include_str!("../../../packings/discs-400-dense.json"))?;
    let contact = toml::from_str("law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5")?;
    let grains = GrainDefinition { packing, contact, options: RveOptions::default() };
    Ok(grains.validate().context("the packing in this program is not sound")?.to_protocol())
}

/// A pool with worker processes, all of whose points are made of one definition.
pub(crate) struct StudyPool {
    pool: Pool<SharedMemoryMacroPort>,
    tangent: TangentKind,
    points: usize,
    calls: u32,
    // Dropped after the pool, which dismisses them.
    workers: Vec<HelperProcess>,
}

impl StudyPool {
    /// Opens a run and waits for its workers; without a role they solve grains.
    ///
    /// # Errors
    /// Workers cannot be started or do not come.
    pub(crate) fn open(
        role: Option<Role>,
        definition: Definition,
        workers: usize,
        points: usize,
        waiting: Waiting,
    ) -> anyhow::Result<Self> {
        Self::open_with(role, definition, workers, points, waiting, |_| {})
    }

    /// The same with other settings of the pool.
    ///
    /// # Errors
    /// As [`StudyPool::open`].
    pub(crate) fn open_with(
        role: Option<Role>,
        definition: Definition,
        workers: usize,
        points: usize,
        waiting: Waiting,
        change: impl FnOnce(&mut PoolSettings),
    ) -> anyhow::Result<Self> {
        let run = fresh_name();
        let limits = ChannelLimits { waiting, ..ChannelLimits::default() };
        let port = SharedMemoryMacroPort::create(&run, limits)?;
        let start = |_| match role {
            Some(role) => HelperProcess::start(role, &run),
            None => HelperProcess::worker(&run),
        };
        let started = (0..workers).map(start).collect::<anyhow::Result<Vec<_>>>()?;
        let mut settings = PoolSettings::new(run.as_str());
        change(&mut settings);
        let made_of = vec![0; points];
        let supply = Box::new(JoiningWorkers);
        let mut pool = Pool::new(port, supply, Interrupt::new(), settings, vec![definition], &made_of);
        pool.gather(workers)?;
        let tangent = if role.is_some() { TangentKind::None } else { TangentKind::TrussLikeSlip };
        Ok(Self { pool, tangent, points, calls: 0, workers: started })
    }

    /// Asks all points for one increment and returns the time per call, us. Points start from the initial state each
    /// time and no two trials of a pool are equal, so every round costs the same and nothing is skipped.
    ///
    /// # Errors
    /// The workers are lost or refuse.
    pub(crate) fn round(&mut self) -> anyhow::Result<f64> {
        self.calls += 1;
        let options = TrialOptions { tangent: self.tangent, ..TrialOptions::default() };
        let strain = |point: usize| STRAIN * (1.0 + 1e-3 * point as f64 + 1e-6 * f64::from(self.calls));
        let target = |point: usize| Tensor2::from_plane([[0.0, 0.0], [0.0, -strain(point)]]);
        let trials: Vec<_> =
            (0..self.points).map(|point| PointTrial { point, target: target(point), options }).collect();
        Ok(self.ask(&trials)?.as_secs_f64() * 1e6 / self.points as f64)
    }

    /// Has trials answered and returns how long that took.
    ///
    /// # Errors
    /// The workers are lost or refuse.
    pub(crate) fn ask(&mut self, trials: &[PointTrial]) -> anyhow::Result<Duration> {
        let begin = Instant::now();
        self.pool.evaluate(trials)?;
        Ok(begin.elapsed())
    }

    /// Makes the last answers the committed states.
    ///
    /// # Errors
    /// As the pool's.
    pub(crate) fn commit(&mut self) -> anyhow::Result<()> {
        Ok(self.pool.commit()?)
    }

    /// Processor time that the workers' first threads have used, which is where they compute, s.
    pub(crate) fn worker_seconds(&self) -> f64 {
        self.workers.iter().map(|worker| processor_seconds(&worker.pid().to_string())).sum()
    }

    /// Processor time of the calling thread, which is the pool's, and of the workers' first threads, s.
    pub(crate) fn processor_seconds(&self) -> f64 {
        processor_seconds("thread-self") + self.worker_seconds()
    }

    /// Points of the pool.
    pub(crate) fn points(&self) -> usize {
        self.points
    }

    pub(crate) fn statistics(&self) -> PoolStatistics {
        self.pool.statistics()
    }
}
