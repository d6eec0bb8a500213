//! The macro process of a case, under watch.

use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// No run of this size may take longer, however disturbed.
const WATCHDOG: Duration = Duration::from_secs(180);

/// A run of the real program.
pub struct Macro {
    child: Child,
    begun: Instant,
    watchdog: Duration,
    stderr: PathBuf,
}

impl Macro {
    /// Starts the program.
    pub fn start(arguments: &[String], stderr: &Path) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_grainspan"));
        command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).env_remove("RUST_LOG");
        let log = fs::File::create(stderr).expect("the place is writable");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let child = command.spawn().expect("the program starts");
        Self { child, begun: Instant::now(), watchdog: WATCHDOG, stderr: stderr.to_owned() }
    }

    /// The same for a run of another size.
    pub fn patient(mut self) -> Self {
        self.watchdog = 20 * WATCHDOG;
        self
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// How it ended, once it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().expect("it is our child")
    }

    /// Whether it takes too long.
    pub fn is_stuck(&self) -> bool {
        self.begun.elapsed() > self.watchdog
    }

    /// What it said.
    pub fn said(&self) -> String {
        fs::read_to_string(&self.stderr).unwrap_or_default()
    }
}

impl Drop for Macro {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal to a process that may have ended.
pub fn strike(pid: u32, signal: Signal) {
    if let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) {
        // The first SIGSEGV only removes the handler that Rust has for overflowing stacks.
        let times = if signal == Signal::SEGV { 2 } else { 1 };
        for _ in 0..times {
            let _ = kill_process(pid, signal);
            std::thread::sleep(Duration::from_millis(times - 1));
        }
    }
}
