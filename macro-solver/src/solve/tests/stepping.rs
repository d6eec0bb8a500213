//! Steps: restart from committed states (I-9), cut-back, honest failure, exact skipping, interruption.

use super::*;
use crate::formulation::Formulation;
use crate::material::damage::{DamageLaw, DamageMaterial};
use crate::observer::Outcome;
use crate::problem::{Amplitude, Applied, MultiPointConstraint, Platen, Predictor, SecantSettings, TangentUpdate};
use claims::Claim;
use protocol::{RveError, TangentKind, Tensor2};
use std::cell::Cell;
use std::rc::Rc;

fn compression(displacement: f64) -> Problem {
    let mut problem = Problem::new(
        block(ElementKind::Q8, 2, 2),
        vec![
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Rough, axis: Axis::Y, displacement: 0.0 },
            Condition::Platen { nodes: "top".into(), contact: Platen::Rough, axis: Axis::Y, displacement },
        ],
    );
    problem.stages[0].control.increments = 4;
    problem.stages[0].tolerances = TIGHT;
    problem
}

fn stresses(record: &Recorder) -> Vec<Tensor2> {
    record.points.iter().map(|point| point.stress).collect()
}

/// I-9. Replaying only the accepted target of each step, once, gives the same bits as the iterated run.
#[test]
fn accepted_states_depend_on_accepted_targets_alone() {
    let problem = compression(-0.4);
    let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    let (finished, record) = run(&problem, &mut spy);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    assert_eq!(spy.commits, 4);
    let mut replay = elastic(ElasticLaw::SaintVenant, &problem);
    let mut last = Vec::new();
    for step in 0..4 {
        let trials = spy.committed_trials(step);
        assert_eq!(trials.len(), problem.point_count());
        last = replay.evaluate(&trials).unwrap();
        replay.commit().unwrap();
    }
    let is_same = last.iter().map(|answer| answer.stress).collect::<Vec<_>>() == stresses(&record);
    Claim::of("I-9", "stresses of a replay of the accepted targets alone are the same bits").holds(is_same);
    assert!(finished.statistics.evaluations > 5 * problem.point_count() as u64, "several iterations a step");
}

/// The path of the iterates must not matter beyond the tolerance: the law is path independent here.
#[test]
fn predictor_and_secant_change_the_path_but_not_the_answer() {
    let mut problem = compression(-0.4);
    let (_, plain) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    problem.stages[0].strategy.predictor = Predictor::Tangent;
    problem.stages[0].strategy.secant = Some(SecantSettings::default());
    let (finished, other) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    assert!(finished.statistics.secant_corrections > 0);
    for (one, two) in stresses(&plain).iter().zip(stresses(&other)) {
        for component in 0..9 {
            assert!((one.0[component] - two.0[component]).abs() < 1e-7 * 2e7);
        }
    }
}

#[test]
fn steps_that_a_point_refuses_are_cut_back_and_the_stage_still_ends_at_one() {
    let problem = compression(-0.4);
    let (whole, plain) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert_eq!(whole.statistics.cut_backs, 0);
    assert_eq!(plain.steps.iter().map(|step| step.load).collect::<Vec<_>>(), [0.0, 0.25, 0.5, 0.75, 1.0]);
    let mut delicate = elastic(ElasticLaw::SaintVenant, &problem).with_largest_target(0.03);
    let (finished, record) = run(&problem, &mut delicate);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    assert!(finished.statistics.cut_backs > 0 && record.cut_backs.len() as u64 == finished.statistics.cut_backs);
    assert!(record.cut_backs[0].reason.contains("Gauss point"), "{}", record.cut_backs[0].reason);
    // Refused trials are no evaluations.
    let costs = || record.cut_backs.iter().map(|event| event.cost);
    assert!(costs().all(|cost| cost.iterations > 0));
    assert_eq!(costs().map(|cost| cost.evaluations).sum::<u64>(), finished.statistics.failed_evaluations);
    assert_eq!((finished.load, record.steps.last().unwrap().load), (1.0, 1.0));
    for (one, two) in stresses(&plain).iter().zip(stresses(&record)) {
        assert!((one.0[4] - two.0[4]).abs() < 1e-7 * 2e7, "hyperelastic: the split into steps cannot matter");
    }
}

