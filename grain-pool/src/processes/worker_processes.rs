//! The worker processes of one engine in one run.

use super::engine::{Engine, OWN_NAME, RUNNING_PROGRAM};
use super::launch::launched;
use super::restart_backoff::RestartBackoff;
use super::stderr_tail::StderrTail;
use macro_solver::pool::{Interrupt, SupplyStatus, WorkerSupply};
use protocol::process::ProcessStat;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How long a worker may take to end after SIGTERM before SIGKILL.
const TERM_TIMEOUT: Duration = Duration::from_secs(1);

/// How often workers that have not joined yet are checked: nothing else would notice their end.
const WATCH_INTERVAL: Duration = Duration::from_millis(20);

/// How long a worker that has signed off may take to end.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(10);

/// How long a worker may take to join: a machine with a hundred starting workers on one core needs seconds.
const JOIN_TIMEOUT: Duration = Duration::from_secs(20);

/// How long a worker that has not joined may be stopped (SIGSTOP, a debugger), as one with work may by default: until it has joined, nothing
/// else would notice.
const STOPPED_LIMIT: Duration = Duration::from_secs(5);

/// The same as [`JOIN_TIMEOUT`] for engines outside this program: some load an interpreter and half a gigabyte of libraries.
const EXTERNAL_JOIN_TIMEOUT: Duration = Duration::from_secs(120);

/// Consecutive replacements that may end before they have completed a job.
const RESTARTS: u32 = 20;

/// The allocator of a worker gives no memory back to the system. Trials and tangents free and take the same megabytes; with the
/// allocator's own delay of 10 ms the system clears them again and again, 5 % of a run's processor time.
const KEPT_MEMORY: (&str, &str) = ("MIMALLOC_PURGE_DELAY", "-1");

/// The environment variable of [`KEPT_MEMORY`], unless the user has set it.
fn allocator_settings() -> Option<(&'static str, &'static str)> {
    std::env::var_os(KEPT_MEMORY.0).is_none().then_some(KEPT_MEMORY)
}

/// How workers are started.
#[derive(Clone, Debug)]
pub struct LaunchPlan {
    /// Program to start.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// Added to its environment.
    pub environment: BTreeMap<String, String>,
    /// Number of workers, at least 1.
    pub workers: usize,
    /// Most consecutive replacements that end without a completed job.
    pub restarts: u32,
    /// How long a worker may take to join.
    pub join_timeout: Duration,
}

impl LaunchPlan {
    /// `workers` workers of `engine` that serve `run`.
    pub fn for_run(run: &str, engine: &Engine, workers: usize) -> Self {
        let parent = std::process::id().to_string();
        let role = ["--run", run, "--parent", &parent].map(OsString::from);
        let arguments = engine.arguments.iter().cloned().chain(role);
        Self {
            program: engine.program.clone(),
            arguments: arguments.collect(),
            environment: engine.environment.clone(),
            workers,
            restarts: RESTARTS,
            join_timeout: if engine.is_of_this_program() { JOIN_TIMEOUT } else { EXTERNAL_JOIN_TIMEOUT },
        }
    }

    /// Whether workers are further processes of the program that starts them.
    fn is_running_program(&self) -> bool {
        self.program == Path::new(RUNNING_PROGRAM)
    }

    /// The program as people know it.
    fn shown_program(&self) -> String {
        if self.is_running_program() { OWN_NAME.to_owned() } else { self.program.display().to_string() }
    }
}

#[derive(Debug)]
struct WorkerChild {
    child: Child,
    stderr: StderrTail,
    started: Instant,
    joined: bool,
    /// Since when it has been seen to be stopped, before it joined.
    stopped_since: Option<Instant>,
    /// Set when it has signed off: until when it may take to end.
    leaving: Option<Instant>,
}

impl WorkerChild {
    /// Whether it has had its time to join, or has been stopped meanwhile for so long that it will hardly go on.
    fn is_late(&mut self, join_timeout: Duration) -> bool {
        if self.joined {
            return false;
        }
        let is_stopped = ProcessStat::of(self.child.id()).is_some_and(|stat| stat.is_stopped());
        self.stopped_since = is_stopped.then(|| self.stopped_since.unwrap_or_else(Instant::now));
        self.started.elapsed() > join_timeout
            || self.stopped_since.is_some_and(|since| since.elapsed() > STOPPED_LIMIT)
    }
}

