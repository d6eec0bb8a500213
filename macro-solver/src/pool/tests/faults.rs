//! Each fault is noticed, counted and survived, or ends the run with the point's name.

use super::scripted::{Fault, Stage, questions};
use crate::material::{MaterialError, PointMaterial};
use crate::pool::PoolStatistics;
use claims::Claim;
use protocol::RveError;
use std::time::{Duration, Instant};

const POINTS: usize = 10;

/// One evaluation by two workers of which the first misbehaves at its second slice; replacements are sound.
fn evaluate_with(fault: Fault) -> PoolStatistics {
    let mut stage = Stage::new(11).hire(8, &[None, Some(fault)]).hire(8, &[]).replacing(5, None);
    let mut pool = stage.open(POINTS);
    pool.gather(2).unwrap();
    let answers = pool.evaluate(&questions(POINTS, 0)).unwrap();
    let expected = Stage::new(0).hire(8, &[]).open(POINTS).evaluate(&questions(POINTS, 0)).unwrap();
    assert_eq!(answers, expected);
    pool.commit().unwrap();
    // Whatever arrives after the evaluation it belonged to must be harmless, too.
    pool.evaluate(&questions(POINTS, 1)).unwrap();
    pool.statistics()
}

#[test]
fn jobs_of_a_dead_worker_are_done_by_others() {
    let statistics = evaluate_with(Fault::Die);
    assert_eq!((statistics.workers_lost, statistics.worker_restarts, statistics.workers_joined), (1, 1, 3));
    assert!((1..=2).contains(&statistics.reissued), "{statistics:?}");
    assert_eq!(statistics.solved, 2 * POINTS as u64);
}

#[test]
fn a_silent_worker_is_ended_and_its_jobs_are_done_by_others() {
    let statistics = evaluate_with(Fault::Hang);
    assert_eq!((statistics.workers_hung, statistics.workers_lost), (1, 1));
    assert!(statistics.reissued >= 1);
}

/// Check A-5.
#[test]
fn duplicate_late_and_unknown_replies_are_ignored_and_counted() {
    let twice = evaluate_with(Fault::Twice);
    let quantity = "replies counted as late, where one slice is answered twice";
    Claim::of("A-5", quantity).value(twice.late_replies as f64, 1.0).within_absolute(0.0);
    assert_eq!((twice.unknown_replies, twice.workers_faulty), (0, 0));
    let invented = evaluate_with(Fault::Invent);
    let quantity = "replies counted as unknown, where one is about a job that was not issued";
    Claim::of("A-5", quantity).value(invented.unknown_replies as f64, 1.0).within_absolute(0.0);
    assert_eq!((invented.late_replies, invented.workers_faulty), (0, 0));
    let left = evaluate_with(Fault::LeaveThenAnswer);
    assert_eq!((left.workers_left, left.workers_lost), (1, 0));
    let quantity = "replies counted as late, of a worker that has left";
    Claim::of("A-5", quantity).number(left.late_replies as f64).at_least(1.0);
    for statistics in [twice, invented, left] {
        let quantity = "answers taken, with replies that are late, unknown or come twice";
        Claim::of("A-5", quantity).value(statistics.solved as f64, 2.0 * POINTS as f64).within_absolute(0.0);
    }
}

#[test]
fn unsound_replies_end_their_worker() {
    let faults = [
        Fault::NotANumber,
        Fault::DamagedState,
        Fault::MissingState,
        Fault::NegativeVolume,
        Fault::ManyEvaluations,
        Fault::OtherPoint,
        Fault::NoTangent,
        Fault::BadStatus,
    ];
    for fault in faults {
        let statistics = evaluate_with(fault);
        assert_eq!((statistics.workers_faulty, statistics.workers_lost), (1, 1), "{fault:?}");
        assert_eq!(statistics.solved, 2 * POINTS as u64, "{fault:?}");
    }
}

/// An engine whose snapshots are empty began every step as packed, and the run ended well with a third of the stress.
#[test]
fn a_state_that_a_strain_leaves_as_it_was_ends_its_worker() {
    let mut stage = Stage::new(3).hire(8, &[None, Some(Fault::SameState)]).replacing(1, None);
    let mut pool = stage.open(1);
    pool.evaluate(&questions(1, 0)).unwrap();
    pool.commit().unwrap();
    pool.evaluate(&questions(1, 1)).unwrap();
    let statistics = pool.statistics();
    assert_eq!(
        (statistics.workers_faulty, statistics.worker_restarts, statistics.solved),
        (1, 1, 2),
        "{statistics:?}"
    );
}