#[test]
fn a_limit_that_no_step_passes_ends_in_failure_with_everything_before_it_kept() {
    let mut problem = compression(-0.4);
    problem.stages[0].control.min = 1e-2;
    let mut brittle = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    let reached = Rc::new(Cell::new(1.0));
    let largest = Rc::clone(&reached);
    // Refuses everything once the first step is in.
    brittle.refuse = Box::new(move |_, trials| {
        let compressed = trials[0].target.get(1, 1).abs() > 0.0 && largest.get() < 0.0;
        largest.set(largest.get() - 0.1);
        let reason = RveError::NotFinite { force_evaluations: 7 };
        compressed.then_some(MaterialError::Point { point: 3, reason })
    });
    let (failed, record) = run(&problem, &mut brittle);
    match failed.outcome {
        Outcome::DidNotConverge { reason } => {
            assert!(reason.contains("Gauss point 3") && reason.contains("smallest step"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
    assert!(failed.load > 0.0 && failed.load < 1.0 && record.steps.last().unwrap().load == failed.load);
    assert_eq!(record.cut_backs.last().unwrap().to, problem.stages[0].control.min, "the smallest step is tried");
    assert_eq!(brittle.commits, record.steps.len() - 1);
}

/// A step between one and one and a half of the smallest steps before the end of the path was cut back to itself for ever.
#[test]
fn a_last_step_that_cannot_be_cut_back_fails() {
    // With 0.4 the first half of the path bears, the second does not: steps taken, cut back.
    for (min, expected) in [(0.7, [0, 0]), (0.9, [0, 0]), (0.4, [1, 1])] {
        let mut problem = compression(-0.4);
        let control = &mut problem.stages[0].control;
        (control.increments, control.min, control.stabilisation) = (1, min, None);
        let mut brittle = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
        brittle.refuse = Box::new(move |commits, trials| {
            let reason = RveError::NotFinite { force_evaluations: 7 };
            let largest = trials.iter().map(|trial| trial.target.get(1, 1).abs()).fold(0.0, f64::max);
            let limit = if min < 0.5 && commits == 0 { 0.15 } else { 0.0 };
            (largest > limit).then_some(MaterialError::Point { point: 3, reason })
        });
        let (failed, record) = run(&problem, &mut brittle);
        assert!(matches!(failed.outcome, Outcome::DidNotConverge { .. }), "{min}: {:?}", failed.outcome);
        assert_eq!([record.steps.len() - 1, record.cut_backs.len()], expected, "{min}");
    }
}

/// A step that was cut back does not carry those after it past the peak of a history.
#[test]
fn the_peak_of_a_history_is_met_after_a_cut_back() {
    let mut problem = compression(-0.1);
    let peak = Amplitude::Table(vec![[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]);
    problem.stages[0].conditions[1].history = peak;
    let mut calls = 0;
    let mut brittle = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    brittle.refuse = Box::new(move |commits, _| {
        calls += usize::from(commits == 1);
        let reason = RveError::NotFinite { force_evaluations: 7 };
        (calls == 1).then_some(MaterialError::Point { point: 3, reason })
    });
    let (finished, record) = run(&problem, &mut brittle);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    let loads: Vec<f64> = record.steps.iter().map(|step| step.load).collect();
    // Three halves of the step before would end at 0.5625.
    assert_eq!((record.cut_backs.len(), &loads[..]), (1, &[0.0, 0.25, 0.375, 0.5, 0.75, 1.0][..]));
    // An elastic answer counts as one; the refused trial says what it took.
    assert_eq!(finished.statistics.cost.force_evaluations, finished.statistics.evaluations + 7);
}

/// Grains that did not come to rest within their step cap cost a smaller step; the log says how far they got.
#[test]
fn grains_that_do_not_come_to_rest_cost_a_cut_back_and_are_counted() {
    let problem = compression(-0.4);
    let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    let mut first = true;
    spy.refuse = Box::new(move |_, trials| {
        let reason = RveError::NotEquilibrated {
            strain: 0.5 * trials[0].target.get(1, 1).abs(),
            target: trials[0].target.get(1, 1).abs(),
            increments: 7,
            of: 14,
            unbalanced: 0.3,
            tolerance: 1e-3,
            force_evaluations: 8,
        };
        let refuses = trials[0].target.get(1, 1) != 0.0 && std::mem::take(&mut first);
        refuses.then_some(MaterialError::Point { point: 2, reason })
    });
    let (finished, record) = run(&problem, &mut spy);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    assert_eq!((finished.statistics.unfinished_trials, record.cut_backs.len()), (1, 1));
    let reason = &record.cut_backs[0].reason;
    for part in ["Gauss point 2", "7 of 14 increments", "a force ratio of 3.00e-1", "8 force evaluations"] {
        assert!(reason.contains(part), "{reason}");
    }
}

#[test]
fn interruption_and_lost_workers_end_the_run_as_such() {
    let problem = compression(-0.4);
    let outcome_of = |make: fn() -> MaterialError| {
        let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
        let mut calls = 0;
        spy.refuse = Box::new(move |_, _| {
            calls += 1;
            (calls == 5).then(make)
        });
        run(&problem, &mut spy).0.outcome
    };
    assert!(matches!(outcome_of(|| MaterialError::Interrupted), Outcome::Interrupted));
    assert!(matches!(outcome_of(|| MaterialError::WorkersLost("gone".into())), Outcome::WorkersLost { .. }));
}

#[test]
fn an_observer_can_stop_the_run() {
    struct FullDisk;
    impl Observer for FullDisk {
        fn accepted(&mut self, report: &StepReport, _: &FieldsView<'_>) -> Result<(), StopRequest> {
            if report.step == 2 { Err(StopRequest { reason: "disk full".into() }) } else { Ok(()) }
        }
    }
    let problem = compression(-0.4);
    let stopped = solve(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem), &mut FullDisk);
    assert!(matches!(stopped.outcome, Outcome::Stopped(_)) && stopped.load == 0.5);
}

/// The compression, with one more element that touches nothing, and the number of its first node.
fn compression_next_to_a_block() -> (Problem, usize) {
    let mut problem = compression(-0.4);
    let first = problem.mesh.nodes.len();
    problem.mesh.nodes.extend([[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 1.0, 0.0], [5.0, 1.0, 0.0]]);
    problem.mesh.nodes.extend([[5.5, 0.0, 0.0], [6.0, 0.5, 0.0], [5.5, 1.0, 0.0], [5.0, 0.5, 0.0]]);
    problem.mesh.elements.push((first..first + 8).collect());
    problem.mesh.kinds.push(problem.mesh.kinds[0]);
    (problem, first)
}

/// A second block that does not move is asked once per step, and the result has the same bits as asking always.
#[test]
fn unchanged_targets_are_skipped_without_changing_a_bit() {
    let (mut problem, first) = compression_next_to_a_block();
    problem.mesh.node_sets.insert("still".into(), (first..first + 8).collect());
    let still = [Axis::X, Axis::Y].map(|axis| Condition::fixed("still", axis).into());
    problem.stages[0].conditions.extend(still);
    let (thrifty, kept) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    problem.stages[0].strategy.keep_unchanged = false;
    problem.keeps_still_points = false;
    let (lavish, solved) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert_eq!((stresses(&kept), &kept.displacements), (stresses(&solved), &solved.displacements));
    let skipped = |run: &Run| run.statistics.skipped + run.statistics.still_points;
    assert!(thrifty.statistics.still_points > 0 && skipped(&lavish) == 0);
    assert_eq!(thrifty.statistics.evaluations + skipped(&thrifty), lavish.statistics.evaluations);
    assert_eq!(thrifty.statistics.evaluations_per_point.iter().sum::<u64>(), thrifty.statistics.evaluations);
}

/// A second block whose every node is prescribed has the same target at every iterate: it is asked again when a tangent is wanted for the
/// first time in the step. It kept the reply without one, and with it the tangent of an earlier step.
#[test]
fn a_kept_reply_without_a_tangent_does_not_stand_for_one() {
    let (mut problem, first) = compression_next_to_a_block();
    let sets = [("low", vec![0, 1, 4]), ("middle", vec![5, 7]), ("high", vec![2, 3, 6])];
    for ((name, nodes), share) in sets.into_iter().zip([0.0, 0.5, 1.0]) {
        problem.mesh.node_sets.insert(name.into(), nodes.into_iter().map(|node| first + node).collect());
        problem.stages[0].conditions.push(Condition::fixed(name, Axis::X).into());
        let sinks = Condition::Displacement { nodes: name.into(), axis: Axis::Y, value: -0.1 * share };
        problem.stages[0].conditions.push(sinks.into());
    }
    problem.stages[0].strategy.tangent_update = TangentUpdate::SecondIterate;
    let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    let (thrifty, kept) = run(&problem, &mut spy);
    let mut lavish = problem.clone();
    lavish.stages[0].strategy.keep_unchanged = false;
    let (lavish, solved) = run(&lavish, &mut elastic(ElasticLaw::SaintVenant, &lavish));
    assert_eq!((stresses(&kept), &kept.displacements), (stresses(&solved), &solved.displacements));
    assert!(thrifty.statistics.skipped > 0 && lavish.statistics.skipped == 0);
    let free = problem.point_count() - problem.mesh.kinds[0].point_count();
    let mut asked = 0;
    for trials in &spy.trials {
        let tangents = |is_prescribed: bool| -> usize {
            let wanted = |trial: &&PointTrial| trial.options.tangent != TangentKind::None;
            let of = trials.iter().filter(wanted).filter(|trial| (trial.point >= free) == is_prescribed).count();
            of / if is_prescribed { problem.mesh.kinds[0].point_count() } else { free }
        };
        assert_eq!(tangents(true), tangents(false).min(1));
        asked += tangents(true);
    }
    assert!(asked > 0);
}

/// The number of ramp increments of a point is one number per step, from its predicted strain.
#[test]
fn ramp_counts_are_fixed_within_a_step() {
    let mut problem = compression(-0.4);
    problem.strain_per_step = 1e-4;
    let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    run(&problem, &mut spy);
    for step in 0..4 {
        for point in 0..problem.point_count() {
            let counts: Vec<u32> =
                spy.trials[step].iter().filter(|t| t.point == point).map(|t| t.options.ramp_steps).collect();
            assert!(counts.iter().all(|count| *count == counts[0] && *count > 100), "{counts:?}");
        }
    }
}

/// S-12. A motion that turns an element inside out is found before any point is asked for it.
#[test]
fn an_inverted_element_is_refused_before_any_point_is_asked() {
    let mut problem = compression(-1.0);
    let height = problem.mesh.nodes.iter().map(|node| node[1]).fold(0.0, f64::max);
    problem = compression(-1.5 * height);
    problem.stages[0].control.increments = 1;
    problem.stages[0].control.min = 1.0;
    // Stabilisation would go there by increments that turn nothing inside out as yet.
    problem.stages[0].control.stabilisation = None;
    let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
    let (run, _) = run(&problem, &mut spy);
    match run.outcome {
        Outcome::DidNotConverge { reason } => {
            let quantity = "the attempt ends with the element that is turned inside out";
            Claim::of("S-12", quantity).holds(reason.contains("turned inside out"));
        }
        other => panic!("{other:?}"),
    }
    let asked = run.statistics.evaluations as f64 - problem.point_count() as f64;
    let quantity = "points that are asked after the initial state";
    Claim::of("S-12", quantity).value(asked, 0.0).within_absolute(0.0);
}

/// The last step is repeated by the share that the supports repeat, there and back at any pace: a linear body needs no iteration.
#[test]
fn the_predictor_follows_supports_that_turn_back() {
    let supports = compression(0.0).stages[0].conditions.clone();
    let top = Condition::Platen { nodes: "top".into(), contact: Platen::Rough, axis: Axis::Y, displacement: -1e-5 };
    let cycle = Amplitude::Table(vec![[0.0, 0.0], [0.2, 1.0], [0.8, -1.0], [1.0, -0.5]]);
    let mut problem = compression(0.0);
    problem.formulation = Formulation::SmallStrain;
    problem.stages[0].conditions = vec![supports[0].clone(), Applied::new(top, cycle)];
    problem.stages[0].control.increments = 10;
    problem.stages[0].tolerances = Tolerances::both(1e-4, 1e-4);
    let (finished, record) = run(&problem, &mut elastic(ElasticLaw::SmallStrain, &problem));
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    let iterations: Vec<usize> = record.steps.iter().skip(1).map(|step| step.iterations).collect();
    assert_eq!(iterations, [1; 10]);
}

/// A tilting platen prescribes no component of any node. Where it turned back, the step before was repeated forwards.
#[test]
fn a_link_that_turns_back_is_predicted_backwards() {
    let platen = MultiPointConstraint::TiltingPlaten {
        nodes: "top".into(),
        axis: Axis::Y,
        displacement: Some(-0.02),
        rotation: [None; 3],
    };
    let mut problem = Problem::new(
        block(ElementKind::Q4, 2, 2),
        vec![
            Condition::fixed("left", Axis::X),
            Condition::fixed("bottom", Axis::Y),
            Condition::MultiPointConstraint(platen),
        ],
    );
    problem.formulation = Formulation::SmallStrain;
    let stage = &mut problem.stages[0];
    stage.conditions[2].history = Amplitude::Table(vec![[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]);
    (stage.tolerances, stage.control.increments) = (TIGHT, 4);
    let mut linear = DamageMaterial::new(vec![DamageLaw::elastic(2.0e7, 1.0e7); problem.point_count()]);
    let (finished, record) = run(&problem, &mut linear);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    let iterations: Vec<usize> = record.steps.iter().skip(1).map(|step| step.iterations).collect();
    assert_eq!(iterations, [1; 4], "the first iterate of a linear body is its equilibrium");
}
