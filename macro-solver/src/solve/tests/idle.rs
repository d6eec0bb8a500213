//! Steps in which nothing changes, of a material whose stresses are known to a tolerance only, and steps behind which the pace changes.

use super::strategies::pressed;
use super::*;
use crate::material::altered::{Altered, EachAnswer};
use crate::observer::Outcome;
use crate::problem::relaxation::RelaxationSettings;
use crate::problem::{Amplitude, Applied, Moment, Predictor, Procedure, Stage};

/// Changes every stress by up to this share at every evaluation, as grains do that are at rest within a tolerance.
struct Unsteady {
    share: f64,
    evaluations: u64,
}

impl EachAnswer for Unsteady {
    fn change(&mut self, _: &PointTrial, answer: &mut TrialResult) {
        self.evaluations += 1;
        let share = self.share * (1.7 * self.evaluations as f64).sin();
        answer.stress.0.iter_mut().for_each(|component| *component *= 1.0 + share);
    }
}

fn solved(problem: &Problem) -> (Run, Recorder) {
    let alteration = Unsteady { share: 1e-5, evaluations: 0 };
    let mut material = Altered { material: elastic(ElasticLaw::SaintVenant, problem), alteration };
    let (finished, record) = run(problem, &mut material);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    assert_eq!(finished.statistics.stagnated_steps, 0);
    assert_eq!(finished.statistics.cut_backs, 0);
    (finished, record)
}

#[test]
fn a_stage_that_holds_what_there_is_costs_nothing() {
    let mut problem = pressed();
    problem.stages[0].tolerances = Tolerances::both(1e-3, 1e-2);
    let (pressed, record) = solved(&problem);
    let at_rest = |condition: &Applied| match &condition.condition {
        Condition::Platen { nodes, contact, axis, .. } => {
            let (nodes, contact, axis) = (nodes.clone(), *contact, *axis);
            Applied::from(Condition::Platen { nodes, contact, axis, displacement: 0.0 })
        }
        other => panic!("{other:?}"),
    };
    let mut hold = Stage::new("hold", problem.stages[0].conditions.iter().map(at_rest).collect());
    hold.control = problem.stages[0].control.clone();
    hold.tolerances = problem.stages[0].tolerances;
    problem.stages.push(hold);
    let (held, held_record) = solved(&problem);
    assert_eq!(held.statistics.steps, pressed.statistics.steps + 4);
    assert_eq!(held.statistics.iterations, pressed.statistics.iterations + 4);
    assert_eq!(held.statistics.evaluations, pressed.statistics.evaluations);
    assert_eq!(held.statistics.idle_steps, 4);
    assert_eq!(held_record.displacements, record.displacements);
}

/// A sine that every step meets at a zero, but for rounding.
#[test]
fn a_history_that_is_met_at_its_zeros_moves_nothing() {
    let mut problem = pressed();
    problem.stages[0].tolerances = Tolerances::both(1e-3, 1e-2);
    let sine = Amplitude::Sine { frequency: 4.0, phase: 0.0 };
    problem.stages[0].conditions[1].history = sine;
    let (finished, record) = solved(&problem);
    assert_eq!(finished.statistics.steps, 4);
    assert_eq!(finished.statistics.iterations, 4);
    assert!(record.displacements.iter().flatten().all(|value| value.abs() < 1e-12));
}

/// A step in which nothing moved, or hardly anything, tells nothing about the next one: all of it went in one ramp step where a load
/// began to act.
#[test]
fn a_load_that_begins_after_slow_steps_acts_in_as_many_ramp_steps_as_its_strain_needs() {
    for procedure in [Procedure::Implicit, Procedure::Relaxation(RelaxationSettings::default())] {
        for slow in [0.0, 1e-3] {
            let pulled = Condition::Traction { sides: "top".into(), value: [0.0, 1.0e6, 0.0] };
            let later = Amplitude::Table(vec![[0.0, 0.0], [0.5, slow], [1.0, 1.0]]);
            let mut problem = Problem::new(
                block(ElementKind::Q4, 1, 1),
                vec![Condition::fixed("left", Axis::X), Condition::fixed("bottom", Axis::Y), pulled],
            );
            problem.strain_per_step = 1e-3;
            let stage = &mut problem.stages[0];
            (stage.conditions[2].history, stage.duration, stage.control.increments) = (later, 1.0, 4);
            (stage.tolerances, stage.procedure) = (Tolerances::both(1e-4, 1e-2), procedure.clone());
            let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
            let (finished, record) = run(&problem, &mut spy);
            assert!(matches!(finished.outcome, Outcome::Completed), "{procedure:?}: {:?}", finished.outcome);
            assert_eq!(spy.commits, 4);
            let ramps: Vec<u32> = spy.committed_trials(2).iter().map(|trial| trial.options.ramp_steps).collect();
            // Half of the strain at the end, within a factor of three.
            let strain = 0.5 * record.displacements[3][1];
            let needed = strain / problem.strain_per_step;
            let fits = |ramp: &u32| (needed / 3.0..3.0 * needed).contains(&f64::from(*ramp));
            assert!(needed > 5.0 && ramps.iter().all(fits), "{procedure:?}, {slow}: {ramps:?} for {needed}");
        }
    }
}

/// A first iterate that leaves the free nodes where they are, or repeats a much slower step, strains those next to the moving support
/// alone: the others took their strain in one ramp step, or in far too few.
#[test]
fn relaxation_ramps_every_point_alike_where_the_step_repeats_none() {
    let kinked = Amplitude::Table(vec![[0.0, 0.0], [0.5, 0.1], [1.0, 1.0]]);
    for (predictor, history) in [(Predictor::Linear, kinked), (Predictor::Tangent, Amplitude::RAMP)] {
        let rows = 4;
        let moved = Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -0.04 };
        let mut problem = Problem::new(
            block(ElementKind::Q4, 1, rows),
            vec![Condition::fixed("left", Axis::X), Condition::fixed("bottom", Axis::Y), moved],
        );
        problem.strain_per_step = 1e-4;
        let stage = &mut problem.stages[0];
        (stage.conditions[2].history, stage.duration, stage.control.increments) = (history.clone(), 1.0, 4);
        (stage.tolerances, stage.strategy.predictor) = (Tolerances::both(1e-4, 1e-2), predictor);
        stage.procedure = Procedure::Relaxation(RelaxationSettings::default());
        let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
        let (finished, _) = run(&problem, &mut spy);
        assert!(matches!(finished.outcome, Outcome::Completed), "{predictor:?}: {:?}", finished.outcome);
        assert_eq!(spy.commits, 4);
        let reached = |step: usize| {
            let load = 0.25 * step as f64;
            history.factor(Moment { load, time: load })
        };
        for step in 0..4 {
            let strain = 0.04 * (reached(step + 1) - reached(step)) / rows as f64;
            let needed = strain / problem.strain_per_step;
            let trials = spy.committed_trials(step);
            let ramps: Vec<u32> = trials.iter().map(|trial| trial.options.ramp_steps).collect();
            let fits = |ramp: &u32| (needed / 1.3..1.3 * needed).contains(&f64::from(*ramp));
            assert!(ramps.iter().all(fits), "{predictor:?}, step {step}: {ramps:?} for {needed}");
        }
    }
}
