//! H-1 and H-2: constant strain on distorted elements, rigid motion.

use super::*;
use crate::element::node_places;
use crate::formulation::tensor::matrix;
use crate::observer::Outcome;
use claims::Claim;
use nalgebra::{Matrix3, Vector3};

/// Corners of the five irregular elements in the rectangle 0.24 x 0.12 (MacNeal and Harder 1985).
const PLANE_CORNERS: [[f64; 2]; 8] =
    [[0.0, 0.0], [0.24, 0.0], [0.24, 0.12], [0.0, 0.12], [0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08]];
const PLANE_ELEMENTS: [[usize; 4]; 5] = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]];

/// Inner corners of the seven irregular elements in the unit cube (MacNeal and Harder 1985), in the order of the
/// corners of a hexahedron; the outer ones are the cube's.
const INNER_CORNERS: [[f64; 3]; 8] = [
    [0.249, 0.342, 0.192],
    [0.826, 0.288, 0.288],
    [0.850, 0.649, 0.263],
    [0.273, 0.750, 0.230],
    [0.320, 0.186, 0.643],
    [0.677, 0.305, 0.683],
    [0.788, 0.693, 0.644],
    [0.165, 0.745, 0.702],
];

/// An irregular patch of one kind of elements.
fn patch_mesh(kind: ElementKind) -> Mesh {
    let (mut nodes, cells) = match kind.dimension() {
        Dimension::Plane => {
            let nodes: Vec<[f64; 3]> = PLANE_CORNERS.iter().map(|&[x, y]| [x, y, 0.0]).collect();
            (nodes, PLANE_ELEMENTS.iter().map(|corners| corners.to_vec()).collect::<Vec<_>>())
        }
        Dimension::Space => {
            let outer = node_places(ElementKind::H8).iter().map(|place| place.map(|x| 0.5 + 0.5 * x));
            let mut cells: Vec<Vec<usize>> = (0..6)
                .map(|face| {
                    let outside = ElementKind::H8.side(face);
                    // Seen from outside a face runs counter-clockwise; a cell's first face is seen from inside.
                    let base = outside.iter().rev();
                    base.clone().copied().chain(base.map(|node| node + 8)).collect()
                })
                .collect();
            cells.push((8..16).collect());
            (outer.chain(INNER_CORNERS).collect(), cells)
        }
    };
    let mut elements: Vec<Vec<usize>> = cells.iter().flat_map(|cell| cut(kind, cell)).collect();
    let mut middles: Vec<([usize; 2], usize)> = Vec::new();
    for element in &mut elements {
        for &[from, to] in kind.middles() {
            let mut ends = [element[from], element[to]];
            ends.sort_unstable();
            let found = middles.iter().find(|(known, _)| *known == ends).map(|(_, node)| *node);
            let node = found.unwrap_or_else(|| {
                nodes.push(std::array::from_fn(|i| 0.5 * (nodes[ends[0]][i] + nodes[ends[1]][i])));
                middles.push((ends, nodes.len() - 1));
                nodes.len() - 1
            });
            element.push(node);
        }
    }
    Mesh::uniform(kind, nodes, elements)
}

/// Corners of the elements of `kind` that fill a quadrilateral or hexahedron. Tetrahedra have all their diagonals
/// through the corners of smallest number of every face, so that neighbours fit.
fn cut(kind: ElementKind, cell: &[usize]) -> Vec<Vec<usize>> {
    let pick = |locals: [usize; 3]| locals.iter().map(|&local| cell[local]).collect::<Vec<_>>();
    match (kind.dimension(), kind.corner_count()) {
        (Dimension::Plane, 3) => vec![pick([0, 1, 2]), pick([0, 2, 3])],
        (Dimension::Space, 4) => {
            // Pyramids from the corner of smallest number over the faces that do not touch it.
            let apex = *cell.iter().min().expect("a cell has corners");
            let far =
                (0..6).map(|face| ElementKind::H8.side(face).iter().map(|&local| cell[local]).collect::<Vec<_>>());
            far.filter(|face| !face.contains(&apex))
                .flat_map(|face| {
                    let low = (0..4).min_by_key(|&corner| face[corner]).expect("four corners");
                    let corner = |step: usize| face[(low + step) % 4];
                    // Outward counter-clockwise faces are clockwise seen from the apex inside.
                    [[corner(0), corner(2), corner(1), apex], [corner(0), corner(3), corner(2), apex]]
                })
                .map(|tetrahedron| tetrahedron.to_vec())
                .collect()
        }
        _ => vec![cell.to_vec()],
    }
}

fn boundary(mesh: &Mesh) -> Vec<usize> {
    let size: &[f64] = match mesh.dimension {
        Dimension::Plane => &[0.24, 0.12],
        Dimension::Space => &[1.0; 3],
    };
    let outer = |p: &[f64; 3]| size.iter().zip(p).any(|(size, x)| *x == 0.0 || x == size);
    (0..mesh.nodes.len()).filter(|&node| outer(&mesh.nodes[node])).collect()
}

/// Young's modulus 1e6 Pa, Poisson's ratio 0.25: plane stress in the plane.
fn patch_material(law: ElasticLaw, mesh: &Mesh) -> ElasticMaterial {
    match mesh.dimension {
        Dimension::Plane => {
            let (bulk, shear) = plane_stress_moduli(1e6, 0.25);
            ElasticMaterial::new(law, bulk, shear, mesh.point_count())
        }
        Dimension::Space => ElasticMaterial::spatial(law, 1e6 / 1.5, 4e5, mesh.point_count()),
    }
}

