//! Starting a process with a time limit.
//!
//! Until the new process has executed its program, the kernel blocks the thread that starts it. A stop of the new process at that
//! moment (by a debugger or a batch scheduler) would block the whole run, and no deadline of the run could fire. So another thread
//! watches, and kills a process that takes too long to execute its program.

use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::io;
use std::path::Path;
use std::process::{Child, Command};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How long a process may take to execute its program; on a busy machine that takes milliseconds.
const EXEC_TIMEOUT: Duration = Duration::from_secs(5);

/// Starts a process. One that is stopped before it has executed its program is killed and returned as a process that has ended.
///
/// # Errors
/// The system cannot start the process, or the thread that watches.
pub(super) fn launched(command: &mut Command) -> io::Result<Child> {
    // "PROCESS/task/THREAD"
    let starter = Path::new("/proc").join(fs::read_link("/proc/thread-self")?);
    let (started, watched) = channel::<()>();
    std::thread::scope(|scope| {
        std::thread::Builder::new().name("launches".into()).spawn_scoped(scope, move || {
            while watched.recv_timeout(EXEC_TIMEOUT) == Err(RecvTimeoutError::Timeout) {
                not_executed(&starter).into_iter().for_each(|child| {
                    tracing::warn!(
                        pid = child.as_raw_nonzero().get(),
                        "a worker was stopped while it started; it is killed"
                    );
                    // It may have continued meanwhile: then it is a worker that ends early, and is replaced.
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
fn not_executed(starter: &Path) -> Vec<Pid> {
    let own = fs::read("/proc/self/cmdline").unwrap_or_default();
    let children = fs::read_to_string(starter.join("children")).unwrap_or_default();
    let is_copy = |pid: &&str| fs::read(format!("/proc/{pid}/cmdline")).is_ok_and(|line| line == own);
    children.split_whitespace().filter(is_copy).filter_map(|pid| Pid::from_raw(pid.parse().ok()?)).collect()
}
