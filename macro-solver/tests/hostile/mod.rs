//! A pool whose workers send broken replies among sound ones, from a generator that is fixed by its seed. Shared by the
//! quick test and the long hunt.
//!
//! Two manners. *Damaged*: bytes of a sound message change on their way. None may be believed, each is counted once, and
//! the answers are those of an undisturbed pool. *Hostile*: fields are changed on purpose and the message is sealed anew,
//! so that the checks behind the seal are reached. Such a worker may lie about numbers; but nothing that is not finite,
//! not named by its content, or about another question gets through, and nobody panics.
#![allow(dead_code, unreachable_pub, reason = "each user compiles its own copy")]

#[path = "../../../protocol/tests/mutation/mod.rs"]
mod mutation;

use macro_solver::material::{MaterialError, PointMaterial, PointTrial};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, PoolStatistics};
use mutation::{Dice, broken};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::frame::{Frame, Outgoing};
use protocol::transport::{LoadedJob, LoadedReply, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{
    Capabilities, Cost, Definition, PROTOCOL_VERSION, RveError, StateId, TangentKind, Tensor2, Tensor4, TrialOptions,
    TrialResult,
};
use std::cell::RefCell;
use std::collections::{BTreeSet, VecDeque};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

const POINTS: usize = 6;
const WORKERS: u32 = 3;

/// Steps of one pool: a fresh one is made then, so that its list of dead workers stays short.
const STEPS: u32 = 20;

/// How replies are broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manner {
    Damaged,
    Hostile,
}

/// What became of the broken replies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Broken replies sent.
    pub sent: u64,
    /// No messages of the protocol.
    pub refused: u64,
    /// Ended their worker.
    pub faulty: u64,
    /// About a job that was not the sender's.
    pub late: u64,
    /// About a job that nobody gave out.
    pub unknown: u64,
    /// Asked for a state or a definition.
    pub missed: u64,
    /// Hostile ones that were taken for a failure of the point.
    pub failures: u64,
}

impl Findings {
    /// Broken replies that the pool has counted in one way or another.
    pub fn counted(&self) -> u64 {
        self.refused + self.faulty + self.late + self.unknown + self.missed
    }

    fn add(&mut self, statistics: &PoolStatistics) {
        self.refused += statistics.refused_messages;
        self.faulty += statistics.workers_faulty;
        self.late += statistics.late_replies;
        self.unknown += statistics.unknown_replies;
        self.missed += statistics.state_misses + statistics.definition_misses;
    }
}

/// Plays pools until about `messages` broken replies were sent.
///
/// # Panics
/// When a broken reply is believed or, in the damaged manner, not counted: that is a finding.
pub fn hunt(manner: Manner, seed: u64, messages: u64) -> Findings {
    let mut findings = Findings::default();
    let mut dice = Dice(seed);
    while findings.sent < messages {
        play(manner, dice.draw(), &mut findings);
    }
    findings
}

fn play(manner: Manner, seed: u64, findings: &mut Findings) {
    let world = Rc::new(RefCell::new(World::new(manner, seed)));
    let settings = PoolSettings { quarantine_after: u32::MAX, ..PoolSettings::new("hunt") };
    let (supply, definition) = (Box::new(JoiningWorkers), Definition { bytes: vec![1] });
    let port = Port(Rc::clone(&world));
    let mut pool = Pool::new(port, supply, Interrupt::new(), settings, vec![definition], &[0; POINTS]);
    for step in 0..STEPS {
        let trials = questions(step);
        let starts: Vec<Vec<u8>> = (0..POINTS).map(|point| pool.committed_snapshot(point).1.bytes.to_vec()).collect();
        match pool.evaluate(&trials) {
            Ok(answers) => {
                for ((trial, start), answer) in trials.iter().zip(&starts).zip(&answers) {
                    believable(manner, trial, start, answer);
                }
                pool.commit().expect("a pool commits what it has been answered");
            }
            Err(MaterialError::Point { .. }) if manner == Manner::Hostile => findings.failures += 1,
            Err(error) => panic!("seed {seed:#x}: {error}"),
        }
        for point in 0..POINTS {
            let state = pool.committed_snapshot(point).1;
            assert!(state.bytes.is_empty() || StateId::of(&state.bytes) == state.id, "seed {seed:#x}: a false name");
        }
    }
    let statistics = pool.statistics();
    let sent = world.borrow().sent;
    let mut here = Findings { sent, ..Findings::default() };
    here.add(&statistics);
    if manner == Manner::Damaged {
        assert_eq!(here.counted(), sent, "seed {seed:#x}: {here:?}");
    }
    findings.sent += sent;
    findings.add(&statistics);
}

