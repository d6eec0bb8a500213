//! A port whose workers live in the test: they compute a pure function, in an order drawn from a seed, and misbehave
//! on request.

use crate::material::PointTrial;
use crate::pool::{HangPolicy, Interrupt, JoiningWorkers, Pool, PoolSettings, SupplyStatus, WorkerSupply};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedJob, LoadedReply, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{
    Capabilities, Cost, Definition, DefinitionId, OptionalResult, PROTOCOL_VERSION, RveError, StateId, TangentKind,
    Tensor2, Tensor4, TrialOptions, TrialResult,
};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What a worker does with one slice instead of answering it properly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Its process ends.
    Die,
    /// Says nothing until it is killed.
    Hang,
    /// Answers twice.
    Twice,
    /// Answers, and adds an answer to a job that nobody gave out.
    Invent,
    /// Says goodbye, and answers all the same.
    LeaveThenAnswer,
    /// Says goodbye, and stays until it is killed.
    LeaveAndStay,
    /// Sends a stress that is not a number.
    NotANumber,
    /// Sends a trial state that does not match its name.
    DamagedState,
    /// Sends no trial state.
    MissingState,
    /// Sends the state that the job began with.
    SameState,
    /// Sends a negative volume.
    NegativeVolume,
    /// Sends a count of force evaluations with which sums wrap around.
    ManyEvaluations,
    /// Answers about another point.
    OtherPoint,
    /// Leaves the tangent out.
    NoTangent,
    /// Sends a status that does not exist.
    BadStatus,
    /// Has forgotten everything it held.
    Amnesia,
    /// Asks for a snapshot whatever the job carries.
    AlwaysNeedsState,
}

/// Answer on its way to the macro.
type Answer = (TrialReply, Vec<u8>, Vec<u8>);

enum Outgoing {
    Control(WorkerId, FromWorker),
    Replies(WorkerId, Vec<Answer>),
    Lost(WorkerId),
    Refused,
}

struct FakeWorker {
    definitions: BTreeSet<DefinitionId>,
    cache: VecDeque<(StateId, Vec<u8>)>,
    capacity: usize,
    inbox: VecDeque<Vec<(TrialJob, Vec<u8>)>>,
    /// Faults of the first slices.
    faults: VecDeque<Option<Fault>>,
    /// Points at which it always dies.
    deadly: Option<u64>,
    silent: bool,
    draining: bool,
}

/// All workers and what they have sent.
#[derive(Default)]
pub(super) struct World {
    workers: BTreeMap<WorkerId, FakeWorker>,
    outgoing: VecDeque<Outgoing>,
    hired: u32,
    random: u64,
    /// Jobs received by any worker, with the bytes they carried.
    pub(super) received: Vec<(TrialJob, usize)>,
    /// Control messages received.
    pub(super) sent: Vec<(WorkerId, ToWorker)>,
    pub(super) killed: Vec<WorkerId>,
    /// Jobs of the longest slice that goes on from states.
    pub(super) longest_slice: usize,
    /// Jobs of every slice.
    pub(super) slices: Vec<usize>,
    /// What workers that are hired say of the trials that they solve side by side.
    pub(super) side_by_side: u32,
    /// Workers that end are reported as cut off with their host.
    pub(super) hosts_are_lost: bool,
    /// Workers that are requested to finish and leave finish and stay.
    pub(super) drains_are_ignored: bool,
}

