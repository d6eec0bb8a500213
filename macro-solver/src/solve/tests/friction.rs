//! Friction that changes over a stage: what the points are asked, on a material whose stiffness is that of its friction.

use super::stages::Shelf;
use super::*;
use crate::formulation::Formulation;
use crate::material::altered::{Altered, EachAnswer};
use crate::observer::{Outcome, Statistics};
use crate::problem::dynamics::{DynamicSettings, Reporting};
use crate::problem::relaxation::RelaxationSettings;
use crate::problem::{Amplitude, Applied, PathControl, ProblemError, Procedure};
use crate::solve::solve_with_checkpoints;

/// A material loses half its stiffness with all its friction.
struct Softened {
    /// Reduction of friction of the latest trial of each point.
    reductions: Vec<f64>,
}

impl EachAnswer for Softened {
    fn change(&mut self, trial: &PointTrial, answer: &mut TrialResult) {
        let reduction = trial.options.friction_reduction;
        self.reductions[trial.point] = reduction;
        let factor = 1.0 - 0.5 * reduction;
        answer.stress.0.iter_mut().for_each(|value| *value *= factor);
        if let Some(tangent) = &mut answer.tangent {
            tangent.0.iter_mut().for_each(|value| *value *= factor);
        }
    }
}

/// An elastic material whose stiffness is that of its friction.
fn softened(problem: &Problem) -> Altered<ElasticMaterial, Softened> {
    let alteration = Softened { reductions: vec![0.0; problem.point_count()] };
    Altered { material: elastic(ElasticLaw::SmallStrain, problem), alteration }
}

fn friction(elements: &str, from: f64, to: f64, history: Amplitude) -> Applied {
    Applied::new(Condition::Friction { elements: elements.into(), from, to }, history)
}

/// A bar of two elements under a traction. The friction of its upper element falls to 0.2 in four steps, comes back to 0.6 at once, and
/// is that of the definition again in the last stage.
fn pulled_bar() -> Problem {
    let mut problem = Problem::new(block(ElementKind::Q4, 1, 2), Vec::new());
    problem.formulation = Formulation::SmallStrain;
    problem.mesh.element_sets.insert("upper".into(), vec![1]);
    let pulled = |history| {
        let traction = Condition::Traction { sides: "top".into(), value: [0.0, 1e4, 0.0] };
        let held = [Condition::fixed("bottom", Axis::Y), Condition::fixed("all", Axis::X)];
        held.into_iter().map(Applied::from).chain([Applied::new(traction, history)]).collect::<Vec<_>>()
    };
    let with = |name: &str, history, more: Option<Applied>| {
        let mut stage = Stage::new(name, pulled(history).into_iter().chain(more).collect());
        (stage.control.increments, stage.tolerances) = (4, TIGHT);
        stage
    };
    problem.stages = vec![
        with("pull", Amplitude::RAMP, None),
        with("fall", Amplitude::Constant, Some(friction("upper", 1.0, 0.2, Amplitude::RAMP))),
        with("back", Amplitude::Constant, Some(friction("upper", 0.2, 0.6, Amplitude::Constant))),
        with("whole", Amplitude::Constant, None),
    ];
    problem
}

/// Displacement of the top after every step.
#[derive(Default)]
struct Top(Vec<f64>);

impl Observer for Top {
    fn accepted(&mut self, _: &StepReport, view: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.0.push(view.displacements[view.mesh.node_sets["top"][0]][1]);
        Ok(())
    }
}

/// The upper element is `1 / (1 - r / 2)` times as soft as the lower one.
#[test]
fn each_point_is_asked_with_the_friction_of_its_moment() {
    for procedure in [Procedure::Implicit, Procedure::Relaxation(RelaxationSettings::default())] {
        let mut problem = pulled_bar();
        // Increments are composed as products, which this strain adds up to 2e-4.
        let within = if procedure == Procedure::Implicit { 1e-3 } else { 1e-2 };
        problem.stages[1].procedure = procedure;
        let mut top = Top::default();
        let mut material = softened(&problem);
        let outcome = solve(&problem, &mut material, &mut top).outcome;
        assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
        let whole = top.0[4];
        let softer = |factor: f64| 0.5 * whole * (1.0 + 1.0 / (1.0 - 0.5 * (1.0 - factor)));
        let expected = [0.8, 0.6, 0.4, 0.2].into_iter().chain([0.6; 4]).chain([1.0; 4]);
        for (step, factor) in expected.enumerate() {
            let found = top.0[5 + step];
            assert!((found / softer(factor) - 1.0).abs() < within, "step {}: {found} at {factor}", 5 + step);
        }
        assert!(
            material.alteration.reductions.iter().all(|reduction| *reduction == 0.0),
            "the last stage has the whole friction"
        );
    }
}

/// Stresses that change in their last digits from trial to trial, as those of grains do whose friction is another.
struct Restless {
    trials: u32,
}

