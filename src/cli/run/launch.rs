//! Starts everything that a run needs beside the solver: channels, workers, signal handler, record.

use super::Arguments;
use super::drive::{Manner, drive};
use super::folder::OutputFolder;
use super::resume::{Continued, RunNote};
use crate::cli::exit::{Exit, Failure};
use crate::scene::Scene;
use crate::workers::{LaunchPlan, Progress, RunBeacon, SignalWatch, WorkerProcesses, run_name};
use macro_solver::material::MaterialError;
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, WorkerSupply};
use protocol::transport::MacroPort;
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort};
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

/// How long an attached run waits for workers, at the start and when all are gone: people or supervisors start those.
const ATTACHED_PATIENCE: Duration = Duration::from_secs(3600);

/// Engine of the workers that a run starts itself.
const ENGINE: &str = "grains";

/// Runs the scene on a pool of worker processes.
///
/// # Errors
/// Channels or workers cannot be started; whatever ends the run before its time.
pub(super) fn run(
    scene: &Scene,
    folder: &OutputFolder,
    arguments: &Arguments,
    note: &RunNote,
    continued: Option<Continued>,
) -> Result<Exit, Failure> {
    let begun = Instant::now();
    let interrupt = Interrupt::new();
    let signals = SignalWatch::start(interrupt.clone()).map_err(|error| failed("watch for signals", &error))?;
    let name = arguments.attach.clone().unwrap_or_else(|| run_name(&scene.name));
    let limits = ChannelLimits { waiting: arguments.wait.into(), ..ChannelLimits::default() };
    let port = SharedMemoryMacroPort::create(&name, limits).map_err(|error| Failure::new(Exit::BadInput, error))?;
    signals.wakes(port.waker());
    let mut beacon = RunBeacon::light(port.record(), Progress::new(scene.document.path(), folder.path()));

    let workers = workers(arguments);
    let mut settings = PoolSettings::new(name.clone());
    settings.tangents = vec![scene.problem.strategy.tangent];
    scene.pool.apply(&mut settings);
    let supply: Box<dyn WorkerSupply> = if arguments.attach.is_some() {
        settings.patience = ATTACHED_PATIENCE;
        if !arguments.quiet {
            eprintln!("waiting for {workers} x `grainspan rve-server --run {name}`");
        }
        Box::new(JoiningWorkers)
    } else {
        let started = LaunchPlan::this_program(&name, ENGINE, workers).and_then(WorkerProcesses::start);
        Box::new(started.map_err(|error| failed("start the workers", &error))?)
    };
    let definitions = vec![scene.definition.to_protocol()];
    let made_of = vec![0; scene.problem.point_count()];
    let mut pool = Pool::new(port, supply, interrupt, settings, definitions, &made_of);
    pool.gather(workers).map_err(|error| match error {
        MaterialError::Interrupted => Failure::new(Exit::Interrupted, "interrupted before the first step"),
        error => Failure::new(Exit::WorkersLost, error),
    })?;
    let workers = pool.workers();
    let manner = Manner { workers, begun, quiet: arguments.quiet, note, continued, beside: &mut beacon };
    drive(scene, pool, folder, manner)
}

/// Workers to start, or to wait for.
fn workers(arguments: &Arguments) -> usize {
    let unsaid = || match arguments.attach {
        Some(_) => NonZeroUsize::MIN,
        None => std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
    };
    arguments.workers.unwrap_or_else(unsaid).get()
}

fn failed(what: &str, error: &std::io::Error) -> Failure {
    Failure::new(Exit::WorkersLost, format!("could not {what}: {error}"))
}