/// Recycling by count: the worker finishes what it holds, and nothing is asked twice. By memory: `tests/integration/processes/faults.rs`.
#[test]
fn a_worker_that_has_done_enough_finishes_and_is_replaced() {
    let mut stage = Stage::new(6).hire(64, &[]).replacing(30, None);
    stage.settings.recycling.jobs = Some(4);
    let mut pool = stage.open(POINTS);
    pool.evaluate(&questions(POINTS, 0)).unwrap();
    pool.commit().unwrap();
    pool.evaluate(&questions(POINTS, 1)).unwrap();
    let by_count = pool.statistics();
    assert!(by_count.workers_recycled >= 3, "{by_count:?}");
    assert_eq!((by_count.workers_lost, by_count.reissued, by_count.solved), (0, 0, 2 * POINTS as u64));
}

/// Nothing else would ever end it, and nobody would take its place.
#[test]
fn a_worker_that_is_to_leave_and_stays_is_ended_and_replaced() {
    let limits = [Duration::from_millis(100), Duration::from_secs(10)];
    let mut stage = Stage::new(6).hire(64, &[None, Some(Fault::LeaveAndStay)]).replacing(1, None);
    [stage.settings.hang.floor, stage.settings.worker_timeout] = limits;
    let mut pool = stage.open(POINTS);
    pool.evaluate(&questions(POINTS, 0)).unwrap();
    let statistics = pool.statistics();
    assert_eq!((statistics.workers_left, statistics.workers_hung, statistics.worker_restarts), (1, 1, 1));

    let mut stage = Stage::new(6).hire(64, &[]).replacing(30, None);
    [stage.settings.hang.floor, stage.settings.worker_timeout] = limits;
    stage.settings.recycling.jobs = Some(4);
    stage.world.borrow_mut().drains_are_ignored = true;
    let mut pool = stage.open(POINTS);
    pool.evaluate(&questions(POINTS, 0)).unwrap();
    let statistics = pool.statistics();
    assert!(statistics.workers_hung >= 1 && statistics.workers_left == 0, "{statistics:?}");
    assert_eq!((statistics.reissued, statistics.solved), (0, POINTS as u64));
}

#[test]
fn a_worker_that_forgot_is_told_again() {
    let mut stage = Stage::new(11).hire(50, &[None, None, None, None, Some(Fault::Amnesia)]);
    let mut pool = stage.open(4);
    pool.evaluate(&questions(4, 0)).unwrap();
    pool.commit().unwrap();
    pool.evaluate(&questions(4, 1)).unwrap();
    let statistics = pool.statistics();
    assert!(statistics.definition_misses >= 1 && statistics.state_misses >= 1, "{statistics:?}");
    assert_eq!((statistics.workers_faulty, statistics.solved), (0, 8));
}

#[test]
fn a_worker_that_never_has_the_state_is_ended() {
    let script = [None, None, Some(Fault::AlwaysNeedsState), Some(Fault::AlwaysNeedsState)];
    let mut stage = Stage::new(11).hire(0, &script).replacing(1, None);
    let mut pool = stage.open(2);
    pool.evaluate(&questions(2, 0)).unwrap();
    pool.commit().unwrap();
    pool.evaluate(&questions(2, 1)).unwrap();
    assert_eq!(pool.statistics().workers_faulty, 1);
}

#[test]
fn a_deadly_point_is_named_after_three_workers() {
    let mut stage = Stage::new(5).replacing(20, Some(6));
    stage.world.borrow_mut().hire(8, &[], Some(6));
    stage.world.borrow_mut().hire(8, &[], Some(6));
    let rest = stage.settings.retry_delay;
    let mut pool = stage.open(POINTS);
    let begun = Instant::now();
    let error = pool.evaluate(&questions(POINTS, 0)).unwrap_err();
    assert!(
        begun.elapsed() >= rest,
        "the last victim got it after a rest: whoever ends workers from outside is done by then"
    );
    assert!(matches!(error, MaterialError::WorkersLost(_)) && !error.is_curable_by_smaller_step());
    assert!(error.to_string().contains("Gauss point 6 has ended 3 workers"), "{error}");
    let case = pool.quarantined().unwrap();
    let question = questions(POINTS, 0)[6];
    assert_eq!((case.point, case.target, case.options()), (6, question.target, question.options));
    assert!(case.state.is_empty() && case.failures.len() == 3 && case.definition.bytes == [1], "{case:?}");
    assert_eq!(pool.statistics().workers_lost, 3);
}

