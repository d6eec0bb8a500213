//! A point that refuses its trial in an explicit step goes there in parts.

use super::*;
use crate::material::altered::{Altered, Timid};

/// A strip whose left end is pushed: the elements next to it are strained by up to 1e-4 in a step.
fn pushed() -> Problem {
    let push = moved("left", Axis::X, 0.002, Amplitude::RAMP);
    let mut problem =
        problem(strip(ElementKind::Q4Single, 6, 1.0), vec![push, held("bottom", Axis::Y)], 12.0, settings(2.0));
    problem.formulation = Formulation::Corotational;
    problem
}

#[test]
fn a_refused_trial_is_gone_in_parts_and_counted() {
    let problem = pushed();
    let solved = |limit: f64| {
        let mut material = Altered { material: elastic(&problem, 1.0, 1.0), alteration: Timid::new(limit) };
        let mut film = Film::default();
        let run = solve(&problem, &mut material, &mut film);
        (run, film, material.alteration.refused)
    };
    let (whole, film, refused) = solved(f64::INFINITY);
    assert!(matches!(whole.outcome, Outcome::Completed) && refused == 0 && whole.statistics.sub_steps == 0);
    let largest = film
        .instants
        .iter()
        .flat_map(|instant| &instant.points)
        .fold(0.0f64, |most, point| point.step_gradient.0.iter().fold(most, |most, value| most.max(value.abs())));
    for share in [0.6, 0.2] {
        let (run, in_parts, refused) = solved(share * largest);
        assert!(matches!(run.outcome, Outcome::Completed), "{share}: {:?}", run.outcome);
        let parts = run.statistics.sub_steps;
        assert!(parts > 0 && refused >= parts, "{parts} parts after {refused} refusals");
        assert_eq!(run.statistics.evaluations, whole.statistics.evaluations + parts, "each part is an evaluation");
        let size = film.last().displacements.iter().flatten().fold(0.0f64, |most, value| most.max(value.abs()));
        for (one, other) in
            film.last().displacements.iter().flatten().zip(in_parts.last().displacements.iter().flatten())
        {
            assert!((one - other).abs() < 1e-4 * size, "{one} {other}");
        }
    }
    // Parts of a sixteenth do not help: the run ends and says which point it was.
    let (run, _, _) = solved(0.01 * largest);
    let Outcome::Unstable { reason, .. } = &run.outcome else { panic!("{:?}", run.outcome) };
    assert!(reason.contains("Gauss point") && reason.contains("limit"), "{reason}");
}
