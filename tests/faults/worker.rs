//! The role of a faulty worker: the real worker loop between a port and an engine that misbehave once.

use super::fault::{Action, Fault, State};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::shared_memory::SharedMemoryWorkerPort;
use protocol::transport::{LoadedReply, TransportError, WorkerEvent, WorkerPort};
use protocol::{Capabilities, Definition, RveEngine, RveError, RveSolver, Tensor2, TrialOptions, TrialResult};
use rustix::process::{Resource, Rlimit, Signal, getpid, kill_process, setrlimit};
use rve_server::server::{ServeOptions, built_in_engine, serve};
use std::cell::Cell;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Counts how often states were reached and tells when the fault is due.
struct Script {
    fault: Option<Fault>,
    reached: AtomicU64,
    log: Mutex<PathBuf>,
}

impl Script {
    /// The action, if it is due now. That it was is written down first: the process may not live to tell.
    fn due(&self, state: State) -> Option<Action> {
        let fault = self.fault.filter(|fault| fault.state == state)?;
        if self.reached.fetch_add(1, Ordering::SeqCst) + 1 != fault.count {
            return None;
        }
        let path = self.log.lock().expect("nobody panics with the log in hand");
        let mut log = OpenOptions::new().create(true).append(true).open(&*path).expect("the log can be written");
        // In one piece: others write into it at the same time.
        log.write_all(format!("{fault}\n").as_bytes()).expect("the log can be written");
        Some(fault.action)
    }

    /// Ends or hangs this process, if that is what is due.
    fn at(&self, state: State) {
        if let Some(action) = self.due(state) {
            suffer(action);
        }
    }
}

fn suffer(action: Action) {
    let signal = |signal: Signal| {
        let _ = kill_process(getpid(), signal);
        // The first of some signals only removes the handler that Rust has for overflowing stacks, and a signal may be taken
        // by another thread.
        loop {
            std::thread::sleep(Duration::from_millis(1));
            let _ = kill_process(getpid(), signal);
        }
    };
    match action {
        Action::Kill => signal(Signal::KILL),
        Action::Crash => signal(Signal::SEGV),
        Action::Abort => std::process::abort(),
        Action::Stop => {
            let _ = kill_process(getpid(), Signal::STOP);
        }
        Action::Sleep => std::thread::sleep(Duration::from_secs(600)),
        Action::Exit => std::process::exit(0),
        Action::OutOfMemory => {
            let _ = setrlimit(Resource::As, Rlimit { current: Some(1 << 20), maximum: None });
            let mut hoard: Vec<Vec<u8>> = Vec::new();
            loop {
                hoard.push(vec![1; 1 << 24]);
            }
        }
        Action::Panic => panic!("a fault was asked for"),
        Action::Late
        | Action::Twice
        | Action::NotANumber
        | Action::DamagedState
        | Action::Invent
        | Action::Garbage
        | Action::Stranger => {}
    }
}

/// `run=NAME log=FILE [engine=KEYWORD] [fault=STATE:ACTION:COUNT]`
pub fn play(words: &[String]) -> ExitCode {
    let value = |key: &str| words.iter().find_map(|word| word.strip_prefix(key)).map(str::to_owned);
    let (Some(run), Some(log)) = (value("run="), value("log=")) else { return ExitCode::FAILURE };
    let fault = value("fault=").map(|text| Fault::parse(&text).expect("a fault that can be drawn"));
    // Crashes are wanted here: no core files.
    let _ = setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) });
    let script = Arc::new(Script { fault, reached: AtomicU64::new(0), log: Mutex::new(log.into()) });
    script.at(State::BeforeJoining);
    let Ok(port) = SharedMemoryWorkerPort::join(&run, Duration::from_secs(20)) else { return ExitCode::from(2) };
    let mut port = FaultyPort { port, script: Arc::clone(&script), answered: Cell::new(false) };
    let keyword = value("engine=").unwrap_or_else(|| "grainspan-dem".to_owned());
    let built_in = built_in_engine(&keyword).expect("an engine that scenes name");
    let mut engine = FaultyEngine { inner: (built_in.create)(), script };
    match serve(&mut engine, &mut port, &ServeOptions::new(&run)) {
        Ok(_) => ExitCode::SUCCESS,
        Err(_) => ExitCode::from(2),
    }
}

struct FaultyPort {
    port: SharedMemoryWorkerPort,
    script: Arc<Script>,
    answered: Cell<bool>,
}

