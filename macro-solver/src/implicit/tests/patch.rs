//! H-1 and H-2: constant strain on distorted elements, rigid motion.

use super::*;
use crate::observer::Outcome;

/// Five irregular elements in the rectangle 0.24 x 0.12 (MacNeal and Harder 1985).
fn patch_mesh(kind: ElementKind) -> Mesh {
    let mut nodes = vec![
        [0.0, 0.0],
        [0.24, 0.0],
        [0.24, 0.12],
        [0.0, 0.12],
        [0.04, 0.02],
        [0.18, 0.03],
        [0.16, 0.08],
        [0.08, 0.08],
    ];
    let mut elements = vec![vec![0, 1, 5, 4], vec![1, 2, 6, 5], vec![2, 3, 7, 6], vec![3, 0, 4, 7], vec![4, 5, 6, 7]];
    if kind == ElementKind::Q8 {
        let mut middles: Vec<([usize; 2], usize)> = Vec::new();
        for element in &mut elements {
            for side in 0..4 {
                let mut ends = [element[side], element[(side + 1) % 4]];
                ends.sort_unstable();
                let found = middles.iter().find(|(known, _)| *known == ends).map(|(_, node)| *node);
                let node = found.unwrap_or_else(|| {
                    nodes.push([0, 1].map(|i| 0.5 * (nodes[ends[0]][i] + nodes[ends[1]][i])));
                    middles.push((ends, nodes.len() - 1));
                    nodes.len() - 1
                });
                element.push(node);
            }
        }
    }
    Mesh { nodes, elements, kind, node_sets: Default::default(), edge_sets: Default::default() }
}

fn boundary(mesh: &Mesh) -> Vec<usize> {
    let outer = |p: [f64; 2]| p[0] == 0.0 || p[0] == 0.24 || p[1] == 0.0 || p[1] == 0.12;
    (0..mesh.nodes.len()).filter(|&node| outer(mesh.nodes[node])).collect()
}

/// H-1. Boundary nodes follow an affine field; inner nodes must find it and the stress must be the law's.
#[test]
fn irregular_patches_reproduce_every_constant_strain() {
    let (bulk, shear) = plane_stress_moduli(1e6, 0.25);
    let modes = [[1e-3, 5e-4, 5e-4, 1e-3], [1e-3, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1e-3], [0.0, 1e-3, 0.0, 0.0]];
    for kind in [ElementKind::Q4, ElementKind::Q8] {
        for law in [ElasticLaw::SmallStrain, ElasticLaw::SaintVenant] {
            for h in modes {
                let mut problem = Problem::new(patch_mesh(kind), Vec::new());
                problem.control.increments = 2;
                problem.tolerances = Tolerances { force: 1e-12, displacement: 1e-12 };
                let field = |p: [f64; 2]| [h[0] * p[0] + h[1] * p[1], h[2] * p[0] + h[3] * p[1]];
                let nodes = boundary(&problem.mesh);
                prescribe_field(&mut problem, &nodes, field);
                let mut material = ElasticMaterial::new(law, bulk, shear, problem.point_count());
                let exact = material.stress(&nalgebra::Matrix2::new(1.0 + h[0], h[1], h[2], 1.0 + h[3]));
                let (run, record) = run(&problem, &mut material);
                assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
                for (node, moved) in record.displacements.iter().enumerate() {
                    let wanted = field(problem.mesh.nodes[node]);
                    assert!((moved[0] - wanted[0]).abs().max((moved[1] - wanted[1]).abs()) < 1e-10 * 1e-3 * 0.24);
                }
                for point in &record.points {
                    let stress = point.stress.plane();
                    for i in 0..2 {
                        for j in 0..2 {
                            assert!((stress[i][j] - exact[(i, j)]).abs() < 1e-10 * exact.norm(), "{kind:?} {law:?}");
                        }
                    }
                }
                if law == ElasticLaw::SmallStrain && h == modes[0] {
                    let stress = record.points[0].stress.plane();
                    assert!((stress[0][0] - 4000.0 / 3.0).abs() < 1e-7 && (stress[0][1] - 400.0).abs() < 1e-7);
                }
            }
        }
    }
}

/// H-2. A quarter turn in nine steps leaves no stress and no nodal force, Q8 hourglass modes included.
#[test]
fn a_quarter_turn_and_a_translation_leave_no_stress() {
    for kind in [ElementKind::Q4, ElementKind::Q8] {
        let mesh = patch_mesh(kind);
        let mut material = ElasticMaterial::new(ElasticLaw::SaintVenant, 2e7, 1e7, 4 * mesh.elements.len());
        let mut turned = mesh.clone();
        for step in 1..=9 {
            // A displacement that is linear in load cannot turn; so each step is its own problem on the turned mesh.
            let angle = f64::from(10 * step).to_radians();
            let (sin, cos) = angle.sin_cos();
            let goal = |p: [f64; 2]| [cos * p[0] - sin * p[1] + 0.01 * f64::from(step), sin * p[0] + cos * p[1]];
            let mut problem = Problem::new(turned.clone(), Vec::new());
            problem.control.increments = 1;
            problem.tolerances = Tolerances { force: 1e-6, displacement: 1e-12 };
            for node in boundary(&mesh) {
                let (from, to) = (turned.nodes[node], goal(mesh.nodes[node]));
                prescribe_field(&mut problem, &[node], |_| [to[0] - from[0], to[1] - from[1]]);
            }
            let (run, record) = run(&problem, &mut material);
            assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
            for (position, moved) in turned.nodes.iter_mut().zip(&record.displacements) {
                position[0] += moved[0];
                position[1] += moved[1];
            }
            let stress = record.points.iter().flat_map(|point| point.stress.0).fold(0.0, |a: f64, b| a.max(b.abs()));
            let force = record.reactions.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
            assert!(stress < 1e-10 * 2e7 && force < 1e-10 * 2e7 * 0.24, "{kind:?} {step}: {stress:e} {force:e}");
        }
        for (node, position) in turned.nodes.iter().enumerate() {
            let start = mesh.nodes[node];
            assert!((position[0] - (0.09 - start[1])).abs() + (position[1] - start[0]).abs() < 1e-12);
        }
    }
}
