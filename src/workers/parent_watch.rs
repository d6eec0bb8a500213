//! Ends a worker together with the process that started it.

use protocol::transport::shared_memory::sweep_before_exit;
use std::io;
use std::time::{Duration, Instant};
use tokio::signal::unix::{SignalKind, signal};

/// Exit code of a worker that SIGTERM has ended, as shells count.
const TERMINATED: i32 = 128 + 15;

/// How long an ending run may take to disappear from the process list.
pub(crate) const RUN_END_TIMEOUT: Duration = Duration::from_secs(2);

/// How long the other threads of a killed process may outlive the first.
const THREAD_END_TIMEOUT: Duration = Duration::from_millis(300);

/// Makes this process end when `parent` does, and when it gets SIGTERM. The shared memory of a dead run
/// is removed on the way: no other process may be left to do so.
///
/// # Errors
/// The system refuses a handler or a thread, or the parent is not, or no longer, this process's parent.
pub(crate) fn follow_parent(parent: Option<u32>, run: &str) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let mut terminate = {
        let _guard = runtime.enter();
        signal(SignalKind::terminate())?
    };
    let run = run.to_owned();
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        if parent.is_some() {
            // The kernel sends one signal for each thread that requested one: SIGCONT resumes a stopped process, which then
            // receives the SIGTERM that the main thread requests. Without it a stopped worker would stay for ever.
            let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::CONT));
        }
        runtime.block_on(terminate.recv());
        if parent.is_some_and(ends) {
            sweep_before_exit(&run, RUN_END_TIMEOUT);
        }
        // The engine may be in a long solve: its work is not needed, or repeated elsewhere.
        std::process::exit(TERMINATED);
    })?;
    if let Some(parent) = parent {
        rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))?;
        // It may have ended before the line above took effect.
        if !is_parent(parent) {
            return Err(io::Error::other("that process has ended"));
        }
    }
    Ok(())
}

/// Whether the parent is ending. The signal comes as soon as the thread that started this process has ended; the last
/// thread of the parent follows a moment later, and only then does this process get another parent. A living parent
/// that wants this worker gone does not mind the wait.
fn ends(parent: u32) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < THREAD_END_TIMEOUT {
        if !is_parent(parent) {
            return true;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    false
}

fn is_parent(process: u32) -> bool {
    rustix::process::getppid().is_some_and(|parent| parent.as_raw_nonzero().get().unsigned_abs() == process)
}
