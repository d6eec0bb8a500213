//! SIGINT, SIGTERM and SIGHUP: the first requests a stop in good order, the second ends the process.
//!
//! What follows within half a second belongs to the first request: `timeout` and schedulers send a signal to the process and to its group.

use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use macro_solver::pool::Interrupt;
use protocol::transport::Waker;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// Exit code of a run that was interrupted.
const INTERRUPTED: i32 = 130;

/// Time within which signals are one request.
const ONE_REQUEST: Duration = Duration::from_millis(500);

/// Watches for SIGINT, SIGTERM and SIGHUP on a thread of its own until the process ends.
#[derive(Clone)]
pub(crate) struct SignalWatch {
    waker: Arc<Mutex<Option<Arc<dyn Waker>>>>,
}

impl SignalWatch {
    /// Starts to watch; `interrupt` is raised by the first signal.
    ///
    /// # Errors
    /// The system refuses a handler or a thread.
    pub(crate) fn start(interrupt: Interrupt) -> io::Result<Self> {
        Self::announced(interrupt, || {
            tracing::warn!(
                "a stop was requested; a second request, half a second later or more, ends the process at once"
            );
        })
    }

    /// For commands without workers: a flag that the first signal raises, after which `first` happens before the command ends, as
    /// people are told.
    ///
    /// # Errors
    /// The system refuses a handler or a thread.
    pub(crate) fn flag(first: &'static str) -> Result<Interrupt, Failure> {
        let interrupt = Interrupt::new();
        let announce = move || {
            tell(format_args!(
                "a stop was requested: {first}; a second request, half a second later or more, ends at once"
            ))
        };
        match Self::announced(interrupt.clone(), announce) {
            Ok(_) => Ok(interrupt),
            Err(error) => Err(Failure::new(Exit::BadInput, format!("could not watch for signals: {error}"))),
        }
    }

    fn announced(interrupt: Interrupt, announce: impl FnOnce() + Send + 'static) -> io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
        let mut signals = {
            let _guard = runtime.enter();
            [signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?, signal(SignalKind::hangup())?]
        };
        let watch = Self { waker: Arc::default() };
        let waker = Arc::clone(&watch.waker);
        std::thread::Builder::new().name("signals".into()).spawn(move || {
            runtime.block_on(next(&mut signals));
            announce();
            interrupt.raise();
            if let Some(waker) = waker.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
                waker.wake();
            }
            let first = Instant::now();
            loop {
                runtime.block_on(next(&mut signals));
                if first.elapsed() > ONE_REQUEST {
                    break;
                }
            }
            // The kernel ends the workers with this process.
            std::process::exit(INTERRUPTED);
        })?;
        Ok(watch)
    }

    /// From now on the first signal also interrupts a port that waits.
    pub(crate) fn wakes(&self, waker: Arc<dyn Waker>) {
        *self.waker.lock().unwrap_or_else(PoisonError::into_inner) = Some(waker);
    }
}

async fn next(signals: &mut [Signal; 3]) {
    let [interrupt, terminate, hangup] = signals;
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
        _ = hangup.recv() => {}
    }
}
