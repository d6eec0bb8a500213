//! Starts everything that a run needs besides the solver: channels, workers, signal handler, status file.

use super::arguments::Arguments;
use super::control::stop_without_workers;
use super::execute::{RunContext, execute};
use super::folder::OutputFolder;
use super::hosts;
use super::resume::{Continued, RunDescription, added_up};
use crate::engines::{EngineAssignment, PoolDefinitions};
use crate::exit::{Exit, Failure};
use crate::side_by_side::cores;
use crate::stderr::tell;
use crate::workers::{RunProgress, SignalWatch, StatusFile, allow_open_files_for};
use grain_pool::processes::{LaunchPlan, WorkerGroups, WorkerProcesses, channel_limits, most_workers, run_name};
use macro_solver::material::MaterialError;
use macro_solver::material::error_estimate::{SamplePlan, sample};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, SupplyStatus, WorkerSupply};
use page::Controls;
use protocol::transport::MacroPort;
use protocol::transport::shared_memory::{ChannelLimits, RunDirectory, SharedMemoryMacroPort, Waiting};
use scene_reader::Scene;
use std::time::{Duration, Instant};

/// How long an attached run waits for workers, at the start and when all are gone: they are started by hand or by a supervisor.
const ATTACHED_TIMEOUT: Duration = Duration::from_secs(3600);

/// Signals that ask for the end of a run, from its first moment on.
pub(super) struct Watch {
    /// Raised by the first of them.
    pub(super) interrupt: Interrupt,
    signals: SignalWatch,
}

impl Watch {
    /// Starts to watch.
    ///
    /// # Errors
    /// The system refuses.
    pub(super) fn start() -> Result<Self, Failure> {
        let interrupt = Interrupt::new();
        let signals = SignalWatch::start(interrupt.clone()).map_err(|error| failed("watch for signals", &error))?;
        Ok(Self { interrupt, signals })
    }

    /// Ends a run that was asked to end before its folder was touched.
    ///
    /// # Errors
    /// It was.
    pub(super) fn go_on(&self) -> Result<(), Failure> {
        if self.interrupt.is_raised() {
            return Err(Failure::new(
                Exit::Interrupted,
                "interrupted before the run began; nothing has been written",
            ));
        }
        Ok(())
    }
}

/// Channels of a run whose folder has not been touched yet: what they refuse must not cost an earlier run its results.
pub(super) struct Channels {
    begun: Instant,
    name: String,
    served: PoolDefinitions,
    replicas: SamplePlan,
    limits: ChannelLimits,
    port: SharedMemoryMacroPort,
    listening: hosts::Listening,
}

/// Opens the channels.
///
/// # Errors
/// Too few open files, a name that is none or that a living run has, an error that no point can estimate, an endpoint that is taken, shared
/// memory that is full.
pub(super) fn open(scene: &Scene, assignment: &EngineAssignment, arguments: &Arguments) -> Result<Channels, Failure> {
    let begun = Instant::now();
    let name = arguments.attach.clone().unwrap_or_else(|| run_name(&scene.name));
    let requested = workers(arguments);
    allow_open_files_for(requested)?;
    let waiting = arguments.wait.map(Waiting::from).or(scene.pool.wait).unwrap_or_default();
    let mut served = assignment.pool_definitions(&scene.materials);
    let replicas = replicas_of(scene, assignment)?;
    served.add_replicas(&replicas, &scene.materials);
    // Agents of other hosts pass messages of the usual length on.
    let definitions = if arguments.listen.is_some() { &[] } else { &served.definitions[..] };
    let limits = ChannelLimits { waiting, ..channel_limits(requested, definitions) };
    let port = SharedMemoryMacroPort::create(&name, limits).map_err(|error| Failure::new(Exit::BadInput, error))?;
    let listening = hosts::listen(arguments, &name)?;
    Ok(Channels { begun, name, served, replicas, limits, port, listening })
}

