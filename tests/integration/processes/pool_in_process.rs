//! The pool with the real worker loop and real grains, in one process: a worker is a thread.
//!
//! Claims: answers and committed states are bitwise those of one RVE that is driven directly (checks ),
//! whatever the number of workers, their caches, the length of slices, and whoever deserts on the way.

use claims::Claim;
use macro_solver::material::{MaterialError, PointMaterial, PointTrial};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, PoolStatistics};
use protocol::control::FromWorker;
use protocol::transport::in_process::{InProcessConnector, InProcessMacroPort, channel};
use protocol::transport::{LoadedReply, TransportError, WorkerEvent, WorkerPort};
use protocol::{Definition, Observables, RveEngine, StateId, TangentKind, Tensor2, TrialOptions, TrialResult};
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainEngine;
use rve_server::server::{ServeOptions, serve};
use std::num::NonZeroUsize;
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

const POINTS: usize = 6;
const STEPS: u32 = 3;

fn definition() -> Definition {
    let packing: PackingFile = PackingFile::read(Path::new("packings/discs-100.json")).unwrap();
    let contact = toml::from_str("law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5").unwrap();
    let options: RveOptions = toml::from_str("accuracy = \"draft\"").unwrap();
    GrainDefinition { packing, contact, options }.validate().unwrap().to_protocol()
}

/// Biaxial compression with a strain and a shear of its own at every point.
fn question(point: usize, step: u32) -> PointTrial {
    let strain = 2e-4 * (1.0 + 0.21 * point as f64) * f64::from(step + 1);
    let target = Tensor2::from_plane([[0.3 * strain, 1e-5 * point as f64], [0.0, -strain]]);
    let options = TrialOptions {
        tangent: TangentKind::TrussLikeSlip,
        ramp_steps: 0,
        observables: Observables::FABRIC,
        ..TrialOptions::default()
    };
    PointTrial { point, target, options }
}

/// What an answer is made of, without what it cost in time.
fn bits(answer: &TrialResult) -> Vec<u64> {
    let tangent = answer.tangent.as_deref().map_or(&[][..], |tangent| &tangent.0);
    let scalars = [answer.scalars.void_ratio, answer.scalars.unbalanced_force_ratio];
    let values = answer.stress.0.iter().chain(tangent).chain(&answer.observed.fabric.0).chain(&scalars);
    values.map(|value| value.to_bits()).chain([answer.cost.force_evaluations]).collect()
}

type Journey = (Vec<Vec<u64>>, Vec<StateId>);

/// One RVE per point, driven without any pool.
fn directly() -> Journey {
    let mut answers = vec![Vec::new(); STEPS as usize * POINTS];
    let mut states = Vec::new();
    for point in 0..POINTS {
        let mut rve = GrainEngine.create(&definition()).unwrap();
        for step in 0..STEPS {
            let trial = question(point, step);
            answers[step as usize * POINTS + point] = bits(&rve.trial(&trial.target, &trial.options).unwrap());
            rve.commit().unwrap();
        }
        let mut bytes = Vec::new();
        rve.snapshot(&mut bytes);
        states.push(StateId::of(&bytes));
    }
    (answers, states)
}

/// A worker's port that breaks down before it has sent this many slices.
struct Deserter<P> {
    port: P,
    slices: usize,
}

impl<P: WorkerPort> WorkerPort for Deserter<P> {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(WorkerEvent<'_>)) -> Result<usize, TransportError> {
        self.port.poll(wait, sink)
    }

    fn send_control(&mut self, message: &FromWorker) -> Result<(), TransportError> {
        self.port.send_control(message)
    }

    fn send_replies(&mut self, replies: &[LoadedReply<'_>]) -> Result<(), TransportError> {
        if self.slices == 0 {
            return Err(TransportError::Channel { action: "send replies", reason: "desertion".into() });
        }
        self.slices -= 1;
        self.port.send_replies(replies)
    }
}

/// One worker thread.
#[derive(Clone, Copy)]
struct Hand {
    state_cache: u32,
    /// Slices until it deserts.
    slices: usize,
}

const STEADY: Hand = Hand { state_cache: 64, slices: usize::MAX };

fn start(connector: &InProcessConnector, hand: Hand) -> JoinHandle<()> {
    let connector = connector.clone();
    std::thread::spawn(move || {
        let mut port = Deserter { port: connector.join(), slices: hand.slices };
        let options = ServeOptions { state_cache: hand.state_cache, ..ServeOptions::new("test") };
        // A deserter's loop ends with an error; the pool must cope with both ends.
        let _ = serve(&mut GrainEngine, &mut port, &options);
    })
}

fn with_pool<T>(hands: &[Hand], slice: usize, use_it: impl FnOnce(&mut Pool<InProcessMacroPort>) -> T) -> T {
    let (port, connector) = channel();
    let workers: Vec<_> = hands.iter().map(|hand| start(&connector, *hand)).collect();
    let mut settings = PoolSettings::new("test");
    settings.tangents = vec![TangentKind::TrussLikeSlip];
    settings.jobs_per_message = NonZeroUsize::new(slice).unwrap();
    let definitions = vec![definition()];
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, definitions, &[0; POINTS]);
    pool.gather(hands.len()).unwrap();
    let result = use_it(&mut pool);
    pool.close();
    drop(pool);
    workers.into_iter().for_each(|worker| worker.join().unwrap());
    result
}

