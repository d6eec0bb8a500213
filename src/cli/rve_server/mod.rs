//! `grainspan rve-server --run RUN`: one worker of a run, started by the run itself or by hand.

mod standing;

use crate::engines::{BUILT_IN, Catalogue};
use crate::exit::{Exit, Failure};
use crate::workers::{RUN_END_TIMEOUT, follow_parent};
use grain_pool::processes::OWN_NAME;
use protocol::transport::shared_memory::{RunDirectory, SharedMemoryWorkerPort};
use rve_server::server::{BuiltInEngine, ExitReason, ServeError, ServeOptions, built_in_engine, serve};
use std::io::IsTerminal;
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::Duration;

/// States that a worker keeps: about 15 MB at 400 discs, enough for the points of a two-worker run of the shipped scene.
const STATE_CACHE: u32 = 256;

/// Longest wait for a run, s: a month.
const LONGEST_TIMEOUT: u64 = 31 * 24 * 3600;

/// Arguments of `grainspan rve-server`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example, in two terminals:
  grainspan run scenes/biaxial.toml --attach mine
  grainspan rve-server --run mine

A standing worker serves every run of that name, one after the other, until it gets SIGTERM:
  grainspan rve-server --run mine --standing")]
pub(crate) struct Arguments {
    /// Name of the run to join
    #[arg(long, value_name = "RUN")]
    run: String,
    /// Wait for runs of this name for ever and serve one after the other
    #[arg(long, conflicts_with_all = ["timeout", "parent"])]
    standing: bool,
    /// Engine that solves the RVEs: the built-in one, or one of the catalogue, see docs/guide/external-engines.md
    #[arg(long, value_name = "NAME", default_value = BUILT_IN)]
    engine: String,
    /// Snapshots kept in memory
    #[arg(long, value_name = "N", default_value_t = STATE_CACHE)]
    state_cache: u32,
    /// Seconds to wait for the run to appear
    #[arg(long, alias = "patience", value_name = "SECONDS", default_value_t = 5,
          value_parser = clap::value_parser!(u64).range(..=LONGEST_TIMEOUT))]
    timeout: u64,
    /// End when this process, which must be the parent, ends
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

/// Serves until the run dismisses this worker.
///
/// # Errors
/// There is no such run, it refuses this worker, or the channel to it breaks.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    log_to_stderr();
    let worker_failed = |error: &dyn std::fmt::Display| Failure::new(Exit::BadInput, error);
    let Some(engine) = built_in_engine(&arguments.engine) else {
        if arguments.standing {
            let engine = &arguments.engine;
            let message =
                format!("--standing serves with engines inside this program only; start `{engine}` for each run");
            return Err(Failure::new(Exit::BadInput, message));
        }
        return Err(become_external(arguments));
    };
    // A worker started by the link to the running program is named after the link; tools that list processes look for the program. Where the
    // system does not take it the name is only a less helpful one.
    let _ = std::fs::write("/proc/self/comm", OWN_NAME);
    follow_parent(arguments.parent, &arguments.run).map_err(|error| {
        // A run that has ended before its first worker joined is removed by no one else.
        let _ = RunDirectory::remove_once_dead(&arguments.run, RUN_END_TIMEOUT);
        Failure::new(Exit::WorkersLost, format!("could not follow the run's process: {error}"))
    })?;
    if arguments.standing {
        return standing::serve_for_ever(&arguments.run, |port| serve_one(engine, port, arguments));
    }
    let port = SharedMemoryWorkerPort::join(&arguments.run, Duration::from_secs(arguments.timeout))
        .map_err(|error| worker_failed(&error))?;
    match serve_one(engine, port, arguments).map_err(|error| worker_failed(&error))? {
        ExitReason::Drained | ExitReason::Dismissed => Ok(Exit::Done),
        ExitReason::MacroLost(reason) => Err(Failure::new(Exit::WorkersLost, format!("the run has ended: {reason}"))),
    }
}

/// Serves the run behind the port until it ends or dismisses this worker.
fn serve_one(
    engine: BuiltInEngine,
    mut port: SharedMemoryWorkerPort,
    arguments: &Arguments,
) -> Result<ExitReason, ServeError> {
    let options = ServeOptions { state_cache: arguments.state_cache, ..ServeOptions::new(&arguments.run) };
    let served = serve(&mut *(engine.create)(), &mut port, &options);
    drop(port);
    // The run may have ended without removing its memory; a live one is left alone. No one is left to report a failure to.
    let timeout = if matches!(served, Ok(ExitReason::MacroLost(_))) { RUN_END_TIMEOUT } else { Duration::ZERO };
    let _ = RunDirectory::remove_once_dead(&arguments.run, timeout);
    served
}

/// Replaces this process by a worker of another engine; returns only when that fails.
fn become_external(arguments: &Arguments) -> Failure {
    let engine = match Catalogue::read().and_then(|catalogue| catalogue.find(&arguments.engine)) {
        Ok(engine) => engine,
        Err(error) => return Failure::new(Exit::BadInput, format!("{error:#}")),
    };
    let mut command = Command::new(&engine.program);
    command.args(&engine.arguments).envs(&engine.environment).args(["--run", &arguments.run]);
    command.args(["--state-cache", &arguments.state_cache.to_string()]);
    command.args(["--patience", &arguments.timeout.to_string()]);
    if let Some(parent) = arguments.parent {
        command.args(["--parent", &parent.to_string()]);
    }
    let error = command.exec();
    let program = engine.program.display();
    Failure::new(Exit::BadInput, format!("engine '{}' cannot be started: {program}: {error}", engine.name))
}

/// Warnings go to standard error, which the run, or a person, reads.
fn log_to_stderr() {
    let subscriber = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(tracing::Level::WARN)
        .finish();
    // The binary plays one role and sets this once.
    let _ = tracing::subscriber::set_global_default(subscriber);
}