/// Runs the scene on a pool of worker processes of the assigned engines.
///
/// # Errors
/// Workers cannot be started; whatever ends the run before its time.
pub(super) fn run(
    scene: &Scene,
    assignment: &EngineAssignment,
    folder: &OutputFolder,
    arguments: &Arguments,
    (watch, channels): (Watch, Channels),
    description: &RunDescription,
    continued: Option<Continued>,
) -> Result<Exit, Failure> {
    let Watch { interrupt, signals } = watch;
    let Channels { begun, name, served, replicas, limits, port, listening } = channels;
    let requested = workers(arguments);
    // The memory of a run that was killed before its first worker joined is removed by no one else. Failure harms no run.
    match RunDirectory::clean() {
        Ok(names) if !names.is_empty() => tracing::info!(?names, "removed the remains of dead runs"),
        _ => {}
    }
    signals.wakes(port.waker());
    let mut status_file = StatusFile::create(port.record(), RunProgress::new(scene.document.path(), folder.path()));
    let (port, hosts) = hosts::open(port, listening, arguments, folder.path())?;

    let joins_later = arguments.attach.is_some() || hosts.is_listening();
    let settings = pool_settings(scene, assignment, &name, &limits, &served, joins_later)?;
    let supply = supply(scene, assignment, arguments, &name, hosts.is_listening(), &interrupt)?;
    let mut pool = Pool::new(port, supply, interrupt.clone(), settings, served.definitions, &served.made_of);
    let (watcher, controls, raised) = (status_file.clone(), Controls::of(folder.path()), interrupt.clone());
    pool.report_to(move |workers| {
        watcher.report(workers);
        if workers.is_empty() {
            stop_without_workers(&controls, &raised);
        }
    });
    pool.gather((requested * assignment.engines.len()).max(1)).map_err(|error| match error {
        MaterialError::Interrupted => Failure::new(Exit::Interrupted, "interrupted before the first step"),
        MaterialError::DefinitionRefused(reason) => Failure::new(Exit::BadInput, reason),
        error => Failure::new(Exit::WorkersLost, error),
    })?;
    let workers = pool.workers();
    let before = continued.as_ref().map(|continued| continued.description.hosts.clone()).unwrap_or_default();
    let context = RunContext {
        assignment,
        replicas,
        workers,
        begun,
        quiet: arguments.quiet,
        description,
        continued,
        interrupt,
        observer: &mut status_file,
        hosts: &|| added_up(before.clone(), hosts.figures()),
    };
    execute(scene, pool, folder, context)
}

/// Settings of the pool, those of the scene included. `joins_later`: workers may be started by hand, or on other hosts.
fn pool_settings(
    scene: &Scene,
    assignment: &EngineAssignment,
    run: &str,
    limits: &ChannelLimits,
    served: &PoolDefinitions,
    joins_later: bool,
) -> Result<PoolSettings, Failure> {
    let mut settings = PoolSettings::new(run.to_owned());
    // The assigned engines have been checked; workers that join by hand must have the same tangents.
    let differ = assignment.differences().contains(&true);
    settings.tangents = if differ { Vec::new() } else { scene.problem.requested_tangents() };
    settings.engines = served.engines.clone();
    settings.versions = assignment.own_versions();
    settings.lacking = served.lacking.clone();
    settings.message_bytes = limits.message_length();
    if joins_later {
        settings.worker_timeout = ATTACHED_TIMEOUT;
    }
    Ok(scene.pool.apply(&scene.document, &settings)?)
}