impl World {
    fn draw(&mut self, below: usize) -> usize {
        // Knuth's multiplier; the high bits are good enough to shuffle a few workers.
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33) as usize % below
    }

    /// Adds a worker that says hello.
    pub(super) fn hire(&mut self, capacity: usize, faults: &[Option<Fault>], deadly: Option<u64>) -> WorkerId {
        let mut greeting = hello(capacity as u32, self.hired);
        if let FromWorker::Hello { capabilities, .. } = &mut greeting {
            capabilities.side_by_side = self.side_by_side;
        }
        self.hire_saying(greeting, capacity, faults, deadly)
    }

    pub(super) fn hire_saying(
        &mut self,
        hello: FromWorker,
        capacity: usize,
        faults: &[Option<Fault>],
        deadly: Option<u64>,
    ) -> WorkerId {
        let id = WorkerId(self.hired);
        self.hired += 1;
        let worker = FakeWorker {
            definitions: BTreeSet::new(),
            cache: VecDeque::new(),
            capacity,
            inbox: VecDeque::new(),
            faults: faults.iter().copied().collect(),
            deadly,
            silent: false,
            draining: false,
        };
        self.workers.insert(id, worker);
        self.outgoing.push_back(Outgoing::Control(id, hello));
        id
    }

    pub(super) fn send_rubbish(&mut self) {
        self.outgoing.push_back(Outgoing::Refused);
    }

    pub(super) fn send_again(&mut self, worker: WorkerId, message: FromWorker) {
        self.outgoing.push_back(Outgoing::Control(worker, message));
    }

    fn lose(&mut self, id: WorkerId) {
        if self.workers.remove(&id).is_some() {
            self.outgoing.push_back(Outgoing::Lost(id));
        }
    }

    /// Lets one worker, drawn at random, deal with one slice.
    fn work(&mut self) {
        let ready: Vec<_> =
            self.workers.iter().filter(|(_, one)| !one.inbox.is_empty() && !one.silent).map(|(id, _)| *id).collect();
        if ready.is_empty() {
            return;
        }
        let id = ready[self.draw(ready.len())];
        let worker = self.workers.get_mut(&id).expect("the worker is ready");
        let slice = worker.inbox.pop_front().expect("the worker has a slice");
        let fault = worker.faults.pop_front().flatten();
        if fault == Some(Fault::Die) || slice.iter().any(|(job, _)| Some(job.point) == worker.deadly) {
            return self.lose(id);
        }
        if fault == Some(Fault::Hang) {
            worker.silent = true;
            return;
        }
        if fault == Some(Fault::LeaveAndStay) {
            worker.silent = true;
            let reason = "maintenance".to_owned();
            self.outgoing.push_back(Outgoing::Control(id, FromWorker::Bye { reason }));
            return;
        }
        if fault == Some(Fault::Amnesia) {
            worker.cache.clear();
            worker.definitions.clear();
        }
        let mut answers: Vec<_> = slice.iter().map(|(job, state)| worker.answer(job, state, fault)).collect();
        if fault == Some(Fault::Invent) {
            let mut invented = answers[0].clone();
            invented.0.job += 1 << 40;
            answers.push(invented);
        }
        if fault == Some(Fault::LeaveThenAnswer) {
            let reason = "maintenance".to_owned();
            self.outgoing.push_back(Outgoing::Control(id, FromWorker::Bye { reason }));
        }
        if fault == Some(Fault::Twice) {
            self.outgoing.push_back(Outgoing::Replies(id, answers.clone()));
        }
        self.outgoing.push_back(Outgoing::Replies(id, answers));
        if fault == Some(Fault::LeaveThenAnswer) {
            self.lose(id);
        }
        self.leave_when_drained(id);
    }

    /// A worker that was asked to finish goes when it holds nothing more.
    fn leave_when_drained(&mut self, id: WorkerId) {
        if self.workers.get(&id).is_some_and(|worker| worker.draining && worker.inbox.is_empty()) {
            self.outgoing.push_back(Outgoing::Control(id, FromWorker::Bye { reason: "drained".to_owned() }));
            self.lose(id);
        }
    }
}

impl FakeWorker {
    fn keep(&mut self, id: StateId, bytes: Vec<u8>) {
        self.cache.retain(|(held, _)| *held != id);
        self.cache.push_back((id, bytes));
        while self.cache.len() > self.capacity {
            self.cache.pop_front();
        }
    }

    fn answer(&mut self, job: &TrialJob, carried: &[u8], fault: Option<Fault>) -> Answer {
        let bare = |status| (TrialReply::bare(job, status), Vec::new(), Vec::new());
        if !self.definitions.contains(&job.definition) {
            return bare(ReplyStatus::NeedDefinition);
        }
        let held = self.cache.iter().find(|(id, _)| *id == job.state).map(|(_, bytes)| bytes.clone());
        let state = match (job.state == StateId::NONE, carried.is_empty(), held) {
            (true, _, _) => Vec::new(),
            (false, false, _) => carried.to_vec(),
            (false, true, Some(bytes)) => bytes,
            (false, true, None) => return bare(ReplyStatus::NeedState),
        };
        if fault == Some(Fault::AlwaysNeedsState) {
            return bare(ReplyStatus::NeedState);
        }
        if job.target.0[0] > 1.0 {
            let error = RveError::TargetTooLarge { norm: job.target.0[0], limit: 1.0 };
            let text = rmp_serde::to_vec(&error).expect("errors are writable");
            return (TrialReply::bare(job, ReplyStatus::Failed), Vec::new(), text);
        }
        let (answer, end) = solve(job, &state);
        self.keep(job.state, state.clone());
        self.keep(StateId::of(&end), end.clone());
        let mut reply = TrialReply::done(job, &answer, StateId::of(&end), end.len() as u64);
        let mut end = end;
        match fault {
            Some(Fault::NotANumber) => reply.stress.0[4] = f64::NAN,
            Some(Fault::DamagedState) => end[0] ^= 1,
            Some(Fault::MissingState) => end.clear(),
            Some(Fault::SameState) => (reply.state, end) = (job.state, state),
            Some(Fault::NegativeVolume) => reply.scalars.volume_ratio = -1.0,
            Some(Fault::ManyEvaluations) => reply.cost.force_evaluations = 1 << 63,
            Some(Fault::OtherPoint) => reply.point += 1,
            Some(Fault::NoTangent) => reply.tangent_kind = 0,
            Some(Fault::BadStatus) => reply.status = 77,
            _ => {}
        }
        (reply, end, Vec::new())
    }
}