/// What the macro may take for the answer to `trial`.
fn believable(manner: Manner, trial: &PointTrial, start: &[u8], answer: &TrialResult) {
    match manner {
        Manner::Damaged => {
            let (expected, _) = solve(trial.point as u64, &trial.target, start);
            assert_eq!(*answer, expected, "point {}", trial.point);
        }
        Manner::Hostile => {
            let tangent = answer.tangent.as_deref().expect("the tangent that was asked for");
            assert!(answer.stress.is_finite() && tangent.is_finite(), "point {}", trial.point);
        }
    }
}

fn questions(step: u32) -> Vec<PointTrial> {
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let target = |point: usize| {
        let strain = 1e-4 * (1.0 + point as f64 + f64::from(step) / 7.0);
        Tensor2::from_plane([[strain, 0.0], [0.0, -strain]])
    };
    (0..POINTS).map(|point| PointTrial { point, target: target(point), options }).collect()
}

/// The law: everything depends on every bit of the question.
fn solve(point: u64, target: &Tensor2, start: &[u8]) -> (TrialResult, Vec<u8>) {
    let mut text = point.to_le_bytes().to_vec();
    text.extend_from_slice(start);
    text.extend(target.0.iter().flat_map(|component| component.to_bits().to_le_bytes()));
    let end = StateId::of(&text).0.repeat(3);
    let mut stress = *target;
    stress.0[4] += f64::from(end[0]) + f64::from(end[1]) / 7.0;
    let answer = TrialResult {
        stress,
        tangent: Some(Box::new(Tensor4([f64::from(end[2]); 81]))),
        scalars: Default::default(),
        observed: Default::default(),
        cost: Cost { force_evaluations: 1 + u64::from(end[3]), ..Cost::default() },
        flags: Default::default(),
    };
    (answer, end)
}

struct World {
    manner: Manner,
    dice: Dice,
    alive: BTreeSet<WorkerId>,
    hired: u32,
    /// Jobs in hand with the bytes they start from, and whether a broken reply was already sent for them.
    inbox: VecDeque<(WorkerId, TrialJob, Vec<u8>, bool)>,
    /// All states ever made: these workers never forget.
    states: Vec<(StateId, Vec<u8>)>,
    lost: Vec<WorkerId>,
    sent: u64,
}

impl World {
    fn new(manner: Manner, seed: u64) -> Self {
        let (alive, lost) = (BTreeSet::new(), Vec::new());
        let (inbox, states) = (VecDeque::new(), Vec::new());
        Self { manner, dice: Dice(seed), alive, hired: 0, inbox, states, lost, sent: 0 }
    }

    fn start_of(&self, state: StateId) -> Vec<u8> {
        let known = self.states.iter().find(|(id, _)| *id == state);
        known.map_or_else(Vec::new, |(_, bytes)| bytes.clone())
    }

    /// The sound reply to a job.
    fn reply(&mut self, job: &TrialJob, start: &[u8]) -> (TrialReply, Vec<u8>) {
        let (answer, end) = solve(job.point, &job.target, start);
        let id = StateId::of(&end);
        if self.states.iter().all(|(known, _)| *known != id) {
            self.states.push((id, end.clone()));
        }
        (TrialReply::done(job, &answer, id, end.len() as u64), end)
    }
}

struct Port(Rc<RefCell<World>>);