impl FaultyPort {
    /// Says something that is no message of this protocol, if that is due.
    fn say_nonsense(&mut self, state: State) -> Result<(), TransportError> {
        match self.script.due(state) {
            Some(Action::Garbage) => self.port.send_raw(&[0x5a; 200]),
            Some(Action::Stranger) => {
                let mut frame = vec![0; 32];
                frame[..4].copy_from_slice(b"GSFR");
                frame[4..8].copy_from_slice(&99u32.to_le_bytes());
                frame[16..24].copy_from_slice(&32u64.to_le_bytes());
                self.port.send_raw(&frame)
            }
            Some(action) => {
                suffer(action);
                Ok(())
            }
            None => Ok(()),
        }
    }
}

impl WorkerPort for FaultyPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        // A long wait after an answer: the macro has all answers, checks the balance, commits and begins anew.
        if !wait.is_zero() && self.answered.replace(false) {
            self.script.at(State::BetweenSteps);
        }
        let script = Arc::clone(&self.script);
        let mut welcome = false;
        let events = self.port.poll(wait, &mut |event| {
            match &event {
                WorkerEvent::Control(ToWorker::Welcome { .. }) => welcome = true,
                WorkerEvent::Control(ToWorker::Define { .. }) => script.at(State::Defined),
                WorkerEvent::Control(ToWorker::Bye) => script.at(State::Dismissed),
                WorkerEvent::Jobs(_) => script.at(State::JobTaken),
                _ => {}
            }
            sink(event);
        })?;
        if welcome {
            self.say_nonsense(State::AfterWelcome)?;
        }
        Ok(events)
    }

    fn send_control(&mut self, message: &FromWorker) -> Result<(), TransportError> {
        let hello = matches!(message, FromWorker::Hello { .. });
        if hello {
            self.say_nonsense(State::BeforeHello)?;
        }
        self.port.send_control(message)?;
        if hello {
            self.say_nonsense(State::AfterHello)?;
        }
        Ok(())
    }

    fn send_replies(&mut self, replies: &[LoadedReply<'_>]) -> Result<(), TransportError> {
        self.answered.set(true);
        let mut replies: Vec<LoadedReply<'_>> = replies.to_vec();
        let mut damaged = replies[0].state.to_vec();
        let mut twice = false;
        match self.script.due(State::Solved) {
            Some(Action::Late) => std::thread::sleep(Duration::from_millis(300)),
            Some(Action::Twice) => twice = true,
            Some(Action::NotANumber) => replies[0].reply.stress.0[0] = f64::NAN,
            Some(Action::DamagedState) if !damaged.is_empty() => {
                let middle = damaged.len() / 2;
                damaged[middle] ^= 1;
                replies[0].state = &damaged;
            }
            Some(Action::Invent) => {
                let mut invented = replies[0];
                invented.reply.job += 1 << 40;
                replies.push(invented);
            }
            Some(action) => suffer(action),
            None => {}
        }
        if self.script.due(State::MidReply).is_some() {
            // Another thread strikes while this one writes, and writes again, into the channel.
            std::thread::spawn(|| {
                std::thread::sleep(Duration::from_micros(30));
                suffer(Action::Kill);
            });
            loop {
                self.port.send_replies(&replies)?;
            }
        }
        self.port.send_replies(&replies)?;
        if twice {
            self.port.send_replies(&replies)?;
        }
        self.say_nonsense(State::Replied)
    }
}

struct FaultyEngine {
    inner: Box<dyn RveEngine>,
    script: Arc<Script>,
}

impl RveEngine for FaultyEngine {
    fn capabilities(&self) -> Capabilities {
        self.inner.capabilities()
    }

    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        Ok(Box::new(FaultySolver { solver: self.inner.create(definition)?, script: Arc::clone(&self.script) }))
    }
}

struct FaultySolver {
    solver: Box<dyn RveSolver>,
    script: Arc<Script>,
}

impl RveSolver for FaultySolver {
    fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, RveError> {
        match self.script.due(State::MidSolve) {
            Some(Action::Kill) => {
                std::thread::spawn(|| {
                    std::thread::sleep(Duration::from_micros(200));
                    suffer(Action::Kill);
                });
                // Far more increments than asked: the strike comes in the middle.
                let long = TrialOptions { ramp_steps: 1_000_000, ..*options };
                return self.solver.trial(target, &long);
            }
            Some(action) => {
                let _ = self.solver.trial(target, options);
                suffer(action);
            }
            None => {}
        }
        self.solver.trial(target, options)
    }

    fn commit(&mut self) -> Result<(), RveError> {
        self.solver.commit()
    }

    fn rollback(&mut self) {
        self.solver.rollback();
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.solver.snapshot(out);
    }

    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError> {
        self.solver.snapshot_trial(out)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError> {
        self.solver.restore(bytes)
    }
}
