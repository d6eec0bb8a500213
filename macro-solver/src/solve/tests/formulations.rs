//! The formulations against each other and against closed forms, in the plane and in space.

use super::*;
use crate::element::hourglass::HourglassControl;
use crate::formulation::Formulation;
use crate::formulation::tensor::matrix;
use crate::observer::Outcome;
use crate::problem::{Platen, PressureKind};
use claims::Claim;
use nalgebra::Matrix3;

/// A distorted block, compressed by a fifth under a confining pressure.
fn squeezed(kind: ElementKind, formulation: Formulation, increments: usize) -> Problem {
    let mut mesh = match kind.dimension() {
        Dimension::Plane => block(kind, 2, 2),
        Dimension::Space => Block::space([2.0, 2.0, 1.0], [2, 2, 1], kind).mesh().unwrap(),
    };
    let top = mesh.node_sets["top"].clone();
    for (number, node) in mesh.nodes.iter_mut().enumerate() {
        if !kind.is_quadratic() && node[1] > 0.0 && !top.contains(&number) {
            node[0] += 0.06 * (number as f64 * 1.7).sin();
            node[1] += 0.06 * (number as f64 * 2.9).cos();
        }
    }
    let mut conditions = vec![
        Condition::fixed("bottom", Axis::Y),
        Condition::fixed("bottom_left", Axis::X),
        Condition::Platen { nodes: "top".into(), contact: Platen::Rough, axis: Axis::Y, displacement: -0.4 },
        Condition::Pressure { sides: "right".into(), value: 2.0e6, kind: PressureKind::Follower },
    ];
    if mesh.dimension == Dimension::Space {
        conditions.push(Condition::fixed("bottom_back", Axis::Z));
    }
    let mut problem = Problem::new(mesh, conditions);
    problem.formulation = formulation;
    problem.hourglass = HourglassControl::Stiffness { coefficient: 0.2 };
    problem.stages[0].control.increments = increments;
    problem.stages[0].strategy.tangent_floor = None;
    problem.stages[0].strategy.capped_change = 1.0;
    problem.stages[0].tolerances = TIGHT;
    problem
}

fn solved(problem: &Problem) -> Recorder {
    let (run, record) = run(problem, &mut elastic(ElasticLaw::SaintVenant, problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?} {:?}", problem.formulation, run.outcome);
    record
}

fn distance(one: &Recorder, other: &Recorder) -> f64 {
    let pairs = one.displacements.as_flattened().iter().zip(other.displacements.as_flattened());
    pairs.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
}

/// Total Lagrangian and updated forms are the same equations: displacements and Cauchy stresses agree to round-off.
#[test]
fn total_lagrangian_and_updated_forms_agree() {
    for kind in [ElementKind::Q8, ElementKind::H8, ElementKind::T10, ElementKind::H8Single] {
        let total = solved(&squeezed(kind, Formulation::TotalLagrangian, 4));
        let updated = solved(&squeezed(kind, Formulation::UpdatedLagrangian, 4));
        assert!(distance(&total, &updated) < 1e-10, "{kind:?}: {:e}", distance(&total, &updated));
        for (one, other) in total.points.iter().zip(&updated.points) {
            assert!((matrix(&one.stress) - matrix(&other.stress)).amax() < 1e-8 * 1e7);
        }
    }
}

/// The midpoint rule of the corotational form: its answer approaches that of the total forms with the square of the
/// step. The law is driven by increments, so the limit is hypoelastic: compared with itself at a fine step.
#[test]
fn the_corotational_form_is_second_order_in_the_step() {
    let at = |increments| solved(&squeezed(ElementKind::Q4, Formulation::Corotational, increments));
    let fine = at(160);
    let errors = [10, 20].map(|increments| distance(&at(increments), &fine));
    let order = (errors[0] / errors[1]).log2();
    assert!((1.8..2.3).contains(&order), "{errors:?} order {order}");
}

/// For small strains and rotations all formulations are linear elasticity.
#[test]
fn all_formulations_agree_for_small_strains() {
    let run = |formulation| {
        let mut problem = squeezed(ElementKind::Q8, formulation, 2);
        for condition in &mut problem.stages[0].conditions {
            match &mut condition.condition {
                Condition::Platen { displacement, .. } => *displacement *= 1e-5,
                Condition::Pressure { value, .. } => *value *= 1e-5,
                _ => {}
            }
        }
        solved(&problem)
    };
    let updated = run(Formulation::UpdatedLagrangian);
    for formulation in Formulation::ALL {
        let error = distance(&run(formulation), &updated) / 4e-6;
        assert!(error < 1e-4, "{formulation:?}: {error:e}");
    }
}

/// I-8. Compression while the body turns by a quarter: the corotational form gives, in the frame of the material,
/// the stress of the unturned path.
#[test]
fn rotation_superposed_on_compression_leaves_the_stress_in_the_material_frame() {
    use crate::formulation::tensor::tensor;
    use crate::material::PointMaterial;
    use protocol::TrialOptions;
    let steps = 200;
    let stretch = |share: f64| Matrix3::from_diagonal(&[1.0 + 0.03 * share, 1.0 - 0.1 * share, 1.0].into());
    let deformation = |share: f64, turn: f64| {
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), share * turn);
        turn.matrix() * stretch(share)
    };
    let path = |formulation: Formulation, turn: f64| {
        let mut material = ElasticMaterial::new(ElasticLaw::SaintVenant, 2.0e7, 1.0e7, 1).with_initial_stress([
            [-1e6, 0.0, 0.0],
            [0.0, -1e6, 0.0],
            [0.0; 3],
        ]);
        let mut stress = Matrix3::zeros();
        for step in 0..steps {
            let [before, after] = [step, step + 1].map(|step| deformation(f64::from(step) / f64::from(steps), turn));
            let gradient = after * before.try_inverse().unwrap() - Matrix3::identity();
            let target = tensor(&formulation.target(&before, &gradient).unwrap());
            let trial = PointTrial { point: 0, target, options: TrialOptions::default() };
            let answer = matrix(&material.evaluate(&[trial]).unwrap()[0].stress);
            material.commit().unwrap();
            stress = formulation.cauchy(&before, &gradient, &answer).unwrap();
        }
        stress
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), quarter);
    let driven = path(Formulation::UpdatedLagrangian, 0.0);
    for (formulation, what) in
        [(Formulation::UpdatedLagrangian, "updated Lagrangian"), (Formulation::Corotational, "corotational")]
    {
        let turned = turn.matrix().transpose() * path(formulation, quarter) * turn.matrix();
        let error = (turned - driven).amax() / driven.amax();
        let quantity = format!("{what} stress after a quarter turn in 200 steps");
        Claim::of("I-8", &quantity).error(error).within(1e-4);
    }
    // Without a rotation the midpoint strain is undone exactly.
    let error = (path(Formulation::Corotational, 0.0) - driven).amax() / driven.amax();
    Claim::of("I-8", "corotational stress without a turn").error(error).within(1e-12);
}

