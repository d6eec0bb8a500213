//! The thread that owns channels and workers.

use super::{PoolOptions, WorkerPool, failure};
use crate::error::PoolError;
use crate::processes::{Engine, LaunchPlan, WorkerProcesses, channel_limits, most_workers, run_name};
use macro_solver::pool::{Interrupt, Pool, PoolSettings};
use protocol::transport::Waker;
use protocol::transport::shared_memory::{ChannelLimits, RunDirectory, SharedMemoryMacroPort};
use protocol::{Definition, RveEngine};
use rve_server::engine::GrainEngine;
use scene_reader::{BUILT_IN_ENGINE, JOBS_A_MESSAGE};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time between two calls of `keep_going`.
const WATCH_INTERVAL: Duration = Duration::from_millis(50);

/// Consecutive replacements that may end before they have completed a job: with growing pauses some 6 s, so that a caller does not
/// wait long for a pool that cannot work.
const RESTARTS: u32 = 6;

/// Something to be done with the pool.
struct Request {
    work: Box<dyn FnOnce(&mut WorkerPool) + Send>,
    interrupt: Interrupt,
}

/// The other end of the thread, and what wakes its port.
struct Link {
    requests: Sender<Request>,
    thread: JoinHandle<()>,
}

/// A pool on a thread of its own.
pub(super) struct PoolThread {
    /// None after the close.
    link: Mutex<Option<Link>>,
    waker: Arc<dyn Waker>,
    owner: u32,
}

impl PoolThread {
    /// Starts the thread, which opens channels and workers.
    ///
    /// # Errors
    /// What is not there or cannot be started; all that was started is ended.
    pub(super) fn start(
        definitions: Vec<Definition>,
        options: PoolOptions,
        number: u64,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Self, PoolError> {
        check(&options)?;
        let interrupt = Interrupt::new();
        let raised = interrupt.clone();
        let (requests, received) = channel();
        let (opened, opening) = channel();
        let body = move || match open(definitions, &options, number, interrupt) {
            Ok(mut pool) => {
                if opened.send(Ok(pool.waker())).is_ok() {
                    serve(&mut pool, &received);
                }
            }
            Err(error) => {
                // Whoever opened the pool may be gone.
                let _ = opened.send(Err(error));
            }
        };
        let thread = std::thread::Builder::new().name(format!("pool-{number}")).spawn(body);
        let thread = thread.map_err(|error| start("start a thread")(error))?;
        let waker = wait(&opening, keep_going, || raised.raise())??;
        Ok(Self { link: Mutex::new(Some(Link { requests, thread })), waker, owner: std::process::id() })
    }

    /// Has the thread do something, and waits for it. `keep_going` is called now and then; after `false` the work is interrupted.
    ///
    /// # Errors
    /// That of the work; the pool is closed or belongs to another process.
    pub(super) fn call<T: Send + 'static>(
        &self,
        keep_going: &mut dyn FnMut() -> bool,
        work: impl FnOnce(&mut WorkerPool) -> Result<T, PoolError> + Send + 'static,
    ) -> Result<T, PoolError> {
        if std::process::id() != self.owner {
            return Err(PoolError::OtherProcess { owner: self.owner });
        }
        let interrupt = Interrupt::new();
        let (reply, answer) = channel();
        let work = Box::new(move |pool: &mut WorkerPool| {
            // A caller that has gone needs no answer.
            let _ = reply.send(work(pool));
        });
        let request = Request { work, interrupt: interrupt.clone() };
        let sent = match &*self.link.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(link) => link.requests.send(request).map_err(|_| PoolError::Closed),
            None => Err(PoolError::Closed),
        };
        sent?;
        wait(&answer, keep_going, || {
            interrupt.raise();
            self.waker.wake();
        })?
    }

    /// Ends the thread, and with it the workers.
    pub(super) fn close(&self) {
        let link = self.link.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(Link { requests, thread }) = link else { return };
        drop(requests);
        // A forked process has no such thread. A panic of the thread has been printed.
        if std::process::id() == self.owner {
            let _ = thread.join();
        }
    }
}

impl Drop for PoolThread {
    fn drop(&mut self) {
        self.close();
    }
}

/// Waits for an answer; `stop` is called once after `keep_going` has returned `false`.
fn wait<T>(answer: &Receiver<T>, keep_going: &mut dyn FnMut() -> bool, stop: impl Fn()) -> Result<T, PoolError> {
    let mut is_stopped = false;
    loop {
        match answer.recv_timeout(WATCH_INTERVAL) {
            Ok(answer) => return Ok(answer),
            Err(RecvTimeoutError::Disconnected) => return Err(PoolError::Closed),
            Err(RecvTimeoutError::Timeout) if !is_stopped && !keep_going() => {
                is_stopped = true;
                stop();
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Does what is requested until nobody can request anything.
fn serve(pool: &mut WorkerPool, received: &Receiver<Request>) {
    while let Ok(Request { work, interrupt }) = received.recv() {
        pool.follow_interrupt(interrupt);
        work(pool);
    }
    pool.close();
}

fn check(options: &PoolOptions) -> Result<(), PoolError> {
    if options.workers == 0 {
        return Err(PoolError::Arguments("a pool needs at least one worker".into()));
    }
    let (workers, most) = (options.workers, most_workers());
    if workers > most {
        let text =
            format!("{workers} workers are more than {most}, the most on this machine; one per core is fastest");
        return Err(PoolError::Arguments(text));
    }
    if !options.program.is_file() {
        return Err(PoolError::NoProgram(options.program.clone()));
    }
    Ok(())
}

/// Opens channels, starts workers, and waits until they serve.
fn open(
    definitions: Vec<Definition>,
    options: &PoolOptions,
    number: u64,
    interrupt: Interrupt,
) -> Result<WorkerPool, PoolError> {
    let name = run_name(&format!("pool{number}"));
    let limits = ChannelLimits { waiting: options.waiting, ..channel_limits(options.workers, &definitions) };
    let port = SharedMemoryMacroPort::create(&name, limits).map_err(start("open the channels"))?;
    match RunDirectory::clean() {
        Ok(names) if !names.is_empty() => tracing::info!(?names, "removed the remains of dead runs"),
        // Failure harms no pool.
        _ => {}
    }
    // A path without a folder would be looked for among the programs of the system.
    let program = std::path::absolute(&options.program).unwrap_or_else(|_| options.program.clone());
    let engine = Engine::built_in(BUILT_IN_ENGINE, program);
    let plan = LaunchPlan { restarts: RESTARTS, ..LaunchPlan::for_run(&name, &engine, options.workers) };
    let supply = WorkerProcesses::start(plan, &interrupt).map_err(start("start the workers"))?;
    let mut settings = PoolSettings::new(name);
    // The program may be of another build than this library, and would answer with other bits.
    let own = GrainEngine.capabilities();
    settings.engines = vec![own.engine.clone(); definitions.len()];
    settings.versions = vec![(own.engine, own.version)];
    settings.jobs_per_message = JOBS_A_MESSAGE;
    settings.message_bytes = limits.message_length();
    let mut pool = Pool::new(port, Box::new(supply), interrupt, settings, definitions, &[]);
    pool.gather(options.workers).map_err(|error| failure(error, None))?;
    Ok(pool)
}

fn start<E: std::fmt::Display>(action: &'static str) -> impl FnOnce(E) -> PoolError {
    move |error| PoolError::Start { action, reason: error.to_string() }
}