impl EachAnswer for Restless {
    fn change(&mut self, trial: &PointTrial, answer: &mut TrialResult) {
        self.trials += 1;
        let change = 1e-9 * trial.options.friction_reduction * f64::from(self.trials).sin();
        answer.stress.0.iter_mut().for_each(|value| *value *= 1.0 + change);
    }
}

/// A body that bears the change stays where it is: its corrections have nothing to be compared with.
#[test]
fn a_body_that_bears_less_friction_takes_every_step_at_once() {
    let mut problem = pulled_bar();
    problem.stages.truncate(2);
    problem.stages[1].tolerances = Tolerances::default();
    let mut material =
        Altered { material: elastic(ElasticLaw::SmallStrain, &problem), alteration: Restless { trials: 0 } };
    let mut top = Top::default();
    let run = solve(&problem, &mut material, &mut top);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let Statistics { cut_backs, stagnated_steps, .. } = run.statistics;
    assert_eq!((top.0.len(), cut_backs, stagnated_steps), (9, 0, 0));
}

/// Points that are held everywhere have no strain that would ask them again: their answers were those of the friction before.
#[test]
fn points_at_rest_are_asked_again_once_their_friction_is_whole() {
    for procedure in [Procedure::Implicit, Procedure::Relaxation(RelaxationSettings::default())] {
        let mut problem = pulled_bar();
        problem.stages.remove(2);
        for stage in &mut problem.stages {
            stage.procedure = procedure.clone();
            let held = [Axis::X, Axis::Y].map(|axis| Applied::from(Condition::fixed("all", axis)));
            stage.conditions.splice(0..3, held);
        }
        let mut material = softened(&problem);
        let outcome = solve(&problem, &mut material, &mut Top::default()).outcome;
        assert!(matches!(outcome, Outcome::Completed), "{procedure:?}: {outcome:?}");
        assert_eq!(material.alteration.reductions, vec![0.0; problem.point_count()], "{procedure:?}");
    }
}

/// Explicit steps ask with the friction of their end; the last one with that of the stage's end.
#[test]
fn motion_asks_with_the_friction_of_the_instant() {
    let mut problem = pulled_bar();
    problem.stages.truncate(2);
    let settings = DynamicSettings { reporting: Reporting::Steps(1), ..DynamicSettings::new(1000.0) };
    problem.stages[1].procedure = Procedure::Dynamic(Box::new(settings));
    problem.stages[1].duration = 1.0;
    let mut material = softened(&problem);
    let outcome = solve(&problem, &mut material, &mut Top::default()).outcome;
    assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
    let (lower, upper) = material.alteration.reductions.split_at(problem.point_count() / 2);
    assert!(lower.iter().all(|reduction| *reduction == 0.0));
    assert!(upper.iter().all(|reduction| (reduction - 0.8).abs() < 1e-12), "{upper:?}");
}

#[test]
fn a_run_whose_friction_changes_goes_on_to_the_same_bits() {
    let problem = pulled_bar();
    let (mut whole, mut shelf) = (Top::default(), Shelf::default());
    solve_with_checkpoints(&problem, &mut softened(&problem), &mut whole, &mut shelf);
    assert_eq!(shelf.kept.len(), 17);
    for (mark, archive) in shelf.kept {
        let mut rest = Top::default();
        let mut shelf = Shelf { earlier: Some(archive), ..Shelf::default() };
        solve_with_checkpoints(&problem, &mut softened(&problem), &mut rest, &mut shelf);
        assert!(rest.0[..] == whole.0[mark.step as usize + 1..], "after step {}", mark.step);
    }
}

#[test]
fn frictions_that_make_no_sense_are_refused() {
    let refused = |change: &dyn Fn(&mut Problem)| {
        let mut problem = pulled_bar();
        change(&mut problem);
        match problem.validate() {
            Err(ProblemError::Stage { number: 1, error, .. }) => error.into_cause(),
            other => panic!("{other:?}"),
        }
    };
    let twice = refused(&|problem| {
        problem.stages[1].conditions.push(friction("all", 1.0, 0.5, Amplitude::RAMP));
    });
    assert!(matches!(&twice, ProblemError::TwoFrictions { element: 1, .. }), "{twice}");
    let sine = Amplitude::Sine { frequency: 1.0, phase: 0.0 };
    for history in [sine, Amplitude::Table(vec![[0.0, 0.0], [1.0, 1.1]])] {
        let found = refused(&|problem| problem.stages[1].conditions[3].history = history.clone());
        assert_eq!(found, ProblemError::FrictionHistory);
    }
    let unknown = refused(&|problem| {
        problem.stages[1].control.path = PathControl::ArcLength { first_load: 0.1, set: None, component: None };
    });
    assert_eq!(unknown, ProblemError::FrictionUnknownLoad);
    for (from, to) in [(1.0, 1.5), (-0.1, 1.0), (1.0, f64::NAN)] {
        let error =
            refused(&|problem| problem.stages[1].conditions[3] = friction("upper", from, to, Amplitude::RAMP));
        assert!(error.to_string().contains("between 0 and 1"), "{error}");
    }
}