/// Uniaxial compression of a cube in space against the law itself, traction-free sides found by bisection.
#[test]
fn a_compressed_solid_follows_its_closed_form() {
    for kind in [ElementKind::H8, ElementKind::H8Single, ElementKind::H20, ElementKind::T4, ElementKind::T10] {
        let mesh = Block::space([1.0, 2.0, 1.0], [2, 2, 2], kind).mesh().unwrap();
        let conditions = vec![
            Condition::fixed("left", Axis::X),
            Condition::fixed("back", Axis::Z),
            Condition::fixed("bottom", Axis::Y),
            Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -0.3 },
        ];
        let mut problem = Problem::new(mesh, conditions);
        problem.stages[0].control.increments = 3;
        problem.stages[0].strategy.capped_change = 1.0;
        problem.stages[0].tolerances = TIGHT;
        let mut material = ElasticMaterial::spatial(ElasticLaw::SaintVenant, 2.0e7, 1.0e7, problem.point_count());
        let law = material.clone();
        let (run, record) = run(&problem, &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {:?}", run.outcome);
        let (mut low, mut high) = (1.0, 1.2);
        for _ in 0..100 {
            let middle: f64 = 0.5 * (low + high);
            let stress = law.stress(&Matrix3::from_diagonal(&[middle, 0.85, middle].into()));
            if stress[(0, 0)] < 0.0 { low = middle } else { high = middle }
        }
        let exact = law.stress(&Matrix3::from_diagonal(&[low, 0.85, low].into()));
        for point in &record.points {
            assert!((matrix(&point.stress) - exact).amax() < 1e-8 * exact.amax(), "{kind:?}");
        }
        let top: f64 = problem.mesh.node_sets["top"].iter().map(|&node| record.reactions[node][1]).sum();
        assert!((top / (exact[(1, 1)] * low * low) - 1.0).abs() < 1e-8, "{kind:?}: {top}");
    }
}

/// The iterative way to solve the global equations changes nothing but round-off, and is really taken.
#[test]
fn the_iterative_equations_give_the_same_body() {
    let mut problem = squeezed(ElementKind::H8, Formulation::UpdatedLagrangian, 2);
    let direct = solved(&problem);
    problem.equations = crate::problem::EquationSolver::Iterative;
    let (run, iterative) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert!(distance(&direct, &iterative) < 1e-9, "{:e}", distance(&direct, &iterative));
    assert!(run.statistics.linear_iterations > 0 && run.statistics.direct_fallbacks == 0);
    assert_eq!(run.statistics.symbolic_factorizations, 0);
}
