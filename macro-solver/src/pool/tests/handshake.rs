//! Who may take part.

use super::scripted::{Stage, hello, hello_delivering, questions};
use crate::material::{MaterialError, PointMaterial};
use protocol::control::{FromWorker, ToWorker};
use protocol::{OptionalResult, TangentKind};

/// A pool whose only worker says `greeting` ends with an error; returns what both sides were told.
fn refusal_of(greeting: FromWorker, tangents: &[TangentKind]) -> (String, String) {
    let mut stage = Stage::new(1);
    stage.settings.tangents = tangents.to_vec();
    let worker = stage.world.borrow_mut().hire_saying(greeting, 8, &[], None);
    let mut pool = stage.open(2);
    let error = pool.evaluate(&questions(2, 0)).unwrap_err();
    assert!(matches!(error, MaterialError::WorkersLost(_)));
    assert_eq!(pool.statistics().workers_refused, 1);
    let sent = stage.world.borrow().sent.clone();
    let [(recipient, ToWorker::Refused { reason })] = &sent[..] else { panic!("{sent:?}") };
    assert_eq!(*recipient, worker);
    (reason.clone(), error.to_string())
}

#[test]
fn another_protocol_version_is_refused_with_both_numbers() {
    let FromWorker::Hello { run, pid, capabilities, state_cache, .. } = hello(8, 1) else { unreachable!() };
    let greeting = FromWorker::Hello { protocol: 999, run, pid, capabilities, state_cache };
    let (worker, user) = refusal_of(greeting, &[]);
    assert!(worker.contains("version 999") && worker.contains("same build"), "{worker}");
    assert!(user.contains(&worker), "{user}");
}

#[test]
fn another_run_a_missing_tangent_or_dimension_is_refused() {
    let FromWorker::Hello { protocol, run, pid, capabilities, state_cache } = hello(8, 1) else { unreachable!() };
    let elsewhere =
        FromWorker::Hello { protocol, run: "elsewhere".into(), pid, capabilities: capabilities.clone(), state_cache };
    assert!(refusal_of(elsewhere, &[]).0.contains("`elsewhere`"));
    let mut plain = capabilities.clone();
    plain.tangents = vec![TangentKind::None];
    let greeting = FromWorker::Hello { protocol, run: run.clone(), pid, capabilities: plain, state_cache };
    assert!(refusal_of(greeting, &[TangentKind::TrussLikeSlip]).0.contains("truss_like_slip"));
    let mut solid = capabilities;
    solid.dimensions = vec![3];
    let greeting = FromWorker::Hello { protocol, run, pid, capabilities: solid, state_cache };
    assert!(refusal_of(greeting, &[]).0.contains("2 dimensions"));
}

/// A worker that joins by hand may be of a build that delivers less: its zeros would be numbers of the run.
#[test]
fn a_worker_that_delivers_less_than_the_engine_of_the_run_is_refused() {
    let mut stage = Stage::new(1);
    let delivered = [OptionalResult::Fabric, OptionalResult::ElasticEnergy];
    let known = OptionalResult::ALL.into_iter().filter(|result| !delivered.contains(result)).collect::<Vec<_>>();
    stage.settings.lacking = vec![known; 2];
    for results in [&delivered[..1], &delivered[..]] {
        stage.world.borrow_mut().hire_saying(hello_delivering(results), 8, &[], None);
    }
    let mut pool = stage.open(2);
    pool.evaluate(&questions(2, 0)).unwrap();
    let statistics = pool.statistics();
    assert_eq!((statistics.workers_joined, statistics.workers_refused), (1, 1));
    let sent = stage.world.borrow().sent.clone();
    let refusal =
        |message: &ToWorker| matches!(message, ToWorker::Refused { reason } if reason.contains("`elastic_energy`"));
    assert!(sent.iter().any(|(_, message)| refusal(message)), "{sent:?}");
}

#[test]
fn an_engine_of_another_version_may_not_join_the_first() {
    let mut stage = Stage::new(1).hire(8, &[]);
    let FromWorker::Hello { protocol, run, pid, mut capabilities, state_cache } = hello(8, 1) else { unreachable!() };
    capabilities.version = "2".into();
    let newer = FromWorker::Hello { protocol, run, pid, capabilities, state_cache };
    stage.world.borrow_mut().hire_saying(newer, 8, &[], None);
    let mut pool = stage.open(2);
    pool.evaluate(&questions(2, 0)).unwrap();
    let statistics = pool.statistics();
    assert_eq!((statistics.workers_joined, statistics.workers_refused), (1, 1));
}

/// Otherwise the workers of an older program would agree with each other, and only with each other.
#[test]
fn a_first_worker_of_another_build_than_the_callers_is_refused() {
    let mut stage = Stage::new(1).hire(8, &[]);
    stage.settings.versions = vec![("other".into(), "1".into()), ("test".into(), "2".into())];
    let mut pool = stage.open(2);
    let error = pool.evaluate(&questions(2, 0)).unwrap_err().to_string();
    assert!(error.contains("`test 1` is not `test 2`"), "{error}");
    assert_eq!(pool.statistics().workers_refused, 1);
    let mut stage = Stage::new(1).hire(8, &[]);
    stage.settings.versions = vec![("test".into(), "1".into())];
    stage.open(2).evaluate(&questions(2, 0)).unwrap();
}

#[test]
fn a_second_hello_and_rubbish_are_counted_and_change_nothing() {
    let mut stage = Stage::new(1).hire(8, &[]);
    stage.world.borrow_mut().send_again(protocol::transport::WorkerId(0), hello(8, 1));
    stage.world.borrow_mut().send_rubbish();
    let mut pool = stage.open(2);
    pool.evaluate(&questions(2, 0)).unwrap();
    let statistics = pool.statistics();
    assert_eq!((statistics.workers_joined, statistics.refused_messages), (1, 2));
}

#[test]
fn without_workers_the_wait_ends_with_a_reason() {
    let mut stage = Stage::new(1);
    let error = stage.open(1).evaluate(&questions(1, 0)).unwrap_err();
    assert!(error.to_string().contains("no worker has joined run `test`"), "{error}");
}

#[test]
fn closing_sends_everybody_away() {
    let mut stage = Stage::new(1).hire(8, &[]).hire(8, &[]);
    let mut pool = stage.open(2);
    pool.gather(2).unwrap();
    pool.close();
    let byes = stage.world.borrow().sent.iter().filter(|(_, message)| *message == ToWorker::Bye).count();
    assert_eq!(byes, 2);
    assert!(stage.world.borrow().killed.is_empty());
    assert_eq!(pool.statistics().workers_lost, 0);
    assert!(matches!(pool.evaluate(&questions(2, 0)), Err(MaterialError::WorkersLost(_))));
}

#[test]
fn a_worker_that_never_comes_does_not_hold_up_the_others() {
    let mut stage = Stage::new(1).hire(8, &[]);
    let mut pool = stage.open(2);
    pool.gather(2).unwrap();
    assert_eq!(pool.workers(), 1);
    assert_eq!(pool.evaluate(&questions(2, 0)).unwrap().len(), 2);
}