/// Once a lower point has failed, a trial that ends its workers no longer matters: it is given up with its worker. Every order of events ended
/// with the lost workers, where the failure of point 2 would have been cured by a smaller step.
#[test]
fn a_deadly_trial_above_a_failed_point_is_given_up() {
    let mut given_up = 0;
    for seed in 0..16 {
        let stage = Stage::new(seed).hire(8, &[]);
        stage.world.borrow_mut().hire(8, &[], Some(6));
        let mut stage = stage.replacing(9, Some(6));
        let mut pool = stage.open(POINTS);
        pool.gather(2).unwrap();
        let mut trials = questions(POINTS, 0);
        trials[2].target.0[0] = 4.0;
        match pool.evaluate(&trials).unwrap_err() {
            MaterialError::Point { point: 2, .. } => {}
            // Three workers may die before point 2 is answered.
            MaterialError::WorkersLost(_) if pool.statistics().workers_lost >= 3 => continue,
            other => panic!("{other} with seed {seed}"),
        }
        given_up += u32::from(pool.statistics().workers_lost > 0);
    }
    assert!(given_up >= 4, "{given_up} of 16");
}

/// A trial that three workers in a row did not survive is stopped; one whose hosts were cut off three times in a row is innocent.
#[test]
fn the_loss_of_hosts_is_not_held_against_their_jobs() {
    let mut stage = Stage::new(5);
    for _ in 0..5 {
        stage = stage.hire(8, &[Some(Fault::Die)]);
    }
    let mut stage = stage.hire(8, &[]);
    stage.world.borrow_mut().hosts_are_lost = true;
    let mut pool = stage.open(1);
    pool.evaluate(&questions(1, 0)).unwrap();
    let statistics = pool.statistics();
    assert_eq!((statistics.workers_cut_off, statistics.workers_lost, statistics.reissued), (5, 5, 5));
    assert!(pool.quarantined().is_none());
}

#[test]
fn when_replacements_run_out_the_reason_is_given() {
    let script = [Some(Fault::Die)];
    let mut stage = Stage::new(5).hire(8, &script).replacing(0, None);
    let error = stage.open(2).evaluate(&questions(2, 0)).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("no replacements are left") && text.contains("process ended"), "{text}");
}

#[test]
fn with_several_failing_points_the_lowest_is_reported() {
    for seed in 0..8 {
        let mut stage = Stage::new(seed).hire(8, &[]).hire(8, &[]).hire(8, &[]);
        let mut pool = stage.open(POINTS);
        let mut trials = questions(POINTS, 0);
        for point in [3, 4, 7] {
            trials[point].target.0[0] = 2.0 + point as f64;
        }
        pool.evaluate(&questions(POINTS, 0)).unwrap();
        let Err(MaterialError::Point { point: 3, reason }) = pool.evaluate(&trials) else { panic!("point 3 fails") };
        assert_eq!(reason, RveError::TargetTooLarge { norm: 5.0, limit: 1.0 });
        pool.commit().unwrap();
        let initial = (0..POINTS).all(|point| pool.committed_snapshot(point).1.bytes.is_empty());
        assert!(initial, "a failed evaluation leaves no trial to commit");
        pool.evaluate(&questions(POINTS, 1)).unwrap();
    }
}

#[test]
fn of_several_trials_of_a_point_the_refused_one_is_named() {
    let mut stage = Stage::new(5).hire(8, &[]);
    let mut pool = stage.open(2);
    let [first, other] = [questions(2, 0)[1], questions(2, 1)[1]];
    let mut refused = first;
    refused.target.0[0] = 2.0;
    let error = pool.evaluate(&[first, refused, other, refused]).unwrap_err();
    assert!(matches!(error, MaterialError::Point { point: 1, .. }), "{error}");
    assert_eq!(pool.refused_trial(), Some(1));
    pool.evaluate(&[first, other]).unwrap();
    assert_eq!(pool.refused_trial(), None);
}

#[test]
fn an_interrupt_ends_the_wait() {
    let mut stage = Stage::new(5).hire(8, &[Some(Fault::Hang)]);
    stage.settings.hang.unknown = Duration::from_secs(60);
    let mut pool = stage.open(2);
    let waker = pool.waker();
    let interrupt = stage.interrupt.clone();
    let signal = std::thread::spawn(move || {
        interrupt.raise();
        waker.wake();
    });
    assert!(matches!(pool.evaluate(&questions(2, 0)), Err(MaterialError::Interrupted)));
    signal.join().unwrap();
}
