//! What comes out does not depend on who computed it, when, or how often.

use super::scripted::{Fault, Stage, hello_delivering, questions};
use crate::checkpoint::Archive;
use crate::material::{PointMaterial, PointTrial};
use crate::pool::{Pool, PoolStatistics};
use claims::Claim;
use protocol::transport::MacroPort;
use protocol::{OptionalResult, StateId, Tensor2, TrialResult};
use std::num::NonZeroUsize;
use std::time::Duration;

const POINTS: usize = 12;

/// Four steps of two iterations each, as a Newton solver would ask; every third step is thrown away.
fn journey<P: MacroPort>(pool: &mut Pool<P>) -> (Vec<TrialResult>, Vec<StateId>) {
    let mut answers = Vec::new();
    for step in 0..4 {
        for iteration in 0..2 {
            answers.extend(pool.evaluate(&questions(POINTS, 10 * step + iteration)).unwrap());
        }
        if step % 3 == 2 { pool.rollback() } else { pool.commit().unwrap() }
    }
    let states = (0..POINTS).map(|point| pool.committed_snapshot(point).1.id).collect();
    (answers, states)
}

/// Check A-1.
#[test]
fn answers_and_states_do_not_depend_on_workers_arrival_slices_or_caches() {
    let reference = journey(&mut Stage::new(0).hire(64, &[]).open(POINTS));
    assert_eq!(reference.0.len(), 8 * POINTS);
    for workers in 1..=8 {
        for seed in 0..6 {
            let mut stage = Stage::new(seed);
            for worker in 0..workers {
                stage = stage.hire((worker * 7 + seed as usize) % 40, &[]);
            }
            stage.settings.jobs_per_message = NonZeroUsize::new(1 + seed as usize % 4).unwrap();
            let mut pool = stage.open(POINTS);
            pool.gather(workers).unwrap();
            let quantity = "answers and states with one to eight workers, in any order of arrival";
            Claim::of("A-1", quantity).holds(journey(&mut pool) == reference);
            assert_eq!(pool.statistics().evaluations, 8 * POINTS as u64);
        }
    }
}

/// The zeros of a message that stand for what an engine does not deliver are no numbers of its points; those of other points stay.
#[test]
fn what_an_engine_does_not_deliver_is_not_a_number_at_its_points() {
    let lacking = [OptionalResult::FabricAnisotropy, OptionalResult::DampingWork];
    let mut stage = Stage::new(3);
    stage.settings.lacking = vec![Vec::new(), lacking.to_vec()];
    stage.world.borrow_mut().hire_saying(hello_delivering(&OptionalResult::ALL), 64, &[], None);
    let mut pool = stage.open(2);
    let answers = pool.evaluate(&questions(2, 0)).unwrap();
    let [first, second] = [0, 1].map(|point: usize| answers[point].observed);
    assert_eq!((first.fabric_anisotropy, first.damping_work, second.elastic_energy), (0.0, 0.0, 0.0));
    assert!(second.fabric_anisotropy.is_nan() && second.damping_work.is_nan());
    assert!(answers.iter().all(|answer| answer.stress.is_finite()));
}

/// Steps that are taken back leave no trace, and workers that hold their states do not bring them in again.
#[test]
fn points_return_to_the_states_that_were_marked() {
    let walk = |in_vain: u32| {
        let mut pool = Stage::new(4).hire(64, &[]).hire(64, &[]).open(POINTS);
        pool.evaluate(&questions(POINTS, 0)).unwrap();
        pool.commit().unwrap();
        pool.mark();
        for step in 0..in_vain {
            pool.evaluate(&questions(POINTS / 2, 100 + step)).unwrap();
            pool.commit().unwrap();
        }
        pool.evaluate(&questions(POINTS, 7)).unwrap();
        pool.return_to_mark();
        assert!((0..POINTS).all(|point| !pool.has_trial(point)));
        journey(&mut pool)
    };
    assert_eq!(walk(3), walk(0));
}

