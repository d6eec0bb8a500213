//! The worker loop against a toy engine over the in-process transport.

use super::*;
use claims::Claim;
use protocol::transport::in_process::{InProcessMacroPort, channel};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort, WorkerId};
use protocol::wire::{ReplyStatus, TrialReply};
use protocol::{
    Capabilities, DefinitionId, RveSolver, StateId, TangentKind, Tensor2, TrialOptions, TrialResult, snapshot,
};
use std::thread::JoinHandle;

const WAIT: Duration = Duration::from_secs(5);

/// A solver whose state is the running product of `1 + H11` and whose stress is that product.
struct Toy {
    committed: f64,
    trial: Option<f64>,
}

impl RveSolver for Toy {
    fn trial(&mut self, target: &Tensor2, _: &TrialOptions) -> Result<TrialResult, RveError> {
        assert!(target.0[8] == 0.0, "thickness must not change");
        self.trial = None;
        if target.0[4] < 0.0 {
            return Err(RveError::TargetInverted { determinant: target.0[4] });
        }
        let value = self.committed * (1.0 + target.0[0]);
        self.trial = Some(value);
        let mut stress = Tensor2::ZERO;
        stress.0[0] = if target.0[1] == 0.0 { value } else { f64::NAN };
        Ok(TrialResult {
            stress,
            tangent: None,
            scalars: Default::default(),
            observed: Default::default(),
            cost: Default::default(),
            flags: Default::default(),
        })
    }
    fn commit(&mut self) -> Result<(), RveError> {
        self.committed = self.trial.take().ok_or(RveError::NothingToCommit)?;
        Ok(())
    }
    fn rollback(&mut self) {
        self.trial = None;
    }
    fn snapshot(&self, out: &mut Vec<u8>) {
        snapshot::seal("toy", &self.committed.to_le_bytes(), out);
    }
    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError> {
        snapshot::seal("toy", &self.trial.ok_or(RveError::NothingToCommit)?.to_le_bytes(), out);
        Ok(())
    }
    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError> {
        let payload = snapshot::open("toy", bytes).map_err(|error| RveError::Snapshot(error.to_string()))?;
        self.committed = f64::from_le_bytes(payload.try_into().unwrap());
        self.trial = None;
        Ok(())
    }
}

struct ToyEngine;

impl RveEngine for ToyEngine {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            engine: "toy".into(),
            version: "1".into(),
            dimensions: vec![2],
            tangents: vec![TangentKind::None],
            ..Capabilities::default()
        }
    }
    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        if definition.bytes.is_empty() {
            return Err(RveError::Definition("an empty definition".into()));
        }
        assert!(definition.bytes != [0], "nothing grows from nothing");
        Ok(Box::new(Toy { committed: f64::from(definition.bytes[0]), trial: None }))
    }
}

/// What a test remembers of a reply.
#[derive(Clone, Debug)]
struct Heard {
    reply: TrialReply,
    state: Vec<u8>,
    error: Option<RveError>,
}

impl Heard {
    fn status(&self) -> ReplyStatus {
        ReplyStatus::from_wire(self.reply.status).unwrap()
    }
}

/// A macro in the test's thread, a worker in another.
struct Stage {
    port: InProcessMacroPort,
    worker: JoinHandle<Result<ExitReason, ServeError>>,
    controls: Vec<FromWorker>,
    replies: Vec<Heard>,
}

impl Stage {
    fn open(state_cache: u32) -> Self {
        let (port, connector) = channel();
        let options = ServeOptions { run: "test".into(), state_cache, grace: Duration::from_secs(10) };
        let worker = std::thread::spawn(move || serve(&mut ToyEngine, &mut connector.join(), &options));
        let mut stage = Self { port, worker, controls: Vec::new(), replies: Vec::new() };
        stage.listen(|stage| !stage.controls.is_empty());
        stage
    }

    /// A stage whose worker is welcome and knows the definition of bytes `[2]`.
    fn ready(state_cache: u32) -> (Self, DefinitionId) {
        let mut stage = Self::open(state_cache);
        let definition = Definition { bytes: vec![2] };
        let id = definition.id();
        stage.say(&ToWorker::Welcome { worker: 0 });
        stage.say(&ToWorker::Define { definition });
        (stage, id)
    }

    fn say(&mut self, message: &ToWorker) {
        self.port.send_control(WorkerId(0), message).unwrap();
    }

    fn listen(&mut self, enough: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !enough(self) {
            assert!(begin.elapsed() < WAIT, "nothing was heard for {WAIT:?}");
            let (controls, replies) = (&mut self.controls, &mut self.replies);
            self.port
                .poll(WAIT, &mut |event| match event {
                    MacroEvent::Control(_, message) => controls.push(message),
                    MacroEvent::Replies(_, loaded) => replies.extend(loaded.iter().map(|one| Heard {
                        reply: one.reply,
                        state: one.state.to_vec(),
                        error: (!one.error.is_empty()).then(|| rmp_serde::from_slice(one.error).unwrap()),
                    })),
                    MacroEvent::Lost(..) => {}
                    other => panic!("unexpected {other:?}"),
                })
                .unwrap();
        }
    }