/// Starts, watches and replaces worker processes.
#[derive(Debug)]
pub struct WorkerProcesses {
    plan: LaunchPlan,
    children: Vec<WorkerChild>,
    /// Replacements to be started, at these times.
    due: Vec<Instant>,
    restart_backoff: RestartBackoff,
    refusal: Option<String>,
    last_end: Option<String>,
    finished: bool,
}

impl WorkerProcesses {
    /// Starts all workers of the plan, or as many as can be started before `interrupt` is raised: many workers take seconds to
    /// start, and a stop should take effect at once. The pool sees the request when it next receives.
    ///
    /// # Errors
    /// The system cannot start a process; those already started are ended.
    pub fn start(plan: LaunchPlan, interrupt: &Interrupt) -> io::Result<Self> {
        let restart_backoff = RestartBackoff::new(plan.restarts);
        let mut processes = Self {
            plan,
            children: Vec::new(),
            due: Vec::new(),
            restart_backoff,
            refusal: None,
            last_end: None,
            finished: false,
        };
        for _ in 0..processes.plan.workers {
            if interrupt.is_raised() {
                break;
            }
            processes.spawn()?;
        }
        Ok(processes)
    }

    fn spawn(&mut self) -> io::Result<()> {
        let mut command = Command::new(&self.plan.program);
        if self.plan.is_running_program() {
            command.arg0(OWN_NAME);
        }
        // A process group of their own: Ctrl-C is for the macro, which then dismisses its workers in good order.
        command
            .args(&self.plan.arguments)
            .envs(allocator_settings())
            .envs(&self.plan.environment)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let mut child = launched(command.process_group(0))?;
        let stderr = child.stderr.take().expect("standard error is a pipe");
        let tail = StderrTail::of(child.id(), stderr)?;
        tracing::debug!(pid = child.id(), "worker started");
        self.children.push(WorkerChild {
            child,
            stderr: tail,
            started: Instant::now(),
            joined: false,
            stopped_since: None,
            leaving: None,
        });
        Ok(())
    }

    /// Removes a worker that has ended and schedules its replacement.
    fn remove(&mut self, place: usize, status: Option<ExitStatus>, had_completed_job: bool) {
        let ended = self.children.remove(place);
        let (pid, stderr) = (ended.child.id(), ended.stderr.text());
        let how = status.map_or_else(|| "no exit status".to_owned(), |status| status.to_string());
        let text = if stderr.is_empty() { how } else { format!("{how}: {stderr}") };
        tracing::info!(pid, text, "worker process ended");
        let before = if ended.joined { "" } else { " before it joined" };
        self.last_end = Some(format!("worker process {pid} of {} ended{before}: {text}", self.plan.shown_program()));
        // A worker that signed off was replaced at that moment.
        if ended.leaving.is_some() {
            return;
        }
        if self.refusal.is_none()
            && let Some(pause) = self.restart_backoff.ended(had_completed_job)
        {
            self.due.push(Instant::now() + pause);
        }
    }

    /// Removes workers that ended before they joined or after they signed off, and kills those that take too long. The end of
    /// the others is reported by the pool, together with whether they had completed a job.
    fn reap(&mut self) {
        for place in (0..self.children.len()).rev() {
            let one = &mut self.children[place];
            if one.joined && one.leaving.is_none() {
                continue;
            }
            if one.is_late(self.plan.join_timeout) || one.leaving.is_some_and(|end| end <= Instant::now()) {
                let _ = one.child.kill();
            }
            if let Ok(Some(status)) = one.child.try_wait() {
                self.remove(place, Some(status), false);
            }
        }
    }

    fn start_due(&mut self) {
        let now = Instant::now();
        let ready = self.due.iter().filter(|start| **start <= now).count();
        self.due.retain(|start| *start > now);
        for _ in 0..ready {
            if let Err(error) = self.spawn() {
                self.last_end = Some(format!("could not start a worker: {error}"));
                if let Some(pause) = self.restart_backoff.ended(false) {
                    self.due.push(now + pause);
                }
            }
        }
    }

    /// Whether none of its processes serves or is about to.
    pub fn is_deserted(&self) -> bool {
        self.due.is_empty() && self.children.iter().all(|one| one.leaving.is_some())
    }

    fn place_of(&self, pid: u32) -> Option<usize> {
        self.children.iter().position(|one| one.child.id() == pid)
    }