/// Check A-1 under fire: any mixture of faults, as long as somebody is left to do the work.
#[test]
fn answers_and_states_do_not_depend_on_faults() {
    let reference = journey(&mut Stage::new(0).hire(64, &[]).open(POINTS));
    let faults = [
        Fault::Die,
        Fault::Twice,
        Fault::Invent,
        Fault::LeaveThenAnswer,
        Fault::NotANumber,
        Fault::DamagedState,
        Fault::MissingState,
        Fault::OtherPoint,
        Fault::NoTangent,
        Fault::BadStatus,
        Fault::Amnesia,
        Fault::AlwaysNeedsState,
    ];
    for (seed, fault) in faults.into_iter().enumerate() {
        let script = [None, Some(fault), None, None, Some(fault), None, Some(fault)];
        let mut stage = Stage::new(seed as u64).hire(9, &script).hire(9, &script[2..]).replacing(10, None);
        let mut pool = stage.open(POINTS);
        let is_same = journey(&mut pool) == reference;
        Claim::of("A-1", "answers and states while workers fail in twelve ways").holds(is_same);
    }
}

/// A message holds no more bytes of states than the channel carries, whatever the slice says.
#[test]
fn slices_of_large_states_are_cut_to_what_a_message_carries() {
    let walk = |message_bytes: usize| {
        let mut stage = Stage::new(1).hire(64, &[]);
        stage.settings.jobs_per_message = NonZeroUsize::new(64).unwrap();
        stage.settings.message_bytes = message_bytes;
        let result = journey(&mut stage.open(POINTS));
        let longest = stage.world.borrow().longest_slice;
        (result, longest)
    };
    let one_job = size_of::<protocol::wire::TrialReply>() + 128;
    let (reference, whole) = walk(usize::MAX);
    assert_eq!(whole, POINTS / 2, "all points of one definition");
    let (cut, longest) = walk(3 * one_job - 1);
    assert!(cut == reference && longest == 2, "{longest} jobs in a message");
    let (single, longest) = walk(0);
    assert!(single == reference && longest == 1, "one job is sent whatever its size, and {longest} were");
}

/// Trials that differ in nothing but their friction are two questions.
#[test]
fn trials_of_two_frictions_are_not_taken_for_one() {
    let target = Tensor2::from_plane([[-1e-4, 0.0], [0.0, 0.0]]);
    let solved = |reductions: [f64; 2]| {
        let mut stage = Stage::new(3).hire(64, &[]);
        stage.settings.deduplicate = true;
        let mut pool = stage.open(POINTS);
        let with = |mut trial: PointTrial| {
            trial.options.friction_reduction = reductions[trial.point / (POINTS / 2)];
            PointTrial { target, ..trial }
        };
        let trials: Vec<PointTrial> = questions(POINTS, 0).into_iter().map(with).collect();
        pool.evaluate(&trials).unwrap();
        pool.statistics().solved
    };
    let one = solved([0.5, 0.5]);
    assert!(solved([0.0, 0.5]) > one && one < POINTS as u64);
}

/// Check A-9: points with equal history and equal targets are solved once, and nobody can tell.
#[test]
fn equal_trials_are_solved_once_with_equal_results() {
    let equal = |step: f64| -> Vec<PointTrial> {
        let target = Tensor2::from_plane([[-1e-4 * step, 0.0], [0.0, 0.0]]);
        questions(POINTS, 0).into_iter().map(|trial| PointTrial { target, ..trial }).collect()
    };
    let walk = |deduplicate: bool| {
        let mut stage = Stage::new(3).hire(64, &[]).hire(64, &[]);
        stage.settings.deduplicate = deduplicate;
        let mut pool = stage.open(POINTS);
        let mut answers = Vec::new();
        for step in 1..4 {
            answers.extend(pool.evaluate(&equal(f64::from(step))).unwrap());
            pool.commit().unwrap();
        }
        let states: Vec<_> = (0..POINTS).map(|point| pool.committed_snapshot(point).1.id).collect();
        ((answers, states), pool.statistics())
    };
    let (with, counted) = walk(true);
    let (without, plain) = walk(false);
    Claim::of("A-9", "answers and states with equal trials solved once").holds(with == without);
    let skipped = 3 * (POINTS as u64 - 2);
    let quantity = "trials answered by others, three steps of 12 equal trials of two kinds of cells";
    Claim::of("A-9", quantity).value(counted.duplicates_skipped as f64, skipped as f64).within_absolute(0.0);
    let quantity = "trials solved, three steps of 12 equal trials of two kinds of cells";
    Claim::of("A-9", quantity).value(counted.solved as f64, 6.0).within_absolute(0.0);
    assert_eq!((plain.solved, plain.duplicates_skipped), (3 * POINTS as u64, 0));
    assert_eq!(counted.evaluations, plain.evaluations);
}

