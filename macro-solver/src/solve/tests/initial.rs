//! The stress that a body starts with: a ground at rest stays at rest, and what is out of balance is misfit.

use super::*;
use crate::observer::Outcome;
use crate::problem::dynamics::DynamicSettings;
use crate::problem::{Amplitude, Applied, InitialLimits, InitialState, InitialStress, Procedure};

const WEIGHT: f64 = 2.0e4;

/// A layer of 3 x 2 m under its own weight, between smooth walls.
fn layer(kind: ElementKind) -> (Problem, InitialStress) {
    let held = [("bottom", Axis::Y), ("left", Axis::X), ("right", Axis::X)];
    let mut problem = Problem::new(block(kind, 3, 2), Vec::new());
    let weight = Condition::BodyForce { elements: "all".into(), value: [0.0, -WEIGHT, 0.0] };
    let supports = held.map(|(set, axis)| Condition::fixed(set, axis).into());
    problem.stages[0].conditions = supports.into_iter().chain([Applied::new(weight, Amplitude::Constant)]).collect();
    problem.stages[0].control.increments = 1;
    let rest = InitialStress::Geostatic { surface: 2.0, unit_weight: WEIGHT, rest_coefficient: 0.4, surcharge: 0.0 };
    (problem, rest)
}

fn start(problem: &Problem, field: &InitialStress) -> ElasticMaterial {
    elastic(ElasticLaw::SaintVenant, problem).with_initial_field(&problem.mesh, field)
}

#[test]
fn a_ground_at_rest_needs_no_step_to_be_in_balance() {
    for kind in [ElementKind::Q4, ElementKind::Q8] {
        let (mut problem, rest) = layer(kind);
        problem.initial = InitialState {
            expected: Some(rest.clone()),
            limits: InitialLimits { largest_deviation: Some(1e-12), largest_imbalance: Some(1e-12) },
            ..InitialState::default()
        };
        let (run, record) = run(&problem, &mut start(&problem, &rest));
        assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {:?}", run.outcome);
        assert!(run.statistics.initial_imbalance < 1e-12 && run.statistics.initial_deviation == 0.0);
        assert_eq!(record.steps[0].iterations, 0);
        let moved = record.displacements.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
        assert!(moved < 1e-12, "{moved:e}");
    }
}

/// The deviation was infinite, which no summary can hold.
#[test]
fn a_stress_of_zero_may_be_expected() {
    let (mut problem, rest) = layer(ElementKind::Q4);
    problem.initial.expected = Some(InitialStress::Uniform([[0.0; 3]; 3]));
    let (loaded, _) = run(&problem, &mut start(&problem, &rest));
    assert!(matches!(loaded.outcome, Outcome::Completed), "{:?}", loaded.outcome);
    assert_eq!(loaded.statistics.initial_deviation, 1.0);
    let (bare, _) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert_eq!(bare.statistics.initial_deviation, 0.0);
    // A body without any force has no sum of forces either.
    let mut weightless = problem.clone();
    weightless.stages[0].conditions.pop();
    let (bare, _) = run(&weightless, &mut elastic(ElasticLaw::SaintVenant, &weightless));
    assert_eq!(bare.statistics.largest_force_sum, 0.0, "{:?}", bare.outcome);
}

#[test]
fn what_is_out_of_balance_is_told_and_equilibrated_or_refused() {
    let (mut problem, rest) = layer(ElementKind::Q8);
    let InitialStress::Geostatic { surface, rest_coefficient, surcharge, .. } = rest else { panic!("at rest") };
    let light = InitialStress::Geostatic { surface, unit_weight: 0.5 * WEIGHT, rest_coefficient, surcharge };
    problem.initial.expected = Some(rest);
    problem.stages[0].tolerances = TIGHT;
    let (settled, record) = run(&problem, &mut start(&problem, &light));
    assert!(matches!(settled.outcome, Outcome::Completed), "{:?}", settled.outcome);
    let misfit = (settled.statistics.initial_imbalance, settled.statistics.initial_deviation);
    assert!((misfit.0 - 0.4778).abs() < 1e-3 && (misfit.1 - 0.5).abs() < 1e-9, "{misfit:?}");
    assert!(record.steps[0].iterations > 0 && record.steps[0].force_ratio < 1e-9, "step 0 has settled it");
    problem.initial.limits.largest_imbalance = Some(0.05);
    let (refused, record) = run(&problem, &mut start(&problem, &light));
    match refused.outcome {
        Outcome::DidNotConverge { reason } => assert!(reason.contains("out of balance by"), "{reason}"),
        other => panic!("{other:?}"),
    }
    assert!(record.steps.is_empty());
    problem.initial.limits.largest_deviation = Some(0.1);
    let (refused, _) = run(&problem, &mut start(&problem, &light));
    match refused.outcome {
        Outcome::DidNotConverge { reason } => assert!(reason.contains("what initial_stress expects"), "{reason}"),
        other => panic!("{other:?}"),
    }
}

/// The limits of a run that begins with a motion were not looked at, and both figures were 0.
#[test]
fn the_start_of_a_motion_is_told_and_refused_like_that_of_load_steps() {
    let (mut problem, rest) = layer(ElementKind::Q4);
    let InitialStress::Geostatic { surface, rest_coefficient, surcharge, .. } = rest else { panic!("at rest") };
    let light = InitialStress::Geostatic { surface, unit_weight: 0.5 * WEIGHT, rest_coefficient, surcharge };
    problem.initial.expected = Some(rest.clone());
    problem.stages[0].procedure = Procedure::Dynamic(Box::new(DynamicSettings::new(2e3)));
    problem.stages[0].duration = 0.02;
    let (moved, record) = run(&problem, &mut start(&problem, &light));
    assert!(matches!(moved.outcome, Outcome::Completed), "{:?}", moved.outcome);
    let misfit = (moved.statistics.initial_imbalance, moved.statistics.initial_deviation);
    assert!((misfit.0 - 0.4395).abs() < 1e-3 && (misfit.1 - 0.5).abs() < 1e-9, "{misfit:?}");
    assert!(record.displacements.iter().any(|moved| moved[1] < -1e-6), "it sinks");
    problem.initial.limits = InitialLimits { largest_deviation: Some(1e-9), largest_imbalance: Some(1e-9) };
    let (still, _) = run(&problem, &mut start(&problem, &rest));
    assert!(matches!(still.outcome, Outcome::Completed), "{:?}", still.outcome);
    for limits in [
        InitialLimits { largest_deviation: Some(0.1), largest_imbalance: None },
        InitialLimits { largest_deviation: None, largest_imbalance: Some(0.05) },
    ] {
        problem.initial.limits = limits;
        let (refused, record) = run(&problem, &mut start(&problem, &light));
        let said = if limits.largest_imbalance.is_some() { "out of balance by" } else { "initial_stress expects" };
        match refused.outcome {
            Outcome::DidNotConverge { reason } => assert!(reason.contains(said), "{reason}"),
            other => panic!("{other:?}"),
        }
        assert!(record.steps.is_empty());
    }
}