    fn end_all(&mut self) {
        for one in &self.children {
            // A process that has ended meanwhile needs no signal.
            let _ = rustix::process::kill_process(
                rustix::process::Pid::from_child(&one.child),
                rustix::process::Signal::TERM,
            );
        }
        let end = Instant::now() + TERM_TIMEOUT;
        while !self.children.is_empty() && Instant::now() < end {
            self.children.retain_mut(|one| matches!(one.child.try_wait(), Ok(None)));
            std::thread::sleep(Duration::from_millis(2));
        }
        for one in &mut self.children {
            let _ = one.child.kill();
            let _ = one.child.wait();
        }
        self.children.clear();
    }
}

impl WorkerSupply for WorkerProcesses {
    fn joined(&mut self, pid: u32) {
        if let Some(place) = self.place_of(pid) {
            self.children[place].joined = true;
        }
    }

    fn refused(&mut self, pid: u32, reason: &str) {
        // A worker started by hand may be the wrong one; those of this group are all alike.
        if self.place_of(pid).is_some() {
            self.refusal = Some(reason.to_owned());
        }
    }

    fn lost(&mut self, pid: u32, had_completed_job: bool) {
        let Some(place) = self.place_of(pid) else { return };
        // Its channel is gone: the process must not remain.
        let one = &mut self.children[place];
        let _ = one.child.kill();
        let status = one.child.wait().ok();
        self.remove(place, status, had_completed_job);
    }

    fn left(&mut self, pid: u32, had_completed_job: bool) {
        let Some(place) = self.place_of(pid) else { return };
        let now = Instant::now();
        self.children[place].leaving = Some(now + LEAVE_TIMEOUT);
        if had_completed_job {
            self.due.push(now);
            return;
        }
        // Replacements that only come and go again, as those of an engine which ends at once, must not follow each other for ever.
        self.last_end = Some(format!("worker process {pid} left before it had completed a job"));
        self.due.extend(self.restart_backoff.ended(false).map(|pause| now + pause));
    }

    fn tend(&mut self) -> SupplyStatus {
        self.reap();
        self.start_due();
        let starting = self.children.iter().filter(|one| !one.joined).count();
        if starting + self.due.len() > 0 {
            return SupplyStatus::Expected { check_again: WATCH_INTERVAL };
        }
        if self.children.len() >= self.plan.workers {
            return SupplyStatus::Expected { check_again: Duration::from_secs(1) };
        }
        let why = match &self.refusal {
            Some(reason) => format!("workers started by this run were refused: {reason}"),
            None => format!(
                "{} consecutive replacements ended without a completed job, and no more are started",
                self.plan.restarts
            ),
        };
        let last = self.last_end.as_deref().unwrap_or("no worker was ever started");
        SupplyStatus::Exhausted(format!("{why}; {last}"))
    }

    fn restarts(&self) -> u64 {
        self.restart_backoff.granted()
    }

    fn finish(&mut self) {
        self.finished = true;
        self.due.clear();
        self.end_all();
    }
}

