//! Linear and quadratic tetrahedra.

use super::barycentric::{linear, quadratic};
use super::definition::{ElementDefinition, ElementKind, Interpolation, SideKind};
use crate::element::dimension::Dimension;
use crate::element::quadrature::{TETRAHEDRON_FOUR, TETRAHEDRON_ONE, collapsed_points};
use crate::element::shape::Shape;
use vtkio::model::CellType;

/// T4.
pub(super) static T4: ElementDefinition = ElementDefinition {
    kind: ElementKind::T4,
    interpolation: Interpolation {
        dimension: Dimension::Space,
        places: NODES.split_at(4).0,
        corner_count: 4,
        shape: linear_tetrahedron,
        middles: &[],
        sides: &FACES,
        side_kind: SideKind::Triangle3,
        vtk: CellType::Tetra,
        gmsh: 4,
        gmsh_order: &[],
    },
    point_count: 1,
    points: || &TETRAHEDRON_ONE,
    mass_points: || collapsed_points(Dimension::Space),
    single_point: None,
};

/// T10.
pub(super) static T10: ElementDefinition = ElementDefinition {
    kind: ElementKind::T10,
    interpolation: Interpolation {
        dimension: Dimension::Space,
        places: &NODES,
        corner_count: 4,
        shape: quadratic_tetrahedron,
        middles: &MIDDLES,
        sides: &FACES,
        side_kind: SideKind::Triangle6,
        vtk: CellType::QuadraticTetra,
        gmsh: 11,
        gmsh_order: &[0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    },
    point_count: 4,
    points: || &TETRAHEDRON_FOUR,
    mass_points: || collapsed_points(Dimension::Space),
    single_point: None,
};

const FACES: [&[usize]; 4] = [&[0, 2, 1, 6, 5, 4], &[0, 1, 3, 4, 8, 7], &[1, 2, 3, 5, 9, 8], &[0, 3, 2, 7, 9, 6]];
const MIDDLES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const SLOPES: [[f64; 3]; 4] = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Natural coordinates of the nodes of T10; the first four are those of T4.
const NODES: [[f64; 3]; 10] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
    [0.0, 0.0, 0.5],
    [0.5, 0.0, 0.5],
    [0.0, 0.5, 0.5],
];

/// Shape functions of T4.
fn linear_tetrahedron([xi, eta, zeta]: [f64; 3]) -> Shape {
    linear(&[1.0 - xi - eta - zeta, xi, eta, zeta], &SLOPES)
}

/// Shape functions of T10.
fn quadratic_tetrahedron([xi, eta, zeta]: [f64; 3]) -> Shape {
    quadratic(&[1.0 - xi - eta - zeta, xi, eta, zeta], &SLOPES, &MIDDLES)
}
