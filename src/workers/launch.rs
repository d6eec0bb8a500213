//! Starting a process without waiting for ever.
//!
//! Until the new process has become its program, the kernel holds the thread that starts it. Whoever stops the process in that
//! moment (a debugger, a scheduler that lends processors) would hold the whole run, and no deadline of the run could
//! fire: its thread does not run. So another thread watches, and ends a process that takes too long to be born.

use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::io;
use std::path::Path;
use std::process::{Child, Command};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How long a process may take to become its program; on a busy machine that takes milliseconds.
const BIRTH: Duration = Duration::from_secs(5);

/// Starts a process. One that is stopped before it has become its program is killed: it is returned as any other and has ended.
///
/// # Errors
/// The system cannot start the process, or the thread that watches.
pub(super) fn launched(command: &mut Command) -> io::Result<Child> {
    // "PROCESS/task/THREAD"
    let starter = Path::new("/proc").join(fs::read_link("/proc/thread-self")?);
    let (started, watched) = channel::<()>();
    std::thread::scope(|scope| {
        std::thread::Builder::new().name("births".into()).spawn_scoped(scope, move || {
            while watched.recv_timeout(BIRTH) == Err(RecvTimeoutError::Timeout) {
                unborn(&starter).into_iter().for_each(|child| {
                    tracing::warn!(
                        pid = child.as_raw_nonzero().get(),
                        "a worker was stopped while it started; it is ended"
                    );
                    // It may have gone on meanwhile: then it is a worker that ends early, and is replaced.
                    let _ = kill_process(child, Signal::KILL);
                });
            }
        })?;
        let child = command.spawn();
        drop(started);
        child
    })
}

/// Children of a thread of this process that are still copies of it.
fn unborn(starter: &Path) -> Vec<Pid> {
    let own = fs::read("/proc/self/cmdline").unwrap_or_default();
    let children = fs::read_to_string(starter.join("children")).unwrap_or_default();
    let is_copy = |pid: &&str| fs::read(format!("/proc/{pid}/cmdline")).is_ok_and(|line| line == own);
    children.split_whitespace().filter(is_copy).filter_map(|pid| Pid::from_raw(pid.parse().ok()?)).collect()
}