/// One bit of the target makes another question: rounding would force a symmetric bifurcation.
#[test]
fn questions_that_differ_in_one_bit_are_both_solved() {
    let mut stage = Stage::new(1).hire(8, &[]);
    let mut pool = stage.open(4);
    let mut trials = questions(4, 0);
    trials[2].target = trials[0].target;
    trials[2].target.0[0] = f64::from_bits(trials[0].target.0[0].to_bits() + 1);
    let answers = pool.evaluate(&trials).unwrap();
    assert_ne!(answers[0].stress, answers[2].stress);
    assert_eq!(pool.statistics().duplicates_skipped, 0);
}

#[test]
fn latest_trial_wins_and_points_without_trial_stay() {
    let mut pool = Stage::new(1).hire(8, &[]).open(3);
    let first = questions(3, 0);
    pool.evaluate(&first).unwrap();
    let second = questions(3, 5);
    pool.evaluate(&second[..2]).unwrap();
    pool.commit().unwrap();
    let mut other = Stage::new(2).hire(8, &[]).open(3);
    other.evaluate(&[second[0], second[1], first[2]]).unwrap();
    other.commit().unwrap();
    let untouched = other.committed_snapshot(2).1.id;
    for point in 0..3 {
        assert_eq!(pool.committed_snapshot(point).1.id, other.committed_snapshot(point).1.id);
    }
    other.evaluate(&second[..1]).unwrap();
    other.commit().unwrap();
    assert_eq!(other.committed_snapshot(2).1.id, untouched);
    let before = other.committed_snapshot(0).1.id;
    other.evaluate(&first).unwrap();
    other.rollback();
    other.commit().unwrap();
    assert_eq!(other.committed_snapshot(0).1.id, before);
}

/// A worker with room for all states is sent each definition once and, alone, never a snapshot.
#[test]
fn states_stay_where_they_were_made() {
    let mut stage = Stage::new(4).hire(1000, &[]);
    let mut pool = stage.open(POINTS);
    journey(&mut pool);
    let statistics = pool.statistics();
    assert_eq!((statistics.states_sent, statistics.state_misses, statistics.definition_misses), (0, 0, 0));
    let defined =
        stage.world.borrow().sent.iter().filter(|(_, message)| format!("{message:?}").contains("Define")).count();
    assert_eq!(defined, 2);
    assert!(stage.world.borrow().received.iter().all(|(_, carried)| *carried == 0));
}

/// The last messages of a batch are short, so that workers finish together; but not shorter than what a worker solves side by side.
#[test]
fn jobs_that_a_worker_solves_side_by_side_are_sent_together() {
    let slices = |side_by_side: u32, workers: usize, jobs: usize| {
        let mut stage = Stage::new(7);
        stage.world.borrow_mut().side_by_side = side_by_side;
        stage = (0..workers).fold(stage, |stage, _| stage.hire(1000, &[]));
        stage.settings.jobs_per_message = NonZeroUsize::new(64).unwrap();
        let mut pool = stage.open(2 * jobs);
        let trials = (0..jobs).map(|job| {
            // Equally long, so that messages are cut by their number of jobs alone.
            let (sine, cosine) = (job as f64).sin_cos();
            let target = Tensor2::from_plane([[1e-4 * cosine, 1e-4 * sine], [1e-4 * sine, -1e-4 * cosine]]);
            PointTrial { point: 2 * job, target, options: protocol::TrialOptions::default() }
        });
        pool.evaluate(&trials.collect::<Vec<_>>()).unwrap();
        let slices = stage.world.borrow().slices.clone();
        assert_eq!(slices.iter().sum::<usize>(), jobs);
        slices
    };
    let short = |slices: &[usize]| slices.iter().filter(|jobs| **jobs < 8).count();
    assert!(short(&slices(1, 2, 64)) > 2, "{:?}", slices(1, 2, 64));
    assert!(short(&slices(8, 2, 64)) <= 2, "{:?}", slices(8, 2, 64));
    assert_eq!(slices(8, 4, 12), [3; 4], "nobody waits while others have several");
}

