//! The worker loop: join a run, take definitions and messages of jobs, answer, leave on request or when the macro process is lost.
//!
//! A worker owns no Gauss point and no truth: it can vanish at any moment and costs the run only the jobs it was
//! working on. Every successful reply therefore carries the snapshot of its trial state; a copy of 50 kB costs about
//! 10 us against solves of a millisecond and more.

mod engines;
mod job_runner;
mod state_cache;
#[cfg(test)]
mod tests;

pub use engines::{BUILT_IN_ENGINES, BuiltInEngine, built_in_engine};

use job_runner::{JobRunner, OwnedReply};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedReply, TransportError, WorkerEvent, WorkerPort};
use protocol::wire::TrialJob;
use protocol::{Definition, PROTOCOL_VERSION, RveEngine, RveError};
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use thiserror::Error;

/// How one worker behaves.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Name of the run to join.
    pub run: String,
    /// How many snapshots the worker keeps at hand.
    pub state_cache: u32,
    /// How long a macro may take to answer the hello.
    pub grace: Duration,
}

impl ServeOptions {
    /// Sensible values for joining `run`: 64 states, 30 s grace.
    pub fn new(run: impl Into<String>) -> Self {
        Self { run: run.into(), state_cache: 64, grace: Duration::from_secs(30) }
    }
}

/// Why a worker left in good order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ExitReason {
    /// The macro process requested that it finish its jobs and leave.
    Drained,
    /// The macro dismissed it.
    Dismissed,
    /// The macro ended without a word.
    MacroLost(String),
}

/// Why a worker could not serve.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The macro refused the hello; the reason names the remedy.
    #[error("the run refused this worker: {0}")]
    Refused(String),
    /// The macro did not answer the hello.
    #[error("the run did not answer within {:.0} s; is its macro process alive?", .0.as_secs_f64())]
    NoWelcome(Duration),
    /// The channel failed.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// Messages that wait to be handled. Jobs are copied out of the channel so that its memory is free at once and a
/// dismissal is seen between two slices.
enum Task {
    Define(Definition),
    Slice(Vec<(TrialJob, Vec<u8>)>),
}

/// Requests of the macro process so far.
#[derive(Default)]
struct Inbox {
    tasks: VecDeque<Task>,
    welcome: Option<u32>,
    refused: Option<String>,
    draining: bool,
    left: Option<ExitReason>,
}

impl Inbox {
    fn take(&mut self, event: WorkerEvent<'_>) {
        match event {
            WorkerEvent::Control(ToWorker::Welcome { worker }) => self.welcome = Some(worker),
            WorkerEvent::Control(ToWorker::Refused { reason }) => self.refused = Some(reason),
            WorkerEvent::Control(ToWorker::Define { definition }) => self.tasks.push_back(Task::Define(definition)),
            WorkerEvent::Control(ToWorker::Drain) => self.draining = true,
            WorkerEvent::Control(ToWorker::Bye) => self.left = Some(ExitReason::Dismissed),
            WorkerEvent::MacroLost(reason) => self.left = Some(ExitReason::MacroLost(reason)),
            WorkerEvent::Jobs(jobs) => {
                let slice = jobs.iter().map(|loaded| (loaded.job, loaded.state.to_vec())).collect();
                self.tasks.push_back(Task::Slice(slice));
            }
        }
    }
}

/// Serves one run with one engine until the worker is dismissed or the macro is lost.
///
/// # Errors
/// See [`ServeError`]. Failures of the engine are answers, not errors of the loop.
pub fn serve(
    engine: &mut dyn RveEngine,
    port: &mut dyn WorkerPort,
    options: &ServeOptions,
) -> Result<ExitReason, ServeError> {
    let capabilities = engine.capabilities();
    port.send_control(&FromWorker::Hello {
        protocol: PROTOCOL_VERSION,
        run: options.run.clone(),
        pid: std::process::id(),
        capabilities,
        state_cache: options.state_cache,
    })?;
    let mut inbox = Inbox::default();
    if let Some(reason) = await_welcome(port, &mut inbox, options.grace)? {
        return Ok(reason);
    }
    let mut runner = JobRunner::new(engine, options.state_cache as usize);
    loop {
        let idle = inbox.tasks.is_empty() && !inbox.draining;
        // Long waits cost nothing: whatever the macro does, its end included, interrupts them.
        let wait = if idle { Duration::from_secs(3600) } else { Duration::ZERO };
        port.poll(wait, &mut |event| inbox.take(event))?;
        // An agent bids its workers welcome before it has found a run, which may refuse them.
        if let Some(reason) = inbox.refused {
            return Err(ServeError::Refused(reason));
        }
        if let Some(reason) = inbox.left {
            return Ok(reason);
        }
        match inbox.tasks.pop_front() {
            Some(task) => match perform(&mut runner, port, task) {
                // A macro process that vanished meanwhile is reported by the next poll, with its reason.
                Err(TransportError::Gone(_)) => {}
                outcome => outcome?,
            },
            None if inbox.draining => {
                port.send_control(&FromWorker::Bye { reason: "drained".to_owned() })?;
                return Ok(ExitReason::Drained);
            }
            None => {}
        }
    }
}

/// Waits for the answer to the hello; returns a reason to leave, or nothing when welcome.
fn await_welcome(
    port: &mut dyn WorkerPort,
    inbox: &mut Inbox,
    grace: Duration,
) -> Result<Option<ExitReason>, ServeError> {
    let begin = Instant::now();
    loop {
        if let Some(reason) = inbox.refused.take() {
            return Err(ServeError::Refused(reason));
        }
        if let Some(worker) = inbox.welcome {
            tracing::info!(worker, "joined the run");
            return Ok(None);
        }
        if let Some(reason) = inbox.left.take() {
            return Ok(Some(reason));
        }
        let left = grace.saturating_sub(begin.elapsed());
        if left.is_zero() {
            return Err(ServeError::NoWelcome(grace));
        }
        port.poll(left, &mut |event| inbox.take(event))?;
    }
}

fn perform(runner: &mut JobRunner<'_>, port: &mut dyn WorkerPort, task: Task) -> Result<(), TransportError> {
    match task {
        Task::Define(definition) => {
            let id = definition.id();
            if let Err(error) = runner.define(definition) {
                port.send_control(&FromWorker::DefinitionRefused { definition: id, reason: error.to_string() })?;
            }
            Ok(())
        }
        Task::Slice(slice) => {
            let answers = runner.run_all(&slice);
            match send(port, &answers) {
                Err(error @ TransportError::TooLarge { .. }) => {
                    let error = RveError::EngineFault(error.to_string());
                    let answers: Vec<OwnedReply> =
                        slice.iter().map(|(job, _)| OwnedReply::failed(job, &error)).collect();
                    send(port, &answers)
                }
                outcome => outcome,
            }
        }
    }
}

fn send(port: &mut dyn WorkerPort, answers: &[OwnedReply]) -> Result<(), TransportError> {
    let replies: Vec<LoadedReply<'_>> = answers.iter().map(OwnedReply::loaded).collect();
    port.send_replies(&replies)
}