/// The law of the test: stress and end state depend on every bit of the start and of the target.
fn solve(job: &TrialJob, state: &[u8]) -> (TrialResult, Vec<u8>) {
    let mut text = job.definition.0.to_vec();
    text.extend_from_slice(state);
    text.extend(job.target.0.iter().flat_map(|component| component.to_bits().to_le_bytes()));
    let end = StateId::of(&text).0.repeat(8);
    let mut stress = job.target;
    stress.0[4] += f64::from(end[0]) + f64::from(end[1]) / 7.0;
    let tangent = (job.tangent != 0).then(|| Box::new(Tensor4([f64::from(end[2]); 81])));
    let answer = TrialResult {
        stress,
        tangent,
        scalars: Default::default(),
        observed: Default::default(),
        cost: Cost { force_evaluations: 1 + u64::from(end[3]), solve_nanoseconds: 1000, ..Cost::default() },
        flags: Default::default(),
    };
    (answer, end)
}

/// A hello that is accepted.
pub(super) fn hello(state_cache: u32, pid: u32) -> FromWorker {
    let capabilities = Capabilities {
        engine: "test".into(),
        version: "1".into(),
        dimensions: vec![2],
        tangents: TangentKind::ALL.to_vec(),
        ..Capabilities::default()
    };
    FromWorker::Hello { protocol: PROTOCOL_VERSION, run: "test".into(), pid, capabilities, state_cache }
}

/// The same of an engine that delivers these optional results.
pub(super) fn hello_delivering(results: &[OptionalResult]) -> FromWorker {
    let FromWorker::Hello { protocol, run, pid, capabilities, state_cache } = hello(8, 1) else { unreachable!() };
    let observables = results.iter().map(|result| result.keyword().to_owned()).collect();
    FromWorker::Hello { protocol, run, pid, capabilities: Capabilities { observables, ..capabilities }, state_cache }
}

/// The port.
pub(super) struct ScriptedPort {
    world: Rc<RefCell<World>>,
    woken: Arc<AtomicBool>,
}

struct Flag(Arc<AtomicBool>);

impl Waker for Flag {
    fn wake(&self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

impl MacroPort for ScriptedPort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        if self.woken.swap(false, Ordering::SeqCst) {
            sink(MacroEvent::Woken);
            return Ok(1);
        }
        let mut world = self.world.borrow_mut();
        if world.outgoing.is_empty() {
            world.work();
        }
        let events: Vec<_> = world.outgoing.drain(..).collect();
        let hosts_are_lost = world.hosts_are_lost;
        drop(world);
        if events.is_empty() {
            std::thread::sleep(wait.min(Duration::from_millis(1)));
        }
        let count = events.len();
        for event in events {
            match event {
                Outgoing::Control(worker, message) => sink(MacroEvent::Control(worker, message)),
                Outgoing::Lost(worker) if hosts_are_lost => {
                    sink(MacroEvent::CutOff(worker, "its host does not answer".into()));
                }
                Outgoing::Lost(worker) => sink(MacroEvent::Lost(worker, "process ended".into())),
                Outgoing::Refused => sink(MacroEvent::Refused("rubbish".into())),
                Outgoing::Replies(worker, answers) => {
                    let loaded: Vec<_> = answers
                        .iter()
                        .map(|(reply, state, error)| LoadedReply { reply: reply.seal(error), state, error })
                        .collect();
                    sink(MacroEvent::Replies(worker, &loaded));
                }
            }
        }
        Ok(count)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        let mut world = self.world.borrow_mut();
        world.sent.push((worker, message.clone()));
        let drains_are_ignored = world.drains_are_ignored;
        let Some(known) = world.workers.get_mut(&worker) else { return Err(TransportError::Gone(worker)) };
        match message {
            ToWorker::Define { definition } => {
                known.definitions.insert(definition.id());
            }
            ToWorker::Bye | ToWorker::Refused { .. } => world.lose(worker),
            ToWorker::Drain if drains_are_ignored => {}
            ToWorker::Drain => {
                known.draining = true;
                world.leave_when_drained(worker);
            }
            ToWorker::Welcome { .. } => {}
        }
        Ok(())
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        let mut world = self.world.borrow_mut();
        if jobs.iter().all(|loaded| loaded.job.state != StateId::NONE) {
            world.longest_slice = world.longest_slice.max(jobs.len());
        }
        world.slices.push(jobs.len());
        world.received.extend(jobs.iter().map(|loaded| (loaded.job, loaded.state.len())));
        let known = world.workers.get_mut(&worker).ok_or(TransportError::Gone(worker))?;
        known.inbox.push_back(jobs.iter().map(|loaded| (loaded.job, loaded.state.to_vec())).collect());
        Ok(())
    }

