//! Starts what an agent needs: a channel and workers on this host, a signal handler, and the connection.

use super::Arguments;
use crate::engines::Catalogue;
use crate::exit::{Exit, Failure};
use crate::side_by_side::cores;
use crate::stderr::tell;
use crate::workers::{SignalWatch, allow_open_files_for};
use grain_pool::processes::{Engine, LaunchPlan, WorkerProcesses, channel_limits, most_workers, run_name};
use hosts::agent::{Agent, AgentEnd, AgentError, AgentFigures, AgentOptions};
use hosts::{JoinError, Limits, Target};
use macro_solver::pool::Interrupt;
use protocol::transport::shared_memory::{RunDirectory, SharedMemoryMacroPort};
use std::io::IsTerminal;
use std::time::Duration;

/// How long a standing agent looks for a run: for ever, in human terms.
const FOR_EVER: Duration = Duration::from_secs(100 * 365 * 86_400);

/// Serves one run, or one after the other.
///
/// # Errors
/// No run is found, or it refuses this host.
pub(super) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    log_to_stderr();
    // Said at once and not after minutes of looking; later the file may come and go with its runs.
    if let Err(error) = find(arguments)
        && !matches!(error, JoinError::Unreachable(_))
    {
        return Err(Failure::new(Exit::BadInput, error));
    }
    let catalogue = Catalogue::read().and_then(|catalogue| catalogue.find(&arguments.engine));
    let engine = catalogue.map_err(|error| Failure::new(Exit::BadInput, format!("{error:#}")))?;
    let workers = arguments.workers.unwrap_or_else(cores).get();
    if workers > most_workers() {
        let problem = format!("--workers {workers}: more than {}, the most on this host", most_workers());
        return Err(Failure::new(Exit::BadInput, problem));
    }
    let interrupt = Interrupt::new();
    let signals = SignalWatch::start(interrupt.clone())
        .map_err(|error| Failure::new(Exit::WorkersLost, format!("could not watch for signals: {error}")))?;
    loop {
        let (ended, figures) = serve_one(arguments, &engine, workers, &interrupt, &signals)?;
        tell(closing_line(&ended, figures));
        match ended {
            Ok(AgentEnd::RunEnded(_)) if arguments.standing => {}
            Ok(AgentEnd::RunEnded(_)) => return Ok(Exit::Done),
            Ok(AgentEnd::Interrupted) => return Ok(Exit::Interrupted),
            Err(AgentError::Join(
                error @ (JoinError::Refused(_) | JoinError::Given(_) | JoinError::Untrusted(..)),
            )) => {
                return Err(Failure::new(Exit::BadInput, error));
            }
            Err(error) => return Err(Failure::new(Exit::WorkersLost, error)),
        }
    }
}

fn serve_one(
    arguments: &Arguments,
    engine: &Engine,
    workers: usize,
    interrupt: &Interrupt,
    signals: &SignalWatch,
) -> Result<(Result<AgentEnd, AgentError>, AgentFigures), Failure> {
    allow_open_files_for(workers)?;
    // A run or agent that was killed on this host has left its memory. Failure harms nobody.
    let _ = RunDirectory::clean();
    let name = run_name("agent");
    let local = SharedMemoryMacroPort::create(&name, channel_limits(workers, &[]))
        .map_err(|error| Failure::new(Exit::BadInput, error))?;
    signals.wakes(protocol::transport::MacroPort::waker(&local));
    let mut supply = WorkerProcesses::start(LaunchPlan::for_run(&name, engine, workers), interrupt)
        .map_err(|error| Failure::new(Exit::WorkersLost, format!("could not start {workers} workers: {error}")))?;
    let options = AgentOptions {
        limits: Limits { silence: Duration::from_secs_f64(arguments.silence), ..Limits::default() },
        state_bytes: u64::from(arguments.keep_states) << 20,
        timeout: if arguments.standing { FOR_EVER } else { Duration::from_secs_f64(arguments.timeout) },
    };
    let (join, secret) = (arguments.join.clone(), arguments.secret.clone());
    let target = move || find_target(&join, secret.as_deref());
    let mut agent = Agent::new(local, &mut supply, target, options, interrupt.clone());
    let ended = agent.serve();
    let figures = agent.figures();
    Ok((ended, figures))
}

fn find(arguments: &Arguments) -> Result<Target, JoinError> {
    find_target(&arguments.join, arguments.secret.as_deref())
}

/// Where the run is now. A join file that is not there yet, or no longer, may come.
fn find_target(join: &str, secret: Option<&std::path::Path>) -> Result<Target, JoinError> {
    Target::find(join, secret).map_err(|error| {
        if error.is_missing() {
            JoinError::Unreachable(error.to_string())
        } else {
            JoinError::Given(error.to_string())
        }
    })
}

fn closing_line(ended: &Result<AgentEnd, AgentError>, figures: AgentFigures) -> String {
    let how = match ended {
        Ok(AgentEnd::RunEnded(reason)) => reason.clone(),
        Ok(AgentEnd::Interrupted) => "stopped".to_owned(),
        Err(_) => "given up".to_owned(),
    };
    let AgentFigures { replies, joined, stale_replies, damaged_replies, refused } = figures;
    let mut line = format!("{how}: {replies} trials solved here");
    for (count, what) in [
        (joined.saturating_sub(1), "joined again"),
        (stale_replies, "replies to lost connections dropped"),
        (damaged_replies, "damaged replies"),
        (refused, "messages refused"),
    ] {
        if count > 0 {
            line.push_str(&format!(", {what}: {count}"));
        }
    }
    line
}

/// What happens is written to standard error, which a person or a batch system reads.
fn log_to_stderr() {
    let subscriber = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(tracing::Level::INFO)
        .finish();
    // The binary plays one role and sets this once.
    let _ = tracing::subscriber::set_global_default(subscriber);
}
