//! Biaxial compression against its closed form, initial equilibrium, and systems that cannot be solved.

use super::*;
use crate::observer::Outcome;
use crate::problem::{Platen, PressureKind, ProblemError};

fn biaxial(kind: ElementKind, pressure: PressureKind) -> Problem {
    let side = |sides: &str| Condition::Pressure { sides: sides.into(), value: CONFINEMENT, kind: pressure };
    let mut problem = Problem::new(
        block(kind, 2, 3),
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
            Condition::Platen { nodes: "top".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: -0.3 },
            side("left"),
            side("right"),
        ],
    );
    problem.stages[0].control.increments = 5;
    problem.stages[0].tolerances = TIGHT;
    problem
}

/// Horizontal stretch at which the lateral stress balances the pressure, by bisection on the law itself.
fn lateral_stretch(material: &ElasticMaterial, axial: f64, pressure: PressureKind) -> f64 {
    stretch_in_balance(|lateral| {
        let stress = material.stress(&nalgebra::Matrix3::from_diagonal(&[lateral, axial, 1.0].into()))[(0, 0)];
        match pressure {
            PressureKind::Follower => stress + CONFINEMENT,
            PressureKind::Dead => stress * axial + CONFINEMENT,
        }
    })
}

#[test]
fn biaxial_compression_follows_its_closed_form_under_follower_and_dead_pressure() {
    for kind in [ElementKind::Q4, ElementKind::Q8] {
        for pressure in [PressureKind::Follower, PressureKind::Dead] {
            let problem = biaxial(kind, pressure);
            let mut material = confined(&problem);
            let (run, record) = run(&problem, &mut material);
            assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
            assert_eq!(record.steps.len(), 6);
            let lateral = lateral_stretch(&confined(&problem), 0.9, pressure);
            let exact = material.stress(&nalgebra::Matrix3::from_diagonal(&[lateral, 0.9, 1.0].into()));
            for point in &record.points {
                let (stress, total) = (point.stress.plane(), point.deformation.plane());
                assert!((stress[1][1] / exact[(1, 1)] - 1.0).abs() < 1e-8);
                assert!((stress[0][0] / exact[(0, 0)] - 1.0).abs() < 1e-8);
                assert!((total[0][0] - lateral).abs() < 1e-9 && total[0][1].abs() < 1e-9);
            }
            let top: f64 = problem.mesh.node_sets["top"].iter().map(|&node| record.reactions[node][1]).sum();
            assert!((top / (exact[(1, 1)] * 2.0 * lateral) - 1.0).abs() < 1e-8, "{top}");
        }
    }
}

#[test]
fn a_start_in_balance_is_accepted_untouched_and_one_out_of_balance_is_equilibrated_first() {
    let mut problem = biaxial(ElementKind::Q8, PressureKind::Follower);
    problem.stages[0].control.increments = 1;
    let (_, record) = run(&problem, &mut confined(&problem));
    assert_eq!((record.steps[0].step, record.steps[0].iterations, record.steps[0].load), (0, 0, 0.0));
    let mut slack = elastic(ElasticLaw::SaintVenant, &problem).with_initial_stress([
        [-0.9e6, 0.0, 0.0],
        [0.0, -1e6, 0.0],
        [0.0; 3],
    ]);
    let mut spy = Recorder::default();
    let outcome = solve(&problem, &mut slack, &mut spy).outcome;
    assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
    assert!(spy.steps[0].iterations > 0 && spy.steps[0].load == 0.0 && spy.steps[1].load == 1.0);
}

#[test]
fn an_unsupported_body_is_refused_by_name_and_lost_stiffness_ends_in_an_honest_failure() {
    let mut problem = biaxial(ElementKind::Q4, PressureKind::Follower);
    problem.stages[0].conditions.remove(0);
    let mut material = confined(&problem);
    let (refused, _) = run(&problem, &mut material);
    match refused.outcome {
        Outcome::Refused(ProblemError::RigidMotion { motion, .. }) => assert_eq!(motion, "move along x"),
        other => panic!("{other:?}"),
    }
    let mut problem = biaxial(ElementKind::Q4, PressureKind::Follower);
    problem.stages[0].conditions.truncate(3);
    let mut fluid = ElasticMaterial::new(ElasticLaw::SaintVenant, 0.0, 0.0, problem.point_count());
    let (failed, record) = run(&problem, &mut fluid);
    match failed.outcome {
        Outcome::DidNotConverge { reason } => assert!(reason.contains("singular"), "{reason}"),
        other => panic!("{other:?}"),
    }
    assert_eq!((failed.load, record.steps.len()), (0.0, 1));
}

#[test]
fn the_symbolic_factor_is_computed_once() {
    let problem = biaxial(ElementKind::Q8, PressureKind::Follower);
    let (finished, _) = run(&problem, &mut confined(&problem));
    assert_eq!(finished.statistics.symbolic_factorizations, 1);
    assert!(finished.statistics.numeric_factorizations > 5);
}