    fn kill(&mut self, worker: WorkerId) {
        let mut world = self.world.borrow_mut();
        world.killed.push(worker);
        world.lose(worker);
    }

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::new(Flag(self.woken.clone()))
    }
}

/// Replaces lost workers by well-behaved ones (or by ones that die at a point), a limited number of times.
pub(super) struct Replacements {
    pub(super) world: Rc<RefCell<World>>,
    pub(super) left: u64,
    pub(super) started: u64,
    pub(super) deadly: Option<u64>,
    pub(super) due: u64,
}

impl WorkerSupply for Replacements {
    fn joined(&mut self, _pid: u32) {}

    fn refused(&mut self, _pid: u32, _reason: &str) {
        self.left = 0;
    }

    fn lost(&mut self, _pid: u32, _had_answered: bool) {
        self.due += 1;
    }

    fn tend(&mut self) -> SupplyStatus {
        while self.due > 0 && self.left > 0 {
            self.due -= 1;
            self.left -= 1;
            self.started += 1;
            self.world.borrow_mut().hire(4, &[], self.deadly);
        }
        if self.due > 0 && self.left == 0 {
            return SupplyStatus::Exhausted("no replacements are left".into());
        }
        SupplyStatus::Expected { check_again: Duration::from_millis(1) }
    }

    fn restarts(&self) -> u64 {
        self.started
    }

    fn finish(&mut self) {}
}

/// Everything a test needs.
pub(super) struct Stage {
    pub(super) world: Rc<RefCell<World>>,
    pub(super) interrupt: Interrupt,
    pub(super) settings: PoolSettings,
    pub(super) supply: Option<Replacements>,
}

impl Stage {
    pub(super) fn new(seed: u64) -> Self {
        let world = Rc::new(RefCell::new(World { random: seed, ..World::default() }));
        let short = Duration::from_millis(20);
        let hang = HangPolicy { floor: short, factor: 1.0, unknown: short, ..HangPolicy::default() };
        let retry_delay = Duration::from_millis(20);
        let settings = PoolSettings {
            worker_timeout: Duration::from_millis(50),
            hang,
            retry_delay,
            ..PoolSettings::new("test")
        };
        Self { world, interrupt: Interrupt::new(), settings, supply: None }
    }

    pub(super) fn hire(self, capacity: usize, faults: &[Option<Fault>]) -> Self {
        self.world.borrow_mut().hire(capacity, faults, None);
        self
    }

    pub(super) fn replacing(mut self, left: u64, deadly: Option<u64>) -> Self {
        let world = self.world.clone();
        self.supply = Some(Replacements { world, left, started: 0, deadly, due: 0 });
        self
    }

    /// A pool of `points` points, the odd ones of another definition.
    pub(super) fn open(&mut self, points: usize) -> Pool<ScriptedPort> {
        let port = ScriptedPort { world: self.world.clone(), woken: Arc::default() };
        let supply: Box<dyn WorkerSupply> = match self.supply.take() {
            Some(supply) => Box::new(supply),
            None => Box::new(JoiningWorkers),
        };
        let definitions = vec![Definition { bytes: vec![1] }, Definition { bytes: vec![2] }];
        let made_of: Vec<_> = (0..points).map(|point| point % 2).collect();
        Pool::new(port, supply, self.interrupt.clone(), self.settings.clone(), definitions, &made_of)
    }
}

/// One question per point, all different.
pub(super) fn questions(points: usize, step: u32) -> Vec<PointTrial> {
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    (0..points)
        .map(|point| {
            let strain = 1e-4 * (1.0 + 0.37 * point as f64 + f64::from(step));
            PointTrial { point, target: Tensor2::from_plane([[-strain, 0.0], [0.0, strain]]), options }
        })
        .collect()
}