impl MacroPort for Port {
    fn poll(&mut self, _wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        let mut world = self.0.borrow_mut();
        for worker in std::mem::take(&mut world.lost) {
            sink(MacroEvent::Lost(worker, "ended".to_owned()));
        }
        while world.alive.len() < WORKERS as usize {
            let worker = WorkerId(world.hired);
            world.hired += 1;
            world.alive.insert(worker);
            sink(MacroEvent::Control(worker, hello(worker.0)));
        }
        let Some((worker, job, start, tried)) = world.inbox.pop_front() else { return Ok(1) };
        let (reply, state) = world.reply(&job, &start);
        let sound = Outgoing::Replies(&[LoadedReply { reply, state: &state, error: b"" }]).to_vec(1);
        if tried || world.dice.below(2) == 0 {
            deliver(worker, &sound, sink);
            return Ok(1);
        }
        // The sound reply follows, if the worker is still there then.
        world.inbox.push_front((worker, job, start, true));
        match world.manner {
            Manner::Damaged => {
                let mut damaged = broken(std::slice::from_ref(&sound), &mut world.dice);
                // Who sends is the port's to check, and this port has none: that field stays as it was.
                if damaged.len() >= 32 {
                    damaged[24..32].copy_from_slice(&sound[24..32]);
                }
                if damaged != sound {
                    world.sent += 1;
                    deliver(worker, &damaged, sink);
                }
            }
            Manner::Hostile => {
                world.sent += 1;
                let (reply, state, error) = lie(reply, state, &mut world.dice);
                let loaded = LoadedReply { reply: reply.seal(&error), state: &state, error: &error };
                sink(MacroEvent::Replies(worker, &[loaded]));
            }
        }
        Ok(1)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        if matches!(message, ToWorker::Bye) {
            self.kill(worker);
        }
        Ok(())
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        let mut world = self.0.borrow_mut();
        for loaded in jobs {
            let start =
                if loaded.state.is_empty() { world.start_of(loaded.job.state) } else { loaded.state.to_vec() };
            world.inbox.push_back((worker, loaded.job, start, false));
        }
        Ok(())
    }

    fn kill(&mut self, worker: WorkerId) {
        let mut world = self.0.borrow_mut();
        world.inbox.retain(|(holder, ..)| *holder != worker);
        if world.alive.remove(&worker) {
            world.lost.push(worker);
        }
    }

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::new(NoWaker)
    }
}

struct NoWaker;

impl Waker for NoWaker {
    fn wake(&self) {}
}

/// Gives a message to the macro as a port does.
fn deliver(worker: WorkerId, message: &[u8], sink: &mut dyn FnMut(MacroEvent<'_>)) {
    match Frame::parse(message).and_then(|frame| frame.replies()) {
        Ok(replies) => sink(MacroEvent::Replies(worker, &replies)),
        Err(error) => sink(MacroEvent::Refused(error.to_string())),
    }
}

/// Changes a sound reply on purpose.
fn lie(mut reply: TrialReply, mut state: Vec<u8>, dice: &mut Dice) -> (TrialReply, Vec<u8>, Vec<u8>) {
    let mut error = Vec::new();
    for _ in 0..=dice.below(2) {
        match dice.below(12) {
            0 => reply.job = reply.job.wrapping_add(dice.below(5) as u64).wrapping_sub(2),
            1 => reply.job = dice.draw(),
            2 => reply.point ^= 1 << dice.below(64),
            3 => reply.status = dice.below(6) as u32,
            4 => reply.tangent_kind = dice.below(22) as u32,
            5 => reply.flags = dice.draw() as u32,
            6 => reply.state.0[dice.below(16)] ^= 1 << dice.below(8),
            7 if !state.is_empty() => state[dice.below(48) % 48] ^= 1,
            8 => state.clear(),
            9 => reply.stress.0[dice.below(9)] = [f64::NAN, f64::INFINITY, -f64::NAN, 1e308][dice.below(4)],
            10 => reply.tangent.0[dice.below(81)] = f64::from_bits(dice.draw()),
            _ => {
                reply.status = ReplyStatus::Failed as u32;
                error = match dice.below(4) {
                    0 => Vec::new(),
                    1 => (0..dice.below(40)).map(|_| dice.draw() as u8).collect(),
                    2 => packed(&RveError::Snapshot("no".to_owned())),
                    _ => packed(&RveError::TargetTooLarge { norm: f64::NAN, limit: 1.0 }),
                };
            }
        }
    }
    (reply, state, error)
}

fn packed(error: &RveError) -> Vec<u8> {
    rmp_serde::to_vec(error).expect("errors are writable")
}

fn hello(pid: u32) -> FromWorker {
    let capabilities = Capabilities {
        engine: "hunted".into(),
        version: "1".into(),
        dimensions: vec![2],
        tangents: TangentKind::ALL.to_vec(),
        ..Capabilities::default()
    };
    // A process id that no process has: figures of foreign processes are not read.
    let pid = u32::MAX - pid;
    FromWorker::Hello { protocol: PROTOCOL_VERSION, run: "hunt".into(), pid, capabilities, state_cache: 4096 }
}
