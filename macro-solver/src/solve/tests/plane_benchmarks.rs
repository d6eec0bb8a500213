//! H-3 and H-5 to H-7: plane problems with exact or published answers, on meshes small enough for every run.

use super::*;
use crate::element::{node_places, shape};
use crate::formulation::Formulation;
use crate::formulation::tensor::matrix;
use crate::observer::Outcome;
use claims::Claim;
use nalgebra::Matrix3;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// A block mapped from the unit square.
fn mapped(kind: ElementKind, elements: [usize; 2], grading: [f64; 2], map: impl Fn(f64, f64) -> [f64; 2]) -> Mesh {
    let mut block = Block::plane([1.0, 1.0], elements, kind);
    block.grading = [grading[0], grading[1], 1.0];
    let mut mesh = block.mesh().unwrap();
    for node in &mut mesh.nodes {
        let [x, y] = map(node[0], node[1]);
        *node = [x, y, 0.0];
    }
    mesh.validate().unwrap();
    mesh
}

/// Linear elasticity with a two-dimensional bulk and shear modulus.
fn solve_linear(mesh: Mesh, conditions: Vec<Condition>, bulk: f64, shear: f64) -> (Problem, Recorder) {
    let mut problem = Problem::new(mesh, conditions);
    problem.formulation = Formulation::SmallStrain;
    problem.stages[0].strategy.tangent_floor = None;
    problem.stages[0].strategy.capped_change = 1e3;
    problem.stages[0].control.increments = 1;
    problem.stages[0].tolerances = Tolerances::both(1e-8, 1e-8);
    let mut material = ElasticMaterial::new(ElasticLaw::SmallStrain, bulk, shear, problem.point_count());
    let (run, record) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    (problem, record)
}

/// Stress at a node: bilinear extrapolation from the 2x2 points of each of its quadrilaterals, averaged.
fn nodal_stress(problem: &Problem, record: &Recorder, node: usize) -> Matrix3<f64> {
    let firsts = problem.mesh.first_points();
    let mut stresses = Vec::new();
    for (element, nodes) in problem.mesh.elements.iter().enumerate() {
        let Some(local) = nodes.iter().position(|&one| one == node) else { continue };
        // The points are the corners of a square that is smaller by sqrt(3).
        let place = node_places(ElementKind::Q8)[local].map(|x| x * 3f64.sqrt());
        let weights = shape(ElementKind::Q4, place).values;
        let points = &record.points[firsts[element]..firsts[element + 1]];
        stresses.push(points.iter().zip(&weights).map(|(p, w)| matrix(&p.stress) * *w).sum::<Matrix3<f64>>());
    }
    stresses.iter().sum::<Matrix3<f64>>() / stresses.len() as f64
}

/// H-3. Cook's membrane, E = 1, nu = 1/3: deflection of the middle of the right side and of its upper corner.
fn cook(kind: ElementKind, count: usize) -> [f64; 2] {
    let mesh =
        mapped(kind, [count, count], [1.0; 2], |along, up| [48.0 * along, 44.0 * along + up * (44.0 - 28.0 * along)]);
    let right = mesh.node_sets["right"].clone();
    let upper_corner = mesh.node_sets["top_right"][0];
    let conditions = vec![
        Condition::fixed("left", Axis::X),
        Condition::fixed("left", Axis::Y),
        Condition::Traction { sides: "right".into(), value: [0.0, 1.0 / 16.0, 0.0] },
    ];
    let (bulk, shear) = plane_stress_moduli(1.0, 1.0 / 3.0);
    let (_, record) = solve_linear(mesh, conditions, bulk, shear);
    let corner = record.displacements[upper_corner][1];
    [record.displacements[right[right.len() / 2]][1], corner]
}

const COOK_MESH_BY_MESH: &str = "deflection of Cook's membrane, Q4 on five meshes";

/// The converged deflection is 23.966 with an uncertainty of 0.002.
#[test]
fn cook_membrane_is_met_by_every_plane_element() {
    let quadratic = "converged deflection of Cook's membrane, quadratic elements, 16 a side";
    let single = "converged deflection of Cook's membrane, one-point Q4, 16 a side";
    for (kind, count, exact, tolerance, quantity) in [
        (ElementKind::Q4, 8, 22.079, 1e-4, COOK_MESH_BY_MESH),
        (ElementKind::Q4, 16, 23.430, 1e-4, COOK_MESH_BY_MESH),
        (ElementKind::Q8, 16, 23.966, 2e-3, quadratic),
        (ElementKind::Q8Full, 16, 23.966, 2e-3, quadratic),
        (ElementKind::T6, 16, 23.966, 2e-3, quadratic),
        (ElementKind::Q4Single, 16, 23.966, 2e-2, single),
    ] {
        let [found, _] = cook(kind, count);
        Claim::of("H-3", quantity).value(found, exact).within(tolerance);
    }
}

