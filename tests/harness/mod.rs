//! Runs the real program in a place of its own, under a watchdog. Not every test file uses all of it.
#![allow(dead_code, unreachable_pub, missing_docs, reason = "each test file compiles its own copy")]

mod children;
pub mod commands;
pub mod engines;
pub mod short_scenes;
pub mod table;

pub use children::children_of;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// No test of this kind may take longer.
const WATCHDOG: Duration = Duration::from_secs(50);

/// A folder of its own for output and run records; removed in the end.
pub struct Site {
    folder: tempfile::TempDir,
}

/// A program under watch.
pub struct Watched {
    child: Child,
    begun: Instant,
    stderr: PathBuf,
}

/// How a program ended.
pub struct Ended {
    pub status: ExitStatus,
    pub stderr: String,
}

impl Site {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program, ready to be started.
    pub fn program(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_grainspan"));
        command.args(arguments).env_remove("RUST_LOG");
        command.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null()).stdout(Stdio::null());
        command
    }

    /// Starts the program; `name` is that of its log.
    pub fn start(&self, name: &str, arguments: &[&str]) -> Watched {
        let stderr = self.path(&format!("{name}.stderr"));
        let child = self.program(arguments).stderr(fs::File::create(&stderr).unwrap()).spawn().unwrap();
        Watched { child, begun: Instant::now(), stderr }
    }

    /// Starts a run of the small scene into the folder `name`.
    pub fn start_run(&self, name: &str, workers: &str, increments: u32) -> Watched {
        let increments = format!("loading.increments={increments}");
        let out = self.path(name);
        let out = out.to_str().unwrap();
        let scene = "scenes/biaxial-small.toml";
        self.start(name, &["run", scene, "--workers", workers, "--out", out, "--set", &increments])
    }

    /// The history of the run called `name`.
    pub fn history(&self, name: &str) -> String {
        fs::read_to_string(self.path(name).join("history.csv")).unwrap()
    }

    /// A number of the summary of the run called `name`.
    pub fn summary(&self, name: &str, key: &str) -> u64 {
        let text = fs::read(self.path(name).join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&text).unwrap();
        summary[key].as_u64().unwrap_or_else(|| panic!("`{key}` in {summary}"))
    }

    /// Standard output of `grainspan status`.
    pub fn status(&self) -> String {
        let output = self.program(&["status"]).stdout(Stdio::piped()).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    }

    /// Standard output of `grainspan status` for one run, whatever else runs on this machine.
    pub fn status_of(&self, run: &str) -> String {
        let output = self.program(&["status", run]).stdout(Stdio::piped()).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    }

    /// The traces in memory of the run that writes into the folder `name`, as soon as there are any.
    pub fn traces(&self, name: &str) -> Traces {
        let output = self.path(name);
        eventually("progress of the run", || {
            run_directories().into_iter().find_map(|directory| {
                let progress = json(&directory.join("progress.json"))?;
                let record = json(&directory.join("run.json"))?;
                (progress["output"].as_str()? == output.to_str()?).then(|| Traces {
                    run: record["name"].as_str().unwrap().to_owned(),
                    prefix: record["prefix"].as_str().unwrap().to_owned(),
                    directory,
                })
            })
        })
    }
}

/// Where a run keeps what it has in memory.
pub struct Traces {
    pub run: String,
    prefix: String,
    directory: PathBuf,
}

impl Traces {
    /// Everything that is there now.
    pub fn left(&self) -> Vec<PathBuf> {
        let segments = fs::read_dir("/dev/shm").unwrap().flatten();
        let ours = segments.filter(|entry| entry.file_name().to_string_lossy().starts_with(&self.prefix));
        let directory = self.directory.exists().then(|| self.directory.clone());
        ours.map(|entry| entry.path()).chain(directory).collect()
    }
}

/// Directories of all runs of this user.
fn run_directories() -> Vec<PathBuf> {
    let base = format!("/dev/shm/grainspan-{}", rustix::process::getuid().as_raw());
    let Ok(entries) = fs::read_dir(base) else { return Vec::new() };
    entries.flatten().map(|entry| entry.path()).collect()
}

fn json(path: &Path) -> Option<serde_json::Value> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

impl Watched {
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Whether it still runs.
    pub fn runs(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Its worker processes.
    pub fn workers(&self) -> Vec<u32> {
        children_of(self.pid())
    }

    /// Stops the first worker that is met before it has become its program; false when all eight got through.
    pub fn stop_a_newborn(&mut self) -> bool {
        let line = |pid: u32| fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let children = format!("/proc/{0}/task/{0}/children", self.pid());
        let mut known = Vec::new();
        while self.runs() && known.len() < 8 {
            for pid in fs::read_to_string(&children).unwrap_or_default().split_whitespace() {
                let pid: u32 = pid.parse().unwrap();
                if known.contains(&pid) {
                    continue;
                }
                known.push(pid);
                signal(pid, rustix::process::Signal::STOP);
                // It stops on its way out of the kernel: an exec under way is finished first.
                eventually("stop of a newborn", || is_stopped(pid).then_some(()));
                if line(pid) == line(self.pid()) {
                    return true;
                }
                signal(pid, rustix::process::Signal::CONT);
            }
        }
        false
    }

    /// Waits until this many workers run.
    pub fn await_workers(&mut self, count: usize) -> Vec<u32> {
        eventually("workers", || {
            assert!(self.runs(), "the run ended: {}", self.said());
            Some(self.workers()).filter(|workers| workers.len() >= count)
        })
    }

    /// Waits until the history of a run holds this many rows.
    pub fn await_rows(&mut self, history: &Path, count: usize) {
        eventually("rows in the history", || {
            assert!(self.runs(), "the run ended: {}", self.said());
            (self.rows(history) > count).then_some(())
        });
    }

    /// How many rows the history of a run holds by now, its head included.
    pub fn rows(&self, history: &Path) -> usize {
        fs::read_to_string(history).map_or(0, |text| text.lines().count())
    }

    pub fn said(&self) -> String {
        fs::read_to_string(&self.stderr).unwrap()
    }

    /// Waits for the end.
    pub fn end(mut self) -> Ended {
        while self.begun.elapsed() < WATCHDOG {
            if let Some(status) = self.child.try_wait().unwrap() {
                return Ended { status, stderr: self.said() };
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("the watchdog barked: {}", self.said());
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        // Most have ended by now.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal by its number.
pub fn signal(pid: u32, signal: rustix::process::Signal) {
    let pid = rustix::process::Pid::from_raw(pid as i32).unwrap();
    // The process may have ended in the meantime.
    let _ = rustix::process::kill_process(pid, signal);
}

/// Whether a process stands still, or has ended.
fn is_stopped(pid: u32) -> bool {
    let state = |text: String| text.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next());
    fs::read_to_string(format!("/proc/{pid}/stat")).map_or(true, |text| matches!(state(text), Some('T' | 'Z' | 'X')))
}

/// Whether a process lives.
pub fn lives(pid: u32) -> bool {
    fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|text| !text.contains(") Z "))
}

/// Asks again until there is an answer; the watchdog barks when there is none.
pub fn eventually<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + WATCHDOG;
    while Instant::now() < end {
        if let Some(found) = look() {
            return found;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("no {what} within {WATCHDOG:?}");
}