/// Affine fields: the published one, single normal strains, and a shear with rotation.
fn modes(dimension: Dimension) -> Vec<Matrix3<f64>> {
    let all = |m: [f64; 9]| Matrix3::from_row_slice(&m) * 1e-3;
    match dimension {
        Dimension::Plane => vec![
            all([1.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0]),
            all([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            all([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
            all([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ],
        Dimension::Space => vec![
            all([1.0, 0.5, 0.5, 0.5, 1.0, 0.5, 0.5, 0.5, 1.0]),
            all([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
            all([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            all([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        ],
    }
}

/// H-1. Boundary nodes follow an affine field; inner nodes must find it and the stress must be the law's.
#[test]
fn irregular_patches_of_every_kind_reproduce_every_constant_strain() {
    for kind in ElementKind::ALL {
        let mesh = patch_mesh(kind);
        mesh.validate().unwrap();
        for law in [ElasticLaw::SmallStrain, ElasticLaw::SaintVenant] {
            for (number, mode) in modes(mesh.dimension).into_iter().enumerate() {
                let mut problem = Problem::new(mesh.clone(), Vec::new());
                problem.stages[0].control.increments = 2;
                problem.stages[0].tolerances = Tolerances::both(1e-12, 1e-12);
                let field = |p: [f64; 3]| (mode * Vector3::from(p)).into();
                let nodes = boundary(&problem.mesh);
                prescribe_field(&mut problem, &nodes, field);
                let mut material = patch_material(law, &mesh);
                let exact = material.stress(&(Matrix3::identity() + mode));
                let (run, record) = run(&problem, &mut material);
                assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {:?}", run.outcome);
                let what = if mesh.dimension == Dimension::Plane { "plane" } else { "solid" };
                let errors = record.displacements.iter().enumerate().flat_map(|(node, moved)| {
                    let wanted: [f64; 3] = field(problem.mesh.nodes[node]);
                    (0..3).map(move |i| (moved[i] - wanted[i]).abs())
                });
                let error = errors.max_by(f64::total_cmp).unwrap();
                let quantity = format!("displacements of {what} patches, over those of the field");
                Claim::of("H-1", &quantity).error(error / (1e-3 * 0.24)).within(1e-10);
                let errors = record.points.iter().map(|point| (matrix(&point.stress) - exact).amax());
                let error = errors.max_by(f64::total_cmp).unwrap();
                Claim::of("H-1", &format!("stresses of {what} patches")).error(error / exact.norm()).within(1e-10);
                if law == ElasticLaw::SmallStrain && number == 0 {
                    let normal = if mesh.dimension == Dimension::Plane { 4000.0 / 3.0 } else { 2000.0 };
                    let stress = record.points[0].stress;
                    for (found, published) in [(stress.get(0, 0), normal), (stress.get(0, 1), 400.0)] {
                        let quantity = "published stresses of the patches, Pa";
                        Claim::of("H-1", quantity).value(found, published).within(1e-10);
                    }
                }
            }
        }
    }
}

/// H-2. A quarter turn in nine steps leaves no stress and no nodal force, hourglass modes included.
#[test]
fn a_quarter_turn_and_a_translation_leave_no_stress() {
    for kind in ElementKind::ALL {
        let mesh = patch_mesh(kind);
        let mut material = patch_material(ElasticLaw::SaintVenant, &mesh);
        let mut turned = mesh.clone();
        let axis = match mesh.dimension {
            Dimension::Plane => Vector3::z_axis(),
            Dimension::Space => nalgebra::Unit::new_normalize(Vector3::new(1.0, -0.5, 2.0)),
        };
        let goal = |step: u32, place: [f64; 3]| {
            let turn = nalgebra::Rotation3::from_axis_angle(&axis, f64::from(10 * step).to_radians());
            turn * Vector3::from(place) + Vector3::new(0.01 * f64::from(step), 0.0, 0.0)
        };
        for step in 1..=9 {
            // A displacement that is linear in load cannot turn; so each step is its own problem on the turned mesh.
            let mut problem = Problem::new(turned.clone(), Vec::new());
            problem.stages[0].control.increments = 1;
            problem.stages[0].tolerances = Tolerances::both(1e-6, 1e-12);
            for node in boundary(&mesh) {
                let moved = goal(step, mesh.nodes[node]) - Vector3::from(turned.nodes[node]);
                prescribe_field(&mut problem, &[node], |_| moved.into());
            }
            let (run, record) = run(&problem, &mut material);
            assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {:?}", run.outcome);
            for (position, moved) in turned.nodes.iter_mut().zip(&record.displacements) {
                (0..3).for_each(|i| position[i] += moved[i]);
            }
            let stress = record.points.iter().flat_map(|point| point.stress.0).fold(0.0, |a: f64, b| a.max(b.abs()));
            let force = record.reactions.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
            let quantity = "largest stress after a quarter turn in nine steps, over Young's modulus";
            Claim::of("H-2", quantity).error(stress / 1e6).within(1e-10);
            let quantity = "largest nodal force after a quarter turn in nine steps, over Young's modulus, m2";
            Claim::of("H-2", quantity).error(force / 1e6).within(1e-10);
        }
        for (node, position) in turned.nodes.iter().enumerate() {
            let error = (goal(9, mesh.nodes[node]) - Vector3::from(*position)).norm();
            Claim::of("H-2", "places of nodes after a quarter turn, m").error(error).within(1e-11);
        }
    }
}