/// The middle and the corner on finer meshes of Q4, against an independent code on the same meshes.
#[test]
fn cook_membrane_is_met_mesh_by_mesh() {
    for (count, middle, corner) in [(32, 23.818, Some(24.837)), (64, 23.925, Some(25.043)), (128, 23.955, None)] {
        let [found, at_corner] = cook(ElementKind::Q4, count);
        Claim::of("H-3", COOK_MESH_BY_MESH).value(found, middle).within(1e-4);
        if let Some(exact) = corner {
            let quantity = "deflection of the corner of Cook's membrane, Q4, 32 and 64 a side";
            Claim::of("H-3", quantity).value(at_corner, exact).within(1e-4);
        }
    }
}

/// H-5. A ring under inner pressure, two-dimensional moduli: `u = A r / 2K + B / 2G r`, `sigma = A -+ B / r^2`.
#[test]
fn lame_ring_has_its_exact_field() {
    let (inner, outer, pressure, bulk, shear) = (1.0, 2.0, 3.0, 2e3, 1e3);
    let map = |radial: f64, turn: f64| {
        let (sin, cos) = (turn * FRAC_PI_2).sin_cos();
        let radius = inner + (outer - inner) * radial;
        [radius * cos, radius * sin]
    };
    let mesh = mapped(ElementKind::Q8, [6, 8], [1.0; 2], map);
    let conditions = vec![
        Condition::fixed("bottom", Axis::Y),
        Condition::fixed("top", Axis::X),
        Condition::Pressure { sides: "left".into(), value: pressure, kind: crate::problem::PressureKind::Dead },
    ];
    let (problem, record) = solve_linear(mesh, conditions, bulk, shear);
    let mean = pressure * inner * inner / (outer * outer - inner * inner);
    let ring = mean * outer * outer;
    for (place, moved) in problem.mesh.nodes.iter().zip(&record.displacements) {
        let radius = place[0].hypot(place[1]);
        let exact = mean * radius / (2.0 * bulk) + ring / (2.0 * shear * radius);
        let found = (moved[0] * place[0] + moved[1] * place[1]) / radius;
        Claim::of("H-5", "radial displacement of every node, m").value(found, exact).within(5e-3);
    }
    for point in &record.points {
        let place = point.initial_position;
        let radius = place[0].hypot(place[1]);
        let normal = nalgebra::Vector3::new(place[0] / radius, place[1] / radius, 0.0);
        let radial = (normal.transpose() * matrix(&point.stress) * normal)[(0, 0)];
        let exact = mean - ring / (radius * radius);
        let error = (radial - exact) / (ring / (inner * inner));
        Claim::of("H-5", "radial stress of every point, over the largest deviator").error(error).within(5e-3);
    }
}

/// H-6. A small hole in a wide plate under tension: three times the stress at its side.
#[test]
fn kirsch_hole_concentrates_the_stress_threefold() {
    let (hole, width) = (1.0, 40.0);
    // One half of the quarter plate on either side of the diagonal.
    let map = |out: f64, turn: f64| {
        let angle = turn * FRAC_PI_2;
        let (sin, cos) = angle.sin_cos();
        let far = if angle <= FRAC_PI_4 { width / cos } else { width / sin };
        let radius = hole + (far - hole) * out;
        [radius * cos, radius * sin]
    };
    let mut mesh = mapped(ElementKind::Q8, [16, 12], [60.0, 1.0], map);
    // The outer side turns from the right to the upper edge of the plate at the diagonal.
    let upper = |side: &crate::mesh::Side| mesh.side_nodes(*side).iter().all(|&n| mesh.nodes[n][1] > width - 1e-9);
    let pulled = mesh.side_sets["right"].iter().copied().filter(upper).collect();
    mesh.side_sets.insert("pulled".into(), pulled);
    let conditions = vec![
        Condition::fixed("bottom", Axis::Y),
        Condition::fixed("top", Axis::X),
        Condition::Traction { sides: "pulled".into(), value: [0.0, 1.0, 0.0] },
    ];
    let (problem, record) = solve_linear(mesh, conditions, 2e3, 1e3);
    let stress = nodal_stress(&problem, &record, problem.mesh.node_sets["bottom_left"][0]);
    Claim::of("H-6", "stress at the side of the hole over the tension").value(stress[(1, 1)], 3.0).within(0.02);
}

/// H-7. NAFEMS LE1: elliptic membrane under outward pressure; stress along y where the inner ellipse meets the x axis.
#[test]
fn elliptic_membrane_has_the_published_stress() {
    let map = |out: f64, turn: f64| {
        let (sin, cos) = (turn * FRAC_PI_2).sin_cos();
        [(2.0 + 1.25 * out) * cos, (1.0 + 1.75 * out) * sin]
    };
    let mesh = mapped(ElementKind::Q8, [10, 16], [3.0, 1.0], map);
    let conditions = vec![
        Condition::fixed("bottom", Axis::Y),
        Condition::fixed("top", Axis::X),
        Condition::Pressure { sides: "right".into(), value: -10.0e6, kind: crate::problem::PressureKind::Dead },
    ];
    let (bulk, shear) = plane_stress_moduli(210e9, 0.3);
    let (problem, record) = solve_linear(mesh, conditions, bulk, shear);
    let stress = nodal_stress(&problem, &record, problem.mesh.node_sets["bottom_left"][0]);
    Claim::of("H-7", "stress along y at the inner ellipse, Pa").value(stress[(1, 1)], 92.7e6).within(0.02);
}
