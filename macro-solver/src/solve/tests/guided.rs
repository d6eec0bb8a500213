//! Displacements along normals and radii, and a prescribed tilt, against closed forms of linear elasticity.

use super::*;
use crate::formulation::Formulation;
use crate::mesh::geotechnical::Section;
use crate::mesh::ring::{Ring, RingPart};
use crate::observer::Outcome;
use crate::problem::relaxation::RelaxationSettings;
use crate::problem::{ConstraintTerm, Directions, MultiPointConstraint, Platen, ProblemError, Procedure};

/// Moduli of [`elastic`]: mean stress over areal strain, and shear, Pa.
const BULK: f64 = 2.0e7;
const SHEAR: f64 = 1.0e7;

fn guided(along: Directions, displacement: f64) -> Condition {
    Condition::MultiPointConstraint(MultiPointConstraint::Guided { along, displacement })
}

fn radial(nodes: &str, displacement: f64) -> Condition {
    guided(Directions::Radial { nodes: nodes.into(), centre: [0.0; 2] }, displacement)
}

fn normal(sides: &str, displacement: f64) -> Condition {
    guided(Directions::Normal { sides: sides.into() }, displacement)
}

fn solved(mesh: Mesh, conditions: Vec<Condition>) -> (Problem, Recorder) {
    let mut problem = Problem::new(mesh, conditions);
    problem.formulation = Formulation::SmallStrain;
    (problem.stages[0].control.increments, problem.stages[0].tolerances) = (2, TIGHT);
    problem.stages[0].strategy.capped_change = 1.0;
    let (run, record) = run(&problem, &mut elastic(ElasticLaw::SmallStrain, &problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    (problem, record)
}

/// Dynamic relaxation ends where Newton's method does, with every kind of link: a smooth oblique support, a platen that tilts freely and
/// one that is turned, a rigid head, periodic sides, a mean displacement.
#[test]
fn relaxation_with_links_ends_where_newtons_method_does() {
    let link = |link| Condition::MultiPointConstraint(link);
    let held = || [Axis::X, Axis::Y].map(|axis| Condition::fixed("bottom", axis));
    let pushed = || Condition::Traction { sides: "left".into(), value: [2e3, 0.0, 0.0] };
    let platen = |displacement, turned| {
        let rotation = [None, None, turned];
        link(MultiPointConstraint::TiltingPlaten { nodes: "top".into(), axis: Axis::Y, displacement, rotation })
    };
    let head = MultiPointConstraint::RigidBody {
        nodes: "top".into(),
        displacement: [None, Some(-1e-4), None],
        rotation: [None; 3],
    };
    let periodic = MultiPointConstraint::Periodic {
        from: "left".into(),
        to: "right".into(),
        jump: [Some(0.0), Some(0.0), None],
    };
    let mean = MultiPointConstraint::Sum {
        terms: vec![ConstraintTerm { nodes: "right".into(), axis: Axis::X, coefficient: 1.0 }],
        value: 1e-4,
    };
    let down = || Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -1e-4 };
    let cases = [
        ("normal", vec![pushed(), normal("right", 0.0), down()]),
        ("free platen", vec![pushed(), platen(Some(-1e-4), None)]),
        ("turned platen", vec![pushed(), platen(None, Some(1e-4))]),
        ("rigid head", vec![pushed(), link(head)]),
        ("periodic", vec![pushed(), down(), link(periodic)]),
        ("mean", vec![down(), link(mean)]),
    ];
    for (name, more) in cases {
        let solved = |procedure: Procedure| {
            let mut mesh = block(ElementKind::Q4, 2, 3);
            if name == "normal" {
                mesh.nodes.iter_mut().for_each(|node| node[0] += 0.2 * node[0] * node[1] / 3.0);
            }
            let mut problem = Problem::new(mesh, held().into_iter().chain(more.clone()).collect());
            problem.formulation = Formulation::SmallStrain;
            (problem.stages[0].control.increments, problem.stages[0].tolerances) = (2, Tolerances::both(1e-7, 1e-7));
            problem.stages[0].procedure = procedure;
            let (run, record) = run(&problem, &mut elastic(ElasticLaw::SmallStrain, &problem));
            assert!(matches!(run.outcome, Outcome::Completed), "{name}: {:?}", run.outcome);
            record
        };
        let relaxed = solved(Procedure::Relaxation(RelaxationSettings {
            kinetic_tolerance: 1e-10,
            ..RelaxationSettings::default()
        }));
        let newton = solved(Procedure::Implicit);
        let differences = relaxed.displacements.iter().flatten().zip(newton.displacements.iter().flatten());
        let largest = differences.fold(0.0, |largest: f64, (one, other)| largest.max((one - other).abs()));
        assert!(largest < 1e-8, "{name}: displacements differ by {largest:e} m of 1e-4");
        let forces = relaxed.reactions.iter().flatten().zip(newton.reactions.iter().flatten());
        let size = newton.reactions.iter().flatten().fold(0.0, |size: f64, force| size.max(force.abs()));
        let largest = forces.fold(0.0, |largest: f64, (one, other)| largest.max((one - other).abs()));
        assert!(largest < 1e-3 * size, "{name}: reactions differ by {largest:e} N of {size:e}");
    }
}

/// Lamé's ring, free outside: `u = A r + B / r` with `A = G B / (K b^2)`. The inner side is moved outwards by a given amount along the
/// radii, or along its normals, which point to the centre.
#[test]
fn a_ring_that_is_widened_inside_moves_as_lame_says() {
    let (inner, outer, moved) = (1.0, 2.0, 1e-4);
    let outward = |radius: f64| {
        let b = moved / (SHEAR * inner / (BULK * outer * outer) + 1.0 / inner);
        b * (SHEAR * radius / (BULK * outer * outer) + 1.0 / radius)
    };
    let held = |axis: &str, along: Axis| Condition::fixed(axis, along);
    for part in [RingPart::Quarter, RingPart::Half, RingPart::Whole] {
        for along_normals in [false, true] {
            let around = 8 * if part == RingPart::Quarter { 1 } else { 2 };
            let across = Section { length: outer - inner, cells: 6, grading: 1.5 };
            let thickness = Section::even(1.0, 1);
            let ring = Ring { inner, across, around, part, thickness, kind: ElementKind::Q8 };
            let widened = if along_normals { normal("inner", -moved) } else { radial("inner", moved) };
            let conditions = vec![held("axis_x", Axis::Y), held("axis_y", Axis::X), widened];
            let (problem, record) = solved(ring.mesh().unwrap(), conditions);
            // Normals of the first and last node are those of half a side: not exactly radial.
            let within = if along_normals { 5e-3 } else { 2e-3 };
            for (place, moved) in problem.mesh.nodes.iter().zip(&record.displacements) {
                let radius = place[0].hypot(place[1]);
                let found = (place[0] * moved[0] + place[1] * moved[1]) / radius;
                let exact = outward(radius);
                assert!((found / exact - 1.0).abs() < within, "{part:?} at {place:?}: {found:e} for {exact:e}");
            }
            // The sum of the forces along the radii is that of the pressure inside, 2 G B / a^2 - 2 K A, on the arc.
            let force: f64 = problem.mesh.node_sets["inner"]
                .iter()
                .map(|&node| {
                    let (place, force) = (problem.mesh.nodes[node], record.reactions[node]);
                    (place[0] * force[0] + place[1] * force[1]) / inner
                })
                .sum();
            let b = moved / (SHEAR * inner / (BULK * outer * outer) + 1.0 / inner);
            let pressure = 2.0 * SHEAR * b * (1.0 / (inner * inner) - 1.0 / (outer * outer));
            let quarters = [1.0, 2.0, 4.0][part as usize];
            let exact = pressure * inner * quarters * std::f64::consts::FRAC_PI_2;
            assert!((force / exact - 1.0).abs() < 2e-2, "{part:?}: {force:e} for {exact:e}");
        }
    }
}

/// A block that lies obliquely, held smoothly on two sides and pulled by the third along its normal: uniaxial stress.
#[test]
fn smooth_oblique_supports_leave_a_uniform_state() {
    let (angle, pulled) = (0.5_f64, 2e-4);
    let (sine, cosine) = angle.sin_cos();
    let mut mesh = block(ElementKind::Q8, 3, 2);
    for node in &mut mesh.nodes {
        let [x, y, _] = *node;
        (node[0], node[1]) = (cosine * x - sine * y, sine * x + cosine * y);
    }
    let conditions = vec![normal("left", 0.0), normal("bottom", 0.0), normal("right", pulled)];
    let (problem, record) = solved(mesh, conditions);
    // Along the block pulled / 3; across it the stress vanishes.
    let along = pulled / 3.0;
    let across = -along * (BULK - SHEAR) / (BULK + SHEAR);
    for (place, moved) in problem.mesh.nodes.iter().zip(&record.displacements) {
        let turned =
            |vector: &[f64; 3]| [cosine * vector[0] + sine * vector[1], -sine * vector[0] + cosine * vector[1]];
        let ([x, y], [u, v]) = (turned(place), turned(moved));
        assert!((u - along * x).abs() < 1e-7 * pulled.max(1e-4) + 1e-4 * pulled, "{u:e} at {x}");
        assert!((v - across * y).abs() < 1e-4 * pulled, "{v:e} at {y}");
    }
}

/// A smooth platen that is turned by a given angle bends the block between it and a smooth floor: `M = E I angle / height` with
/// `E = 4 K G / (K + G)`, the modulus of the plane.
#[test]
fn a_prescribed_tilt_bends_a_block_by_the_moment_of_the_beam() {
    let (width, height, angle) = (2.0_f64, 4.0, 1e-5);
    for (axis, sign) in [(Axis::Y, 1.0), (Axis::X, -1.0)] {
        let (mesh, floor, head, corner, across) = match axis {
            Axis::Y => (block(ElementKind::Q8, 2, 4), "bottom", "top", "bottom_left", Axis::X),
            _ => (block(ElementKind::Q8, 4, 2), "left", "right", "bottom_left", Axis::Y),
        };
        let platen = MultiPointConstraint::TiltingPlaten {
            nodes: head.into(),
            axis,
            displacement: Some(0.0),
            rotation: [None, None, Some(angle)],
        };
        let conditions = vec![
            Condition::Platen { nodes: floor.into(), contact: Platen::Smooth, axis, displacement: 0.0 },
            Condition::fixed(corner, across),
            Condition::MultiPointConstraint(platen),
        ];
        let (problem, record) = solved(mesh, conditions);
        let mut moment = 0.0;
        for &node in &problem.mesh.node_sets[head] {
            let arm = problem.mesh.nodes[node][across.index()] - 0.5 * width;
            let moved = record.displacements[node][axis.index()];
            assert!((moved - sign * angle * arm).abs() < 1e-15, "{axis:?}: {moved:e} at {arm}");
            moment += sign * arm * record.reactions[node][axis.index()];
        }
        let modulus = 4.0 * BULK * SHEAR / (BULK + SHEAR);
        let exact = modulus * width.powi(3) / 12.0 * angle / height;
        assert!((moment / exact - 1.0).abs() < 1e-4, "{axis:?}: {moment:e} for {exact:e}");
    }
}

#[test]
fn directions_and_rotations_that_do_not_exist_are_refused() {
    let refused = |condition: Condition| {
        let mesh = block(ElementKind::Q4, 2, 2);
        let held = [Axis::X, Axis::Y].map(|axis| Condition::fixed("bottom", axis));
        let problem = Problem::new(mesh, held.into_iter().chain([condition]).collect());
        problem.validate().unwrap_err().into_cause()
    };
    let at_centre = Directions::Radial { nodes: "top".into(), centre: [1.0, 2.0] };
    match refused(guided(at_centre, 1e-3)) {
        ProblemError::NoDirection { place, .. } => assert_eq!(place[..2], [1.0, 2.0]),
        other => panic!("{other:?}"),
    }
    assert!(matches!(refused(normal("nowhere", 0.0)), ProblemError::UnknownSideSet { .. }));
    let turned = |rotation| {
        let (nodes, displacement) = ("top".into(), None);
        refused(Condition::MultiPointConstraint(MultiPointConstraint::TiltingPlaten {
            nodes,
            axis: Axis::Y,
            displacement,
            rotation,
        }))
    };
    assert_eq!(turned([Some(1e-3), None, None]), ProblemError::NoThirdAxis);
    let about_normal = turned([None, Some(1e-3), None]).to_string();
    assert!(about_normal.contains("about its normal"), "{about_normal}");
}
