//! Helper processes of a study: this program again, in a hidden role.

mod echo;
mod engines;
mod pool;

pub(crate) use echo::{Echo, answer_jobs};
pub(crate) use engines::{EMPTY_SNAPSHOTS, idle_definition, pausing_definition};
pub(crate) use pool::{StudyPool, fresh_name, grain_definition, measured_processor_seconds, processor_seconds};

use anyhow::{Context, bail};
use engines::{IdleEngine, PausingEngine};
use protocol::RveEngine;
use protocol::transport::shared_memory::SharedMemoryWorkerPort;
use rve_server::server::{ServeOptions, serve};
use std::ffi::OsString;
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::Duration;

/// How long a helper waits for the run that it belongs to.
const JOIN_TIMEOUT: Duration = Duration::from_secs(10);

/// Role of a worker with the built-in engine.
pub(crate) const WORKER: &str = "worker";

/// What a helper process does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Returns every snapshot over shared memory, without an engine.
    Echo,
    /// Returns every message over a Unix socket.
    SocketEcho,
    /// A worker whose RVEs cost nothing.
    Idle,
    /// A worker whose RVEs take the time that their target says, asleep.
    Pausing,
}

protocol::keywords! {
    Role {
        Echo => "echo",
        SocketEcho => "socket-echo",
        Idle => "idle",
        Pausing => "pausing",
    }
}

/// A helper process; ended when dropped.
#[derive(Debug)]
pub(crate) struct HelperProcess(Child);

impl HelperProcess {
    /// Starts a helper that connects to `address`: the name of a run, or the path of a socket.
    ///
    /// # Errors
    /// The system cannot start it.
    pub(crate) fn start(role: Role, address: &str) -> anyhow::Result<Self> {
        Self::this_program(role.keyword(), address)
    }

    /// Starts a worker with the built-in engine.
    ///
    /// # Errors
    /// The system cannot start it.
    pub(crate) fn worker(run: &str) -> anyhow::Result<Self> {
        Self::this_program(WORKER, run)
    }

    /// Its process.
    pub(crate) fn pid(&self) -> u32 {
        self.0.id()
    }

    fn this_program(role: &str, address: &str) -> anyhow::Result<Self> {
        let program = std::env::current_exe().context("the path of this program is unknown")?;
        let arguments = ["--helper", role, address];
        let child = Command::new(program).args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).spawn();
        Ok(Self(child.context("a helper process could not be started")?))
    }
}

impl Drop for HelperProcess {
    fn drop(&mut self) {
        // Most have ended by now, as their channel has.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What `--helper worker RUN` does: `grainspan rve-server` for this process's parent.
pub(crate) fn work(run: &str) -> ExitCode {
    let parent = std::os::unix::process::parent_id().to_string();
    let arguments = ["grainspan", "rve-server", "--run", run, "--parent", &parent];
    grainspan::run_command_line(arguments.map(OsString::from))
}

/// What `--helper ROLE ADDRESS` does in the other roles.
///
/// # Errors
/// There is no process at the address, or the channel breaks.
pub(crate) fn help(role: &str, address: &str) -> anyhow::Result<()> {
    // A study that was killed must not leave processes behind.
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))?;
    let role =
        Role::ALL.into_iter().find(|one| one.keyword() == role).with_context(|| format!("unknown role `{role}`"))?;
    if role == Role::SocketEcho {
        return echo::answer_socket(address);
    }
    let mut port = SharedMemoryWorkerPort::join(address, JOIN_TIMEOUT)?;
    let mut engine: Box<dyn RveEngine> = match role {
        Role::Echo => return answer_jobs(&mut port, address),
        Role::Idle => Box::new(IdleEngine),
        Role::Pausing => Box::new(PausingEngine),
        Role::SocketEcho => bail!("a socket has no engine"),
    };
    serve(engine.as_mut(), &mut port, &ServeOptions::new(address))?;
    Ok(())
}