#[test]
fn slices_hold_several_jobs_and_the_longest_goes_first() {
    let mut stage = Stage::new(4);
    // Of cells that no one has solved yet a message holds as many as are solved side by side.
    stage.world.borrow_mut().side_by_side = 3;
    stage = stage.hire(1000, &[]);
    stage.settings.jobs_per_message = NonZeroUsize::new(3).unwrap();
    let mut pool = stage.open(6);
    pool.evaluate(&questions(6, 0)).unwrap();
    let order: Vec<_> = stage.world.borrow().received.iter().map(|(job, _)| job.point).collect();
    assert_eq!(order, [5, 3, 1, 4, 2, 0]);
}

/// A worker that hung with the first message of a run was found after ten minutes for each of its jobs.
#[test]
fn cells_that_no_one_has_solved_yet_are_sent_in_short_messages() {
    let mut stage = Stage::new(4);
    stage.world.borrow_mut().side_by_side = 2;
    stage = stage.hire(1000, &[]);
    stage.settings.jobs_per_message = NonZeroUsize::new(64).unwrap();
    let mut pool = stage.open(12);
    pool.evaluate(&questions(12, 0)).unwrap();
    let slices = stage.world.borrow().slices.clone();
    assert!(slices[0] == 2 && slices.iter().any(|jobs| *jobs > 2), "{slices:?}");
}

#[test]
fn a_restored_point_starts_from_the_given_snapshot() {
    let mut pool = Stage::new(4).hire(1000, &[]).open(2);
    pool.evaluate(&questions(2, 0)).unwrap();
    pool.commit().unwrap();
    let saved = pool.committed_snapshot(0).1.clone();
    let expected = pool.evaluate(&questions(1, 7)).unwrap();
    let mut resumed = Stage::new(5).hire(10, &[]).open(2);
    resumed.restore_point(0, crate::pool::PointState::from_snapshot(saved.bytes));
    assert_eq!(resumed.evaluate(&questions(1, 7)).unwrap(), expected);
    assert_eq!(resumed.statistics().states_sent, 1);
}

/// Also what happens while a resumed run waits for its first workers.
#[test]
fn a_resumed_run_goes_on_with_the_counts_of_workers_of_the_earlier_one() {
    let run = |archive: Option<&Archive>| {
        let mut stage = Stage::new(4).hire(8, &[None, Some(Fault::Die)]).hire(8, &[]).replacing(5, None);
        // However slow the machine is, no worker counts as hung.
        stage.settings.hang.floor = Duration::from_secs(60);
        let mut pool = stage.open(POINTS);
        pool.gather(2).unwrap();
        pool.evaluate(&questions(POINTS, 0)).unwrap();
        pool.commit().unwrap();
        if let Some(archive) = archive {
            pool.restore(archive).unwrap();
        }
        let mut saved = Archive::new();
        pool.save(&mut saved);
        (saved, pool.statistics())
    };
    let counts = |of: &PoolStatistics| [of.worker_restarts, of.workers_lost, of.reissued, of.workers_joined];
    let (saved, once) = run(None);
    assert_eq!((once.worker_restarts, once.workers_lost), (1, 1));
    let (saved, twice) = run(Some(&saved));
    assert_eq!(counts(&twice), counts(&once).map(|count| 2 * count));
    let (_, thrice) = run(Some(&saved));
    assert_eq!(counts(&thrice), counts(&once).map(|count| 3 * count));
    assert_eq!(thrice.solved, once.solved, "evaluations are those of the earlier run");
}