/// Where the workers of a run come from; those that are its own have been started then.
fn supply(
    scene: &Scene,
    assignment: &EngineAssignment,
    arguments: &Arguments,
    run: &str,
    is_listening: bool,
    interrupt: &Interrupt,
) -> Result<Box<dyn WorkerSupply>, Failure> {
    let workers = workers(arguments);
    if arguments.attach.is_some() {
        for assigned in assignment.engines.iter().filter(|_| !arguments.quiet) {
            let engine = &assigned.engine;
            let choice = if engine.is_built_in() { String::new() } else { format!(" --engine {}", engine.name) };
            tell(format_args!("waiting for {workers} x `grainspan rve-server --run {run}{choice}`"));
        }
        return Ok(Box::new(JoiningWorkers));
    }
    let mut groups = WorkerGroups(Vec::new());
    for assigned in assignment.engines.iter().filter(|_| workers > 0) {
        let plan = LaunchPlan::for_run(run, &assigned.engine, workers);
        let plan = LaunchPlan { restarts: scene.pool.restarts.unwrap_or(plan.restarts), ..plan };
        let started = WorkerProcesses::start(plan, interrupt);
        groups.0.push(started.map_err(|error| failed(&format!("start {workers} workers"), &error))?);
    }
    Ok(if is_listening { Box::new(Welcoming(groups)) } else { Box::new(groups) })
}

/// Gauss points that are solved once more to estimate the error of the stresses.
///
/// # Errors
/// `rve.error` needs the estimate, and no point can give one.
fn replicas_of(scene: &Scene, assignment: &EngineAssignment) -> Result<SamplePlan, Failure> {
    if !scene.error_estimate.enabled {
        return Ok(SamplePlan::default());
    }
    let plan = sample(&assignment.replicated_kinds(&scene.materials), &scene.error_estimate);
    if plan.is_empty() && scene.problem.error_control.is_some() {
        let problem = "rve.error needs Gauss points that the built-in engine solves: the error of other engines is not estimated\n\
                       hint: give rve.accuracy instead";
        return Err(Failure::new(Exit::BadInput, problem));
    }
    Ok(plan)
}

/// Workers to start or to wait for.
fn workers(arguments: &Arguments) -> usize {
    let default = || match arguments.attach {
        Some(_) => 1,
        None => cores().get(),
    };
    arguments.workers.unwrap_or_else(default)
}

/// Workers of this host in a run that others may join: when none of them is left, more may still come.
struct Welcoming(WorkerGroups);

impl WorkerSupply for Welcoming {
    fn joined(&mut self, pid: u32) {
        self.0.joined(pid);
    }

    fn refused(&mut self, pid: u32, reason: &str) {
        self.0.refused(pid, reason);
    }

    fn lost(&mut self, pid: u32, had_answered: bool) {
        self.0.lost(pid, had_answered);
    }

    fn left(&mut self, pid: u32, had_answered: bool) {
        self.0.left(pid, had_answered);
    }

    fn tend(&mut self) -> SupplyStatus {
        match self.0.tend() {
            SupplyStatus::Exhausted(_) => SupplyStatus::Expected { check_again: Duration::from_secs(1) },
            expected => expected,
        }
    }

    fn restarts(&self) -> u64 {
        self.0.restarts()
    }

    fn finish(&mut self) {
        self.0.finish();
    }
}

/// Refuses more workers than a machine can use: thousands of processes leave no room even for the command that ends them. The key
/// `pool.most_workers` of the scene raises the limit.
///
/// # Errors
/// More workers are requested than the limit; the message names both and the key.
pub(super) fn refuse_too_many(
    scene: &Scene,
    assignment: &EngineAssignment,
    arguments: &Arguments,
) -> Result<(), Failure> {
    let (workers, engines) = (workers(arguments), assignment.engines.len());
    let limit = scene.pool.most_workers.unwrap_or_else(most_workers);
    let wanted = workers.saturating_mul(engines);
    if wanted <= limit {
        return Ok(());
    }
    let each = if engines > 1 { format!(" of each of {engines} engines") } else { String::new() };
    Err(Failure::new(
        Exit::BadInput,
        format!(
            "--workers {workers}: {workers} workers{each} are more than {limit}, the most on this machine of {} cores\nhint: \
             one worker per core is fastest; to use more, add --set pool.most_workers={wanted}",
            cores()
        ),
    ))
}

fn failed(what: &str, error: &std::io::Error) -> Failure {
    Failure::new(Exit::WorkersLost, format!("could not {what}: {error}"))
}
