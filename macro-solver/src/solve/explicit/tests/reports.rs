//! What a report covers: all time steps since the one before.

use super::*;
use nalgebra::Matrix3;
use protocol::Tensor2;

fn film(formulation: Formulation, reporting: Reporting) -> Film {
    let smooth = |nodes: &str, axis, value| Condition::Displacement { nodes: nodes.into(), axis, value };
    let conditions = vec![
        smooth("left", Axis::X, 0.0).into(),
        smooth("bottom", Axis::Y, 0.0).into(),
        Applied::new(smooth("right", Axis::X, 0.03), Amplitude::Smooth { from: 0.0, to: 1.0 }),
    ];
    let settings = DynamicSettings { reporting, ..DynamicSettings::new(2000.0) };
    let mut problem = problem(strip(ElementKind::Q4, 3, 0.1), conditions, 4e-2, settings);
    problem.formulation = formulation;
    let mut film = Film::default();
    let run = solve(&problem, &mut elastic(&problem, 1e7, 1e7), &mut film);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    film
}

/// The displacement gradient of a step that the probes of increments read was that of the last time step.
#[test]
fn gradients_of_a_report_join_those_of_its_time_steps() {
    let matrix = |tensor: &Tensor2| Matrix3::from_row_slice(&tensor.0);
    for formulation in [Formulation::SmallStrain, Formulation::UpdatedLagrangian] {
        let (every, fifth) = (film(formulation, Reporting::Steps(1)), film(formulation, Reporting::Steps(5)));
        assert!(fifth.instants.len() > 5);
        for (number, instant) in fifth.instants.iter().enumerate().skip(1) {
            let steps = &every.instants[5 * (number - 1) + 1..(5 * number + 1).min(every.instants.len())];
            for (point, fields) in instant.points.iter().enumerate() {
                let mut joined = Matrix3::zeros();
                for step in steps {
                    joined = formulation.joined(&joined, &matrix(&step.points[point].step_gradient));
                }
                let difference = (matrix(&fields.step_gradient) - joined).amax();
                assert!(difference < 1e-15, "{formulation:?}, report {number}, point {point}: {difference:e}");
            }
        }
        let largest = fifth.instants[3].points[0].step_gradient.0[0];
        assert!(largest > 3.0 * every.instants[15].points[0].step_gradient.0[0], "{largest:e}");
    }
}
