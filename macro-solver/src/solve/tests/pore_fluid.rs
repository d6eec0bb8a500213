//! Pore fluid that cannot drain, on an elastic skeleton: against the closed form of biaxial compression.

use super::*;
use crate::formulation::Formulation;
use crate::observer::Outcome;
use crate::problem::{Applied, Platen, PoreFluid, PressureKind};
use nalgebra::Matrix3;

const BULK_MODULUS: f64 = 3e9;

/// Compression by 3 % with open pores, then by 4 % more with closed ones.
fn problem(formulation: Formulation) -> Problem {
    let side =
        |sides: &str| Condition::Pressure { sides: sides.into(), value: CONFINEMENT, kind: PressureKind::Follower };
    let head = |displacement: f64| Condition::Platen {
        nodes: "top".into(),
        contact: Platen::Smooth,
        axis: Axis::Y,
        displacement,
    };
    let mut problem = Problem::new(
        block(ElementKind::Q8, 2, 3),
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
            head(-0.09),
            side("left"),
            side("right"),
        ],
    );
    let mut closed = problem.stages[0].clone();
    closed.name = "closed".into();
    closed.conditions[2] = Applied::from(head(-0.12));
    problem.stages.push(closed);
    for stage in &mut problem.stages {
        stage.control.increments = 4;
        stage.tolerances = TIGHT;
    }
    problem.formulation = formulation;
    problem.pore_fluid = Some(PoreFluid { bulk_modulus: BULK_MODULUS, from_stage: 1 });
    problem
}

/// Lateral stretch at which skeleton and fluid together balance the pressure at the sides; `volume`: that at which the fluid has no
/// pressure, `None` for open pores.
fn lateral_stretch(material: &ElasticMaterial, axial: f64, volume: Option<f64>) -> f64 {
    stretch_in_balance(|lateral| {
        let skeleton = material.stress(&Matrix3::from_diagonal(&[lateral, axial, 1.0].into()))[(0, 0)];
        let fluid = volume.map_or(0.0, |volume| BULK_MODULUS * (lateral * axial / volume).ln());
        skeleton + fluid + CONFINEMENT
    })
}

#[test]
fn closed_pores_carry_what_the_skeleton_does_not() {
    // The rate form is accurate to the second order of the step.
    let formulations = [
        (Formulation::UpdatedLagrangian, 1e-7),
        (Formulation::TotalLagrangian, 1e-7),
        (Formulation::Corotational, 2e-3),
    ];
    for (formulation, tolerance) in formulations {
        let problem = problem(formulation);
        let mut material = confined(&problem);
        let (run, record) = run(&problem, &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        let law = confined(&problem);
        let drained = 0.97 * lateral_stretch(&law, 0.97, None);
        let lateral = lateral_stretch(&law, 0.93, Some(drained));
        let pressure = -BULK_MODULUS * (lateral * 0.93 / drained).ln();
        assert!(pressure > 1e5, "the fluid takes part of the load: {pressure}");
        let exact = law.stress(&Matrix3::from_diagonal(&[lateral, 0.93, 1.0].into()));
        for point in &record.points {
            let found = point.pore_pressure.unwrap();
            assert!((found / pressure - 1.0).abs() < tolerance, "{formulation:?}: {found} for {pressure}");
            assert!((point.stress.get(1, 1) / exact[(1, 1)] - 1.0).abs() < tolerance);
        }
        let top: f64 = problem.mesh.node_sets["top"].iter().map(|&node| record.reactions[node][1]).sum();
        assert!((top / ((exact[(1, 1)] - pressure) * 2.0 * lateral) - 1.0).abs() < tolerance, "{top}");
        // Moduli that lacked a part of the fluid's would need tens of iterations.
        let most = record.steps.iter().map(|step| step.iterations).max().unwrap();
        assert!(most <= 6, "{most} iterations");
    }
}

/// With small strain the excess pressure is linear in the volume strain, and a sealed, confined body is as stiff as both together.
#[test]
fn small_strain_adds_the_stiffness_of_the_fluid() {
    let mut problem = problem(Formulation::SmallStrain);
    problem.stages.truncate(1);
    problem.pore_fluid = Some(PoreFluid { bulk_modulus: BULK_MODULUS, from_stage: 0 });
    let sides = ["left", "right"].map(|side| Applied::from(Condition::fixed(side, Axis::X)));
    problem.stages[0].conditions.truncate(3);
    problem.stages[0].conditions.extend(sides);
    let (run, record) = run(&problem, &mut elastic(ElasticLaw::SmallStrain, &problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    for point in &record.points {
        assert!((point.pore_pressure.unwrap() / (0.03 * BULK_MODULUS) - 1.0).abs() < 1e-9);
    }
    assert!(record.steps.iter().all(|step| step.iterations <= 2));
    // Per initial volume, of 2 x 3 m.
    let energy = 0.5 * BULK_MODULUS * 0.03f64.powi(2) * 6.0;
    assert!((record.fluid_energy / energy - 1.0).abs() < 1e-9, "{} for {energy} J", record.fluid_energy);
}

/// Where forces balance loosely, what is left of an error is mostly that of the pore pressure; it counts in the error that is stated.
#[test]
fn the_stated_error_of_the_balance_is_that_of_the_total_stress() {
    let mut loose = problem(Formulation::SmallStrain);
    loose.stages[1].control.increments = 1;
    let tight = loose.clone();
    loose.stages[1].tolerances = Tolerances::both(0.5, 1e9);
    let mean = |problem: &Problem| {
        let (run, record) = run(problem, &mut elastic(ElasticLaw::SmallStrain, problem));
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        let of = |point: &PointFields| point.stress.get(0, 0) - point.pore_pressure.unwrap();
        let lateral = record.points.iter().map(of).sum::<f64>() / record.points.len() as f64;
        let balance = record.steps.last().unwrap().accuracy.balance.unwrap();
        (lateral, balance, run.statistics.largest_pressure)
    };
    let ((exact, ..), (found, balance, pressure)) = (mean(&tight), mean(&loose));
    let error = (found - exact).abs() / pressure;
    assert!(error > 1e-3, "the balance is loose: {error}");
    // Stated of the mean tensor, whose three direct components share the pressure of the fluid.
    let stated = balance.of_mean / 3.0_f64.sqrt();
    assert!((0.7..1.4).contains(&(stated / error)), "{stated} stated, {error} found");
}
