//! Linear and quadratic triangles.

use super::barycentric::{linear, quadratic};
use super::definition::{ElementDefinition, ElementKind, Interpolation, SideKind};
use crate::element::dimension::Dimension;
use crate::element::quadrature::{TRIANGLE_ONE, TRIANGLE_THREE, collapsed_points};
use crate::element::shape::Shape;
use vtkio::model::CellType;

/// T3.
pub(super) static T3: ElementDefinition = ElementDefinition {
    kind: ElementKind::T3,
    interpolation: Interpolation {
        dimension: Dimension::Plane,
        places: NODES.split_at(3).0,
        corner_count: 3,
        shape: linear_triangle,
        middles: &[],
        sides: &EDGES,
        side_kind: SideKind::Line2,
        vtk: CellType::Triangle,
        gmsh: 2,
        gmsh_order: &[],
    },
    point_count: 1,
    points: || &TRIANGLE_ONE,
    mass_points: || collapsed_points(Dimension::Plane),
    single_point: None,
};

/// T6.
pub(super) static T6: ElementDefinition = ElementDefinition {
    kind: ElementKind::T6,
    interpolation: Interpolation {
        dimension: Dimension::Plane,
        places: &NODES,
        corner_count: 3,
        shape: quadratic_triangle,
        middles: &MIDDLES,
        sides: &EDGES,
        side_kind: SideKind::Line3,
        vtk: CellType::QuadraticTriangle,
        gmsh: 9,
        gmsh_order: &[],
    },
    point_count: 3,
    points: || &TRIANGLE_THREE,
    mass_points: || collapsed_points(Dimension::Plane),
    single_point: None,
};

const EDGES: [&[usize]; 3] = [&[0, 1, 3], &[1, 2, 4], &[2, 0, 5]];
const MIDDLES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
const SLOPES: [[f64; 3]; 3] = [[-1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Natural coordinates of the nodes of T6; the first three are those of T3.
const NODES: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.0]];

/// Shape functions of T3.
pub(crate) fn linear_triangle([xi, eta, _]: [f64; 3]) -> Shape {
    linear(&[1.0 - xi - eta, xi, eta], &SLOPES)
}

/// Shape functions of T6.
pub(crate) fn quadratic_triangle([xi, eta, _]: [f64; 3]) -> Shape {
    quadratic(&[1.0 - xi - eta, xi, eta], &SLOPES, &MIDDLES)
}
