//! Steps in which nothing changes, of a material whose stresses are known to a tolerance only.

use super::strategies::pressed;
use super::*;
use crate::material::altered::{Altered, EachAnswer};
use crate::observer::Outcome;
use crate::problem::{Amplitude, Applied, Stage};

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