impl Drop for WorkerProcesses {
    fn drop(&mut self) {
        if !self.finished {
            self.end_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, workers: usize, restarts: u32) -> LaunchPlan {
        LaunchPlan {
            program: "/bin/sh".into(),
            arguments: vec!["-c".into(), script.into()],
            environment: BTreeMap::new(),
            workers,
            restarts,
            join_timeout: JOIN_TIMEOUT,
        }
    }

    /// A worker of any engine that was stopped before it joined was waited for until it was late, in runs with engines outside this program
    /// for longer than a run waits for workers.
    #[test]
    fn a_worker_that_is_stopped_before_it_joins_is_replaced() {
        let plan = LaunchPlan { join_timeout: EXTERNAL_JOIN_TIMEOUT, ..shell("kill -STOP $$; exec sleep 100", 1, 0) };
        let mut processes = WorkerProcesses::start(plan, &Interrupt::new()).unwrap();
        let begin = Instant::now();
        let reason = loop {
            match processes.tend() {
                SupplyStatus::Exhausted(reason) => break reason,
                SupplyStatus::Expected { check_again } => std::thread::sleep(check_again),
            }
            assert!(begin.elapsed() < 3 * STOPPED_LIMIT, "it is waited for");
        };
        assert!(begin.elapsed() > STOPPED_LIMIT && reason.contains("SIGKILL"), "{reason}");
    }

    /// Frames are of this program too.
    #[test]
    fn engines_of_this_program_have_the_short_time_to_join() {
        let timeout = |engine: &Engine| LaunchPlan::for_run("run", engine, 1).join_timeout;
        for engine in rve_server::server::BUILT_IN_ENGINES {
            assert_eq!(
                timeout(&Engine::built_in(engine.keyword, "program".into())),
                JOIN_TIMEOUT,
                "{}",
                engine.keyword
            );
        }
        let other = Engine { name: "mine".into(), ..Engine::built_in("periodic", "program".into()) };
        assert_eq!(timeout(&other), EXTERNAL_JOIN_TIMEOUT);
    }

    /// Tends until the supply gives up or 5 s have passed.
    fn tend_until_exhausted(processes: &mut WorkerProcesses) -> String {
        let end = Instant::now() + Duration::from_secs(5);
        while Instant::now() < end {
            match processes.tend() {
                SupplyStatus::Exhausted(reason) => return reason,
                SupplyStatus::Expected { check_again } => std::thread::sleep(check_again),
            }
        }
        panic!("the supply did not give up");
    }

    #[test]
    fn workers_that_cannot_start_are_given_up_with_their_standard_error() {
        let mut processes =
            WorkerProcesses::start(shell("echo no packing >&2; exit 2", 1, 2), &Interrupt::new()).unwrap();
        let reason = tend_until_exhausted(&mut processes);
        assert!(reason.contains("2 consecutive replacements") && reason.contains("exit status: 2"), "{reason}");
        assert_eq!(processes.restarts(), 2);
    }

    #[test]
    fn a_killed_worker_is_replaced_and_all_are_gone_after_finish() {
        let mut processes = WorkerProcesses::start(shell("exec sleep 100", 2, 5), &Interrupt::new()).unwrap();
        let before: Vec<_> = processes.children.iter().map(|one| one.child.id()).collect();
        before.iter().for_each(|pid| processes.joined(*pid));
        processes.lost(before[0], true);
        assert!(matches!(processes.tend(), SupplyStatus::Expected { .. }));
        let after: Vec<_> = processes.children.iter().map(|one| one.child.id()).collect();
        assert_eq!((after.len(), after[0], processes.restarts()), (2, before[1], 1));
        processes.finish();
        assert!(after.iter().all(|pid| !std::path::Path::new(&format!("/proc/{pid}")).exists()));
    }

    #[test]
    fn a_worker_that_leaves_in_good_order_is_replaced_without_counting() {
        let mut processes = WorkerProcesses::start(shell("sleep 0.05", 1, 0), &Interrupt::new()).unwrap();
        for _ in 0..3 {
            let pid = processes.children.last().unwrap().child.id();
            processes.joined(pid);
            processes.left(pid, true);
            assert!(matches!(processes.tend(), SupplyStatus::Expected { .. }));
            assert_ne!(processes.children.last().unwrap().child.id(), pid);
        }
        assert_eq!(processes.restarts(), 0);
    }

    #[test]
    fn workers_that_leave_without_an_answer_are_not_replaced_for_ever() {
        let mut processes = WorkerProcesses::start(shell("exec sleep 100", 1, 2), &Interrupt::new()).unwrap();
        let mut rounds = 0;
        let outlook = loop {
            let outlook = processes.tend();
            let Some(one) = processes.children.iter_mut().find(|one| one.leaving.is_none()) else {
                if matches!(outlook, SupplyStatus::Exhausted(_)) {
                    break outlook;
                }
                std::thread::sleep(Duration::from_millis(10));
                continue;
            };
            let pid = one.child.id();
            one.child.kill().unwrap();
            processes.joined(pid);
            processes.left(pid, false);
            rounds += 1;
            assert!(rounds < 20, "replaced again and again");
        };
        assert!(
            matches!(&outlook, SupplyStatus::Exhausted(reason) if reason.contains("completed job")),
            "{outlook:?}"
        );
        assert_eq!(processes.restarts(), 2);
    }

    /// Thousands of processes take minutes to start: a request to stop must not wait for the last of them.
    #[test]
    fn a_request_to_stop_takes_effect_between_two_launches() {
        let interrupt = Interrupt::new();
        let raised = interrupt.clone();
        let request = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            raised.raise();
        });
        let mut processes = WorkerProcesses::start(shell("exec sleep 100", 100_000, 5), &interrupt).unwrap();
        request.join().unwrap();
        assert!((1..10_000).contains(&processes.children.len()), "{} were started", processes.children.len());
        processes.finish();
    }

    #[test]
    fn own_workers_that_are_refused_are_not_started_again() {
        let mut processes = WorkerProcesses::start(shell("sleep 0.05", 1, 5), &Interrupt::new()).unwrap();
        let pid = processes.children[0].child.id();
        processes.refused(pid, "wrong version");
        let reason = tend_until_exhausted(&mut processes);
        assert!(reason.contains("refused: wrong version"), "{reason}");
        assert_eq!(processes.restarts(), 0);
    }
}
