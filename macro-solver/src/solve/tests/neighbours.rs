//! Averages over neighbours as the points are asked for them: through periodic faces, and with ramps as long as the averages.

use super::*;
use crate::formulation::Formulation;
use crate::model::points::Points;
use crate::nonlocal::NonlocalSettings;
use crate::observer::Statistics;
use crate::problem::dynamics::DynamicSettings;
use crate::problem::{MultiPointConstraint, Procedure};
use nalgebra::Matrix3;
use protocol::TangentKind;

const ELEMENTS: usize = 8;

/// Trials of a strip of which one point is strained by 1e-4, with one ramp step for each 1e-6.
fn trials_of(radius: f64, is_periodic: bool, strained: usize) -> Vec<PointTrial> {
    let mut problem = Problem::new(block(ElementKind::Q4Single, ELEMENTS, 1), Vec::new());
    problem.formulation = Formulation::Corotational;
    problem.strain_per_step = 1e-6;
    problem.stages[0].nonlocal = Some(NonlocalSettings { radius, ..NonlocalSettings::default() });
    problem.stages[0].procedure = Procedure::Dynamic(Box::new(DynamicSettings::new(1e3)));
    problem.stages[0].conditions.push(Condition::fixed("bottom", Axis::Y).into());
    if is_periodic {
        let link =
            MultiPointConstraint::Periodic { from: "left".into(), to: "right".into(), jump: [None, Some(0.0), None] };
        problem.stages[0].conditions.push(Condition::MultiPointConstraint(link).into());
    }
    problem.validate().unwrap();
    let mut points = Points::new(&problem);
    let mut gradients = vec![Matrix3::zeros(); ELEMENTS];
    gradients[strained][(1, 1)] = -1e-4;
    let mut spy = Spy::new(elastic(ElasticLaw::SmallStrain, &problem));
    points.fix_ramps(&gradients);
    points
        .evaluate(
            &gradients,
            TangentKind::None,
            &mut spy,
            &mut Statistics { evaluations_per_point: vec![0; ELEMENTS], ..Statistics::default() },
        )
        .unwrap();
    spy.trials.remove(0)
}

#[test]
fn averages_reach_through_periodic_faces() {
    let seen = |is_periodic, strained| {
        trials_of(1.5, is_periodic, strained).iter().map(|trial| trial.target.get(1, 1)).collect::<Vec<f64>>()
    };
    let (open, closed) = (seen(false, 0), seen(true, 0));
    assert!(open[1] < 0.0 && open[ELEMENTS - 1] == 0.0, "{open:?}");
    assert!((closed[ELEMENTS - 1] / closed[1] - 1.0).abs() < 1e-12, "{closed:?}");
    // Every point of a ring is an inner one.
    let inner = seen(true, 3);
    assert!(
        (closed[0] / inner[3] - 1.0).abs() < 1e-12 && (closed[1] / inner[4] - 1.0).abs() < 1e-12,
        "{closed:?} {inner:?}"
    );
    // A neighbourhood that is wider than the period meets the same points again.
    let whole: f64 = seen(true, 3).iter().sum();
    let wide: Vec<f64> = trials_of(40.0, true, 3).iter().map(|trial| trial.target.get(1, 1)).collect();
    assert!((wide.iter().sum::<f64>() / whole - 1.0).abs() < 1e-3, "an average keeps the sum: {wide:?}");
    assert!(wide.iter().all(|value| (value * 8.0 / whole - 1.0).abs() < 0.05), "{wide:?}");
}

/// A turn needs no ramp: two formulations keep it from the material, and a cell is turned as a whole after its stretch. A step that turned a
/// body by five degrees once took 87 times the increments of the same stretch without the turn.
#[test]
fn ramps_are_as_fine_as_the_strain_wants_them_however_far_a_point_turns() {
    let steps = |formulation: Formulation, gradient: Matrix3<f64>| {
        let mut problem = Problem::new(block(ElementKind::Q4Single, 1, 1), Vec::new());
        (problem.formulation, problem.strain_per_step) = (formulation, 1e-5);
        let mut points = Points::new(&problem);
        points.fix_ramps(&[gradient]);
        let mut spy = Spy::new(elastic(ElasticLaw::SmallStrain, &problem));
        let mut statistics = Statistics { evaluations_per_point: vec![0; 1], ..Statistics::default() };
        points.evaluate(&[gradient], TangentKind::None, &mut spy, &mut statistics).unwrap();
        spy.trials[0][0].options.ramp_steps
    };
    let (sine, cosine) = 0.05f64.sin_cos();
    let turn = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
    let stretch = Matrix3::from_diagonal(&[1.0, 0.999, 1.0].into());
    assert_eq!(steps(Formulation::Corotational, turn * stretch - Matrix3::identity()), 100);
    assert_eq!(steps(Formulation::Corotational, stretch - Matrix3::identity()), 100);
    for formulation in [Formulation::UpdatedLagrangian, Formulation::TotalLagrangian] {
        assert_eq!(steps(formulation, turn * stretch - Matrix3::identity()), 100);
        assert_eq!(steps(formulation, stretch - Matrix3::identity()), 100);
        // Simple shear strains by half its amount, and turns by the other half.
        assert_eq!(steps(formulation, Matrix3::new(0.0, 2e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 100);
    }
    let spin = Matrix3::new(0.0, -0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0);
    assert_eq!(steps(Formulation::SmallStrain, spin + stretch - Matrix3::identity()), 100);
}

#[test]
fn ramps_are_as_fine_as_the_averages_want_them() {
    for trial in trials_of(2.5, false, 3) {
        let largest = trial.target.0.iter().fold(0.0f64, |most, value| most.max(value.abs()));
        let per_step = largest / f64::from(trial.options.ramp_steps);
        assert!(per_step <= 1.5e-6, "point {}: {per_step:e} in a ramp step", trial.point);
        assert!(
            trial.options.ramp_steps == 1 || per_step > 0.6e-6,
            "point {}: {} steps",
            trial.point,
            trial.options.ramp_steps
        );
    }
}
