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

/// Reports of an interval are as many as there are intervals, each in the first time step behind its instant, though the time step grows
/// on the way: the time before a step was taken from the new step, which skipped some instants and reported others twice.
#[test]
fn reports_keep_to_their_interval_when_the_time_step_changes() {
    let law = DamageLaw { lambda: 1.0, shear: 1.0, threshold: 1e-3, softening: 1e-2 };
    for interval in [4.3, 5.0, 7.0] {
        let reporting = Reporting::Interval(interval);
        let settings = DynamicSettings { tangent_every: 5, reporting, ..DynamicSettings::new(2.0) };
        let pull = moved("right", Axis::X, 0.015, Amplitude::RAMP);
        let conditions = vec![pull, held("left", Axis::X), held("bottom", Axis::Y)];
        let problem = problem(strip(ElementKind::Q4, 1, 1.0), conditions, 60.0, settings);
        let film = completed(&problem, &mut DamageMaterial::new(vec![law; problem.point_count()]));
        let steps: Vec<f64> = film.instants.iter().map(|instant| instant.time_step).collect();
        let (least, most) =
            (steps.iter().copied().fold(f64::MAX, f64::min), steps.iter().copied().fold(0.0, f64::max));
        assert!(most > 1.2 * least && most < interval, "{least} {most}");
        let expected = (60.0 / interval - 1e-9).ceil() as usize + 1;
        assert_eq!(film.instants.len(), expected, "interval {interval}");
        for (number, instant) in film.instants[..expected - 1].iter().enumerate() {
            let late = instant.time - number as f64 * interval;
            assert!(late > -1e-6 * interval && late < 1.000_001 * most, "report {number}: {late}");
        }
    }
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