    fn ask(&mut self, jobs: &[LoadedJob<'_>]) -> Vec<Heard> {
        self.port.send_jobs(WorkerId(0), jobs).unwrap();
        self.replies.clear();
        let count = jobs.len();
        self.listen(|stage| stage.replies.len() >= count);
        std::mem::take(&mut self.replies)
    }

    fn ask_one(&mut self, job: TrialJob, state: &[u8]) -> Heard {
        self.ask(&[LoadedJob { job, state }]).remove(0)
    }

    fn dismiss(mut self) {
        self.say(&ToWorker::Bye);
        assert_eq!(self.worker.join().unwrap().unwrap(), ExitReason::Dismissed);
    }
}

fn job(definition: DefinitionId, state: StateId, stretch: f64) -> TrialJob {
    let mut target = Tensor2::ZERO;
    target.0[0] = stretch;
    TrialJob {
        job: 1,
        point: 0,
        definition,
        state,
        target,
        tangent: 0,
        ramp_steps: 1,
        observables: 0,
        attempt: 0,
        state_length: 0,
        friction_reduction: 0.0,
    }
}

#[test]
fn a_chain_of_jobs_follows_the_states_it_names() {
    let (mut stage, rve) = Stage::ready(8);
    let first = stage.ask_one(job(rve, StateId::NONE, 0.5), b"");
    assert_eq!(first.reply.stress.0[0], 3.0);
    assert_eq!(first.reply.state, StateId::of(&first.state));
    let second = stage.ask_one(job(rve, first.reply.state, 1.0), b"");
    assert_eq!(second.reply.stress.0[0], 6.0);
    let again = stage.ask_one(job(rve, StateId::NONE, 0.25), b"");
    assert_eq!(again.reply.stress.0[0], 2.5);
    stage.dismiss();
}

/// A-5, worker side: the same question gets the same bytes, whatever was asked between.
#[test]
fn duplicated_jobs_get_equal_answers() {
    let (mut stage, rve) = Stage::ready(8);
    let first = stage.ask_one(job(rve, StateId::NONE, 0.1), b"");
    let repeated = job(rve, first.reply.state, 0.2);
    let one = stage.ask_one(repeated, b"");
    stage.ask_one(job(rve, StateId::NONE, 0.7), b"");
    let two = stage.ask_one(TrialJob { attempt: 3, ..repeated }, &first.state);
    let both = stage.ask(&[LoadedJob { job: repeated, state: b"" }, LoadedJob { job: repeated, state: b"" }]);
    for other in [&two, &both[0], &both[1]] {
        let is_same = (one.reply.state, &one.state) == (other.reply.state, &other.state);
        Claim::of("A-5", "state of a worker's answer to a repeated job").holds(is_same);
        let is_same = one.reply.stress == other.reply.stress;
        Claim::of("A-5", "stress of a worker's answer to a repeated job").holds(is_same);
    }
    stage.dismiss();
}

#[test]
fn unknown_definitions_and_forgotten_states_are_asked_for() {
    let (mut stage, rve) = Stage::ready(1);
    let unknown = DefinitionId::of(b"never defined");
    assert_eq!(stage.ask_one(job(unknown, StateId::NONE, 0.1), b"").status(), ReplyStatus::NeedDefinition);
    let first = stage.ask_one(job(rve, StateId::NONE, 0.1), b"");
    let second = stage.ask_one(job(rve, StateId::NONE, 0.2), b"");
    let evicted = job(rve, first.reply.state, 0.1);
    assert_eq!(stage.ask_one(evicted, b"").status(), ReplyStatus::NeedState);
    let with_state = stage.ask_one(evicted, &first.state);
    assert_eq!(with_state.status(), ReplyStatus::Done);
    assert!(second.reply.state != first.reply.state);
    stage.dismiss();
}

#[test]
fn a_damaged_snapshot_is_refused_and_harms_nothing() {
    let (mut stage, rve) = Stage::ready(4);
    let first = stage.ask_one(job(rve, StateId::NONE, 0.1), b"");
    let mut damaged = first.state.clone();
    *damaged.last_mut().unwrap() ^= 1;
    let refused = stage.ask_one(job(rve, first.reply.state, 0.1), &damaged);
    assert!(matches!(refused.error, Some(RveError::Snapshot(_))), "{refused:?}");
    // A sound name over bytes that are no snapshot reaches the engine and is refused there.
    let noise = stage.ask_one(job(rve, StateId::of(b"noise"), 0.1), b"noise");
    assert!(matches!(noise.error, Some(RveError::Snapshot(_))), "{noise:?}");
    assert_eq!(stage.ask_one(job(rve, first.reply.state, 1.0), b"").reply.stress.0[0], 2.0 * 1.1 * 2.0);
    stage.dismiss();
}

#[test]
fn engine_errors_panics_and_nan_are_failed_answers_and_the_worker_lives_on() {
    let (mut stage, rve) = Stage::ready(4);
    let mut inverted = job(rve, StateId::NONE, 0.1);
    inverted.target.0[4] = -2.0;
    let answer = stage.ask_one(inverted, b"");
    assert_eq!(answer.error, Some(RveError::TargetInverted { determinant: -2.0 }));

    let mut panicking = job(rve, StateId::NONE, 0.1);
    panicking.target.0[8] = 1.0;
    let answer = stage.ask_one(panicking, b"");
    assert_eq!(answer.status(), ReplyStatus::Failed);
    assert_eq!(answer.error, Some(RveError::EngineFault("thickness must not change".into())));

    let mut poisoned = job(rve, StateId::NONE, 0.1);
    poisoned.target.0[1] = 1.0;
    let answer = stage.ask_one(poisoned, b"");
    assert_eq!(answer.error, Some(RveError::NotFinite { force_evaluations: 0 }));
    assert!(answer.reply.is_finite() && answer.state.is_empty());

    let not_finite = stage.ask_one(job(rve, StateId::NONE, f64::INFINITY), b"");
    assert_eq!(not_finite.error, Some(RveError::TargetNotFinite));
    let unknown_tangent = stage.ask_one(TrialJob { tangent: 77, ..job(rve, StateId::NONE, 0.1) }, b"");
    assert!(matches!(unknown_tangent.error, Some(RveError::Unsupported(_))));

    assert_eq!(stage.ask_one(job(rve, StateId::NONE, 0.5), b"").reply.stress.0[0], 3.0);
    stage.dismiss();
}

#[test]
fn a_refused_definition_is_reported() {
    let (mut stage, _) = Stage::ready(4);
    let definition = Definition { bytes: Vec::new() };
    let id = definition.id();
    stage.say(&ToWorker::Define { definition });
    stage.listen(|stage| stage.controls.len() > 1);
    let expected = FromWorker::DefinitionRefused {
        definition: id,
        reason: RveError::Definition("an empty definition".into()).to_string(),
    };
    assert_eq!(stage.controls[1], expected);
    stage.dismiss();
}

/// Another worker may well build it: the run goes on, and learns what this one's engine has said.
#[test]
fn a_definition_over_which_the_engine_broke_down_is_not_refused_and_its_jobs_tell_why() {
    let (mut stage, rve) = Stage::ready(4);
    let definition = Definition { bytes: vec![0] };
    let id = definition.id();
    stage.say(&ToWorker::Define { definition });
    let failed = stage.ask_one(job(id, StateId::NONE, 0.1), b"");
    let tells = |error: &RveError| matches!(error, RveError::EngineFault(text) if text.contains("nothing grows from nothing"));
    assert!(failed.error.as_ref().is_some_and(tells), "{:?}", failed.error);
    assert_eq!(stage.controls.len(), 1, "{:?}", stage.controls);
    assert_eq!(stage.ask_one(job(rve, StateId::NONE, 0.5), b"").reply.stress.0[0], 3.0);
    stage.dismiss();
}

#[test]
fn a_drained_worker_finishes_its_jobs_and_says_bye() {
    let (mut stage, rve) = Stage::ready(4);
    for stretch in [0.1, 0.2, 0.3] {
        let one = LoadedJob { job: job(rve, StateId::NONE, stretch), state: b"" };
        stage.port.send_jobs(WorkerId(0), &[one]).unwrap();
    }
    stage.say(&ToWorker::Drain);
    stage.listen(|stage| stage.controls.len() > 1);
    assert_eq!(stage.replies.len(), 3);
    assert_eq!(stage.controls[1], FromWorker::Bye { reason: "drained".into() });
    assert_eq!(stage.worker.join().unwrap().unwrap(), ExitReason::Drained);
}

#[test]
fn a_refused_worker_leaves_with_the_reason() {
    let mut stage = Stage::open(4);
    assert!(matches!(stage.controls[0], FromWorker::Hello { protocol: PROTOCOL_VERSION, .. }));
    let reason = "worker speaks version 1, this run version 2: install the same grainspan on both".to_owned();
    stage.say(&ToWorker::Refused { reason: reason.clone() });
    let error = stage.worker.join().unwrap().unwrap_err();
    assert_eq!(error.to_string(), format!("the run refused this worker: {reason}"));
}

/// An agent's welcome comes before the run's refusal.
#[test]
fn a_worker_that_is_refused_after_a_welcome_leaves_with_the_reason() {
    let (mut stage, _) = Stage::ready(4);
    stage.say(&ToWorker::Refused { reason: "another engine".into() });
    let error = stage.worker.join().unwrap().unwrap_err();
    assert!(matches!(&error, ServeError::Refused(reason) if reason == "another engine"), "{error}");
}

#[test]
fn a_silent_macro_is_given_up_and_a_lost_one_is_noticed() {
    let (port, connector) = channel();
    let options = ServeOptions { grace: Duration::from_millis(30), ..ServeOptions::new("test") };
    let error = serve(&mut ToyEngine, &mut connector.join(), &options).unwrap_err();
    assert!(matches!(error, ServeError::NoWelcome(_)), "{error}");
    drop(port);

    let (stage, _) = Stage::ready(4);
    drop(stage.port);
    assert!(matches!(stage.worker.join().unwrap().unwrap(), ExitReason::MacroLost(_)));
}
