//! `grainspan rve-server --run RUN`: one worker of a run, started by the run itself or by hand.

use super::exit::{Exit, Failure};
use crate::workers::{DYING, follow_parent};
use protocol::transport::shared_memory::{RunDirectory, SharedMemoryWorkerPort};
use rve_server::engine::GrainEngine;
use rve_server::server::{ExitReason, ServeOptions, serve};
use std::io::IsTerminal;
use std::time::Duration;

/// States that a worker keeps: about 15 MB at 400 discs, enough for the points of a two-worker run of the shipped scene.
const STATE_CACHE: u32 = 256;

/// Engines of this program.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default)]
enum Engine {
    /// Periodic cells of discs
    #[default]
    Grains,
}

/// Arguments of `grainspan rve-server`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example, in two terminals:
  grainspan run scenes/biaxial.toml --attach mine
  grainspan rve-server --run mine")]
pub(crate) struct Arguments {
    /// Name of the run to join
    #[arg(long, value_name = "RUN")]
    run: String,
    /// What solves the RVEs
    #[arg(long, value_enum, default_value_t)]
    engine: Engine,
    /// Snapshots kept at hand
    #[arg(long, value_name = "N", default_value_t = STATE_CACHE)]
    state_cache: u32,
    /// Seconds to wait for the run to appear
    #[arg(long, value_name = "SECONDS", default_value_t = 5)]
    patience: u64,
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
    follow_parent(arguments.parent, &arguments.run)
        .map_err(|error| Failure::new(Exit::WorkersLost, format!("could not follow the run's process: {error}")))?;
    let Engine::Grains = arguments.engine;
    let mut port = SharedMemoryWorkerPort::join(&arguments.run, Duration::from_secs(arguments.patience))
        .map_err(|error| worker_failed(&error))?;
    let options = ServeOptions { state_cache: arguments.state_cache, ..ServeOptions::new(&arguments.run) };
    let served = serve(&mut GrainEngine, &mut port, &options);
    drop(port);
    // The run may have ended without a chance to tidy up; one that lives is left alone, and there is nobody to tell.
    let patience = if matches!(served, Ok(ExitReason::MacroLost(_))) { DYING } else { Duration::ZERO };
    let _ = RunDirectory::remove_once_dead(&arguments.run, patience);
    match served.map_err(|error| worker_failed(&error))? {
        ExitReason::Drained | ExitReason::Dismissed => Ok(Exit::Done),
        ExitReason::MacroLost(reason) => Err(Failure::new(Exit::WorkersLost, format!("the run has ended: {reason}"))),
    }
}

/// Warnings for the person, or the run, that reads this worker's standard error; nothing that is not asked for.
fn log_to_stderr() {
    let subscriber = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(tracing::Level::WARN)
        .finish();
    // The binary plays one role and sets this once.
    let _ = tracing::subscriber::set_global_default(subscriber);
}