/// The path of [`directly`], with a trial thrown away at every step as Newton iterations do.
fn pooled(hands: &[Hand], slice: usize) -> (Journey, PoolStatistics) {
    with_pool(hands, slice, |pool| {
        let mut answers = Vec::new();
        for step in 0..STEPS {
            let guess: Vec<_> = (0..POINTS).map(|point| question(point, step + 1)).collect();
            pool.evaluate(&guess).unwrap();
            let trials: Vec<_> = (0..POINTS).map(|point| question(point, step)).collect();
            answers.extend(pool.evaluate(&trials).unwrap().iter().map(bits));
            pool.commit().unwrap();
        }
        let states = (0..POINTS).map(|point| pool.committed_snapshot(point).1.id).collect();
        ((answers, states), pool.statistics())
    })
}

#[test]
fn pooled_grains_answer_bit_for_bit_like_a_single_cell() {
    let reference = directly();
    for workers in 1..=3 {
        let (journey, statistics) = pooled(&vec![STEADY; workers], 1);
        Claim::of("A-1", "answers and states of cells with one to three workers, against cells without a pool")
            .holds(journey == reference);
        assert_eq!(statistics.solved, 2 * u64::from(STEPS) * POINTS as u64);
        assert!(statistics.rve_s > 0.0 && statistics.tangent_s > 0.0);
    }
    let forgetful = [Hand { state_cache: 1, ..STEADY }, Hand { state_cache: 3, ..STEADY }];
    Claim::of("A-1", "answers and states with small caches and four trials a message, against no pool")
        .holds(pooled(&forgetful, 4).0 == reference);
}

/// Check A-2.
#[test]
fn deserting_workers_change_nothing() {
    let hands = [Hand { slices: 3, ..STEADY }, STEADY, Hand { slices: 0, ..STEADY }, Hand { slices: 7, ..STEADY }];
    let (journey, statistics) = pooled(&hands, 1);
    Claim::of("A-2", "answers and states of cells with four workers of which three desert")
        .holds(journey == directly());
    assert_eq!(statistics.workers_joined, 4);
    assert!(statistics.workers_lost >= 1 && statistics.reissued >= 1, "{statistics:?}");
}

/// Check A-9.
#[test]
fn equal_cells_under_equal_strain_are_solved_once() {
    let answers = |deduplicated: bool| {
        with_pool(&[STEADY, STEADY], 1, |pool| {
            // An option that changes no result makes the trials different.
            let observables = |point: usize| Observables(if deduplicated { 0 } else { point as u32 % 64 });
            let trials: Vec<_> = (0..POINTS)
                .map(|point| {
                    let trial = question(0, 0);
                    PointTrial {
                        point,
                        options: TrialOptions { observables: observables(point), ..trial.options },
                        ..trial
                    }
                })
                .collect();
            let stresses: Vec<_> =
                pool.evaluate(&trials).unwrap().iter().map(|answer| answer.stress.0.map(f64::to_bits)).collect();
            pool.commit().unwrap();
            let states: Vec<_> = (0..POINTS).map(|point| pool.committed_snapshot(point).1.id).collect();
            (stresses, states, pool.statistics().duplicates_skipped)
        })
    };
    let (once, all) = (answers(true), answers(false));
    Claim::of("A-9", "stresses and states of equal trials, answered once and one by one")
        .holds((&once.0, &once.1) == (&all.0, &all.1));
    Claim::of("A-9", "duplicates that are not solved, of six equal trials")
        .value(once.2 as f64, POINTS as f64 - 1.0)
        .within_absolute(0.0);
    assert_eq!(all.2, 0);
}

/// Check A-6 through the whole chain.
#[test]
fn a_bad_target_names_the_point_and_leaves_the_state() {
    with_pool(&[STEADY, STEADY], 2, |pool| {
        let good: Vec<_> = (0..POINTS).map(|point| question(point, 0)).collect();
        let expected: Vec<_> = pool.evaluate(&good).unwrap().iter().map(bits).collect();
        for value in [f64::NAN, -1.5, 0.9] {
            let mut bad = good.clone();
            bad[4].target.0[0] = value;
            bad[2].target.0[0] = value;
            let error = pool.evaluate(&bad).unwrap_err();
            Claim::of("A-6", "bad targets are refused with the first point that has one")
                .holds(matches!(error, MaterialError::Point { point: 2, .. }));
            assert!(error.is_curable_by_smaller_step());
            pool.rollback();
        }
        let again: Vec<_> = pool.evaluate(&good).unwrap().iter().map(bits).collect();
        Claim::of("A-6", "answers after three refused targets against those before").holds(again == expected);
    });
}

#[test]
fn a_definition_that_no_worker_accepts_ends_with_its_reason() {
    let (port, connector) = channel();
    let worker = start(&connector, STEADY);
    let definitions = vec![Definition { bytes: b"no grains".to_vec() }];
    let settings = PoolSettings::new("test");
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, definitions, &[0]);
    let error = pool.evaluate(&[question(0, 0)]).unwrap_err();
    assert!(!error.is_curable_by_smaller_step());
    let text = error.to_string();
    assert!(text.contains("Gauss point 0") && text.contains("not a definition of grains"), "{text}");
    drop(pool);
    worker.join().unwrap();
}
