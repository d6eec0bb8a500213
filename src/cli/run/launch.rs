//! Starts everything that a run needs beside the solver: channels, workers, signal handler, record.

use super::Arguments;
use super::drive::{Manner, drive};
use super::folder::OutputFolder;
use super::resume::{Continued, RunNote};
use crate::cli::exit::{Exit, Failure};
use crate::engines::Crew;
use crate::workers::{Fleet, LaunchPlan, Progress, RunBeacon, SignalWatch, WorkerProcesses, run_name};
use macro_solver::material::MaterialError;
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, WorkerSupply};
use protocol::transport::MacroPort;
use protocol::transport::shared_memory::{ChannelLimits, RunDirectory, SharedMemoryMacroPort, Waiting};
use scene_reader::Scene;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

/// How long an attached run waits for workers, at the start and when all are gone: people or supervisors start those.
const ATTACHED_PATIENCE: Duration = Duration::from_secs(3600);

/// Workers per core beyond which a run asks whether they are meant.
const MOST_PER_CORE: usize = 8;

/// Workers that any machine takes, whatever its cores; measured on one core.
const MOST_ANYWHERE: usize = 64;

/// Runs the scene on a pool of worker processes of the crew's engines.
///
/// # Errors
/// Channels or workers cannot be started; whatever ends the run before its time.
pub(super) fn run(
    scene: &Scene,
    crew: &Crew,
    folder: &OutputFolder,
    arguments: &Arguments,
    note: &RunNote,
    continued: Option<Continued>,
) -> Result<Exit, Failure> {
    let begun = Instant::now();
    let interrupt = Interrupt::new();
    let signals = SignalWatch::start(interrupt.clone()).map_err(|error| failed("watch for signals", &error))?;
    let name = arguments.attach.clone().unwrap_or_else(|| run_name(&scene.name));
    let asked = workers(arguments);
    let waiting = arguments.wait.map(Waiting::from).or(scene.pool.wait).unwrap_or_default();
    let limits = ChannelLimits { waiting, ..channel_limits(asked) };
    let port = SharedMemoryMacroPort::create(&name, limits).map_err(|error| Failure::new(Exit::BadInput, error))?;
    // Whoever killed a run before its first worker was there left its memory to nobody else. Failing here harms no run.
    match RunDirectory::clean() {
        Ok(names) if !names.is_empty() => tracing::info!(?names, "removed what dead runs had left"),
        _ => {}
    }
    signals.wakes(port.waker());
    let mut beacon = RunBeacon::light(port.record(), Progress::new(scene.document.path(), folder.path()));

    let workers = asked;
    let mut settings = PoolSettings::new(name.clone());
    let differences = crew.differences();
    // What an engine cannot do was found out before; where none lacks it, workers that join by hand are held to it.
    settings.tangents = if differences.contains(&true) { Vec::new() } else { scene.problem.tangents() };
    let shares = crew.shares(&scene.materials);
    settings.engines = shares.engines;
    let supply: Box<dyn WorkerSupply> = if arguments.attach.is_some() {
        settings.patience = ATTACHED_PATIENCE;
        if !arguments.quiet {
            for member in &crew.members {
                let engine = &member.engine;
                let choice = if engine.is_built_in() { String::new() } else { format!(" --engine {}", engine.name) };
                eprintln!("waiting for {workers} x `grainspan rve-server --run {name}{choice}`");
            }
        }
        Box::new(JoiningWorkers)
    } else {
        let mut fleet = Fleet(Vec::new());
        for member in &crew.members {
            let plan = LaunchPlan::for_run(&name, &member.engine, workers);
            let plan = LaunchPlan { restarts: scene.pool.restarts.unwrap_or(plan.restarts), ..plan };
            let started = WorkerProcesses::start(plan, &interrupt);
            fleet.0.push(started.map_err(|error| failed(&format!("start {workers} workers"), &error))?);
        }
        Box::new(fleet)
    };
    settings.message_bytes = usize::try_from(limits.message_bytes).unwrap_or(usize::MAX);
    scene.pool.apply(&mut settings);
    let mut pool = Pool::new(port, supply, interrupt, settings, shares.definitions, &shares.made_of);
    let watcher = beacon.clone();
    pool.report_to(move |workers| watcher.report(workers));
    pool.gather(workers * crew.members.len()).map_err(|error| match error {
        MaterialError::Interrupted => Failure::new(Exit::Interrupted, "interrupted before the first step"),
        error => Failure::new(Exit::WorkersLost, error),
    })?;
    let workers = pool.workers();
    let manner = Manner { crew, workers, begun, quiet: arguments.quiet, note, continued, beside: &mut beacon };
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

/// Refuses more workers than a machine can use: `--workers 5000` is a slip, and thousands of processes would leave no room even
/// for the command that ends them. A scene that means it says so.
///
/// # Errors
/// More workers are asked for than the limit, which the message names together with the key that lifts it.
pub(super) fn refuse_too_many(scene: &Scene, crew: &Crew, arguments: &Arguments) -> Result<(), Failure> {
    let (workers, engines) = (workers(arguments), crew.members.len());
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let limit = scene.pool.most_workers.unwrap_or_else(|| usual_most(cores));
    let wanted = workers.saturating_mul(engines);
    if wanted <= limit {
        return Ok(());
    }
    let each = if engines > 1 { format!(" of each of {engines} engines") } else { String::new() };
    Err(Failure::new(
        Exit::BadInput,
        format!(
            "--workers {workers}: {workers} workers{each} are more than {limit}, the most on this machine of {cores} cores\nhint: \
             one worker per core is fastest; if so many are meant, add --set pool.most_workers={wanted}"
        ),
    ))
}

/// Most workers that make sense on so many cores: beyond that they only wait for each other.
fn usual_most(cores: usize) -> usize {
    cores.saturating_mul(MOST_PER_CORE).max(MOST_ANYWHERE)
}

/// Room for all workers, for as many that have died and are not tidied up yet, and for some that come to help.
fn channel_limits(workers: usize) -> ChannelLimits {
    let usual = ChannelLimits::default();
    let wanted = u32::try_from(2 * workers + 16).unwrap_or(u32::MAX);
    ChannelLimits { workers: usual.workers.max(wanted), ..usual }
}

fn failed(what: &str, error: &std::io::Error) -> Failure {
    Failure::new(Exit::WorkersLost, format!("could not {what}: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_machines_take_64_workers_and_large_ones_8_per_core() {
        assert_eq!([1, 2, 8, 9, 128].map(usual_most), [64, 64, 64, 72, 1024]);
    }
}
