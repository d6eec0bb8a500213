//! Answers that are wrong, and refusals that no smaller step would cure.

use super::*;
use crate::material::altered::{Altered, EachAnswer};
use crate::observer::Outcome;
use protocol::RveError;

fn squeezed() -> Problem {
    let platen = Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -1e-3 };
    let held = [("bottom", Axis::Y), ("bottom_left", Axis::X)].map(|(set, axis)| Condition::fixed(set, axis));
    let mut problem = Problem::new(block(ElementKind::Q4, 1, 1), held.into_iter().chain([platen]).collect());
    problem.stages[0].control.increments = 2;
    problem
}

/// Adds a couple to every stress, as a share of its largest component.
struct Couple(f64);

impl EachAnswer for Couple {
    fn change(&mut self, _: &PointTrial, answer: &mut TrialResult) {
        let size = answer.stress.0.iter().fold(0.0f64, |most, value| most.max(value.abs()));
        answer.stress.0[1] += self.0 * size;
        answer.stress.0[3] -= self.0 * size;
    }
}

#[test]
fn stresses_that_are_not_symmetric_are_counted() {
    let mut problem = squeezed();
    // Where rotations of grains are blocked, nothing makes stresses symmetric.
    for (share, symmetric, counted) in
        [(0.0, true, false), (1e-3, true, false), (0.2, true, true), (0.2, false, false)]
    {
        problem.symmetric_stresses = symmetric;
        let material = elastic(ElasticLaw::SmallStrain, &problem);
        let mut material = Altered { material, alteration: Couple(share) };
        let statistics = run(&problem, &mut material).0.statistics;
        assert_eq!(statistics.asymmetric_stresses > 0, counted, "{share}: {}", statistics.asymmetric_stresses);
    }
}

#[test]
fn only_refusals_of_the_target_are_tried_again_with_a_smaller_step() {
    let problem = squeezed();
    let ended = |reason: RveError| {
        let mut spy = Spy::new(elastic(ElasticLaw::SmallStrain, &problem));
        let mut calls = 0;
        spy.refuse = Box::new(move |_, trials| {
            calls += 1;
            let refused = trials.iter().find(|trial| calls > 1 && trial.target.0.iter().any(|value| *value != 0.0));
            refused.map(|trial| MaterialError::Point { point: trial.point, reason: reason.clone() })
        });
        let (run, record) = run(&problem, &mut spy);
        let Outcome::DidNotConverge { reason } = run.outcome else { panic!("{:?}", run.outcome) };
        (reason, record.cut_backs.len())
    };
    let (reason, cut_backs) = ended(RveError::Definition("no such law".into()));
    assert!(cut_backs == 0 && reason.contains("no such law"), "{cut_backs}: {reason}");
    let (reason, cut_backs) = ended(RveError::TargetTooLarge { norm: 0.3, limit: 0.2 });
    assert!(cut_backs > 3 && reason.contains("limit"), "{cut_backs}: {reason}");
}
