//! Bilinear and serendipity quadrilaterals.

use super::definition::{ElementDefinition, ElementKind, Interpolation, SideKind, SinglePoint};
use crate::element::dimension::Dimension;
use crate::element::quadrature::{SQUARE_FOUR, SQUARE_ONE, square_nine};
use crate::element::shape::Shape;
use vtkio::model::CellType;

/// Q4: 2x2 points.
pub(super) static Q4: ElementDefinition = ElementDefinition {
    kind: ElementKind::Q4,
    interpolation: BILINEAR,
    point_count: 4,
    points: || &SQUARE_FOUR,
    mass_points: || SQUARE_FOUR.to_vec(),
    single_point: None,
};

/// Q4 with one point and hourglass control.
pub(super) static Q4_SINGLE: ElementDefinition = ElementDefinition {
    kind: ElementKind::Q4Single,
    interpolation: BILINEAR,
    point_count: 1,
    points: || &SQUARE_ONE,
    mass_points: || SQUARE_FOUR.to_vec(),
    single_point: Some(SinglePoint::Centre),
};

/// Q8 with reduced integration.
pub(super) static Q8: ElementDefinition = ElementDefinition {
    kind: ElementKind::Q8,
    interpolation: SERENDIPITY,
    point_count: 4,
    points: || &SQUARE_FOUR,
    mass_points: || square_nine().to_vec(),
    single_point: None,
};

/// Q8 with full integration.
pub(super) static Q8_FULL: ElementDefinition = ElementDefinition {
    kind: ElementKind::Q8Full,
    interpolation: SERENDIPITY,
    point_count: 9,
    points: square_nine,
    mass_points: || square_nine().to_vec(),
    single_point: None,
};

const BILINEAR: Interpolation = Interpolation {
    dimension: Dimension::Plane,
    places: NODES.split_at(4).0,
    corner_count: 4,
    shape: bilinear,
    middles: &[],
    sides: &EDGES,
    side_kind: SideKind::Line2,
    vtk: CellType::Quad,
    gmsh: 3,
    gmsh_order: &[],
};

const SERENDIPITY: Interpolation = Interpolation {
    dimension: Dimension::Plane,
    places: &NODES,
    corner_count: 4,
    shape: serendipity,
    middles: &[[0, 1], [1, 2], [2, 3], [3, 0]],
    sides: &EDGES,
    side_kind: SideKind::Line3,
    vtk: CellType::QuadraticQuad,
    gmsh: 16,
    gmsh_order: &[],
};

const EDGES: [&[usize]; 4] = [&[0, 1, 4], &[1, 2, 5], &[2, 3, 6], &[3, 0, 7]];

/// Natural coordinates of the nodes of Q8; the first four are those of Q4.
const NODES: [[f64; 3]; 8] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
];

/// `N = (1 + a xi)(1 + b eta) / 4`.
pub(crate) fn bilinear([xi, eta, _]: [f64; 3]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (node, &[a, b, _]) in NODES.iter().enumerate().take(4) {
        let gradient = [0.25 * a * (1.0 + b * eta), 0.25 * b * (1.0 + a * xi), 0.0];
        shape.set(node, 0.25 * (1.0 + a * xi) * (1.0 + b * eta), gradient);
    }
    shape
}

/// Quadratic along every edge, without a middle node.
pub(crate) fn serendipity([xi, eta, _]: [f64; 3]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (node, &[a, b, _]) in NODES.iter().enumerate() {
        let (along, across) = (1.0 + a * xi, 1.0 + b * eta);
        let (value, gradient) = if node < 4 {
            let lift = a * xi + b * eta - 1.0;
            let gradient = [0.25 * a * across * (lift + along), 0.25 * b * along * (lift + across), 0.0];
            (0.25 * along * across * lift, gradient)
        } else if a == 0.0 {
            (0.5 * (1.0 - xi * xi) * across, [-xi * across, 0.5 * b * (1.0 - xi * xi), 0.0])
        } else {
            (0.5 * (1.0 - eta * eta) * along, [0.5 * a * (1.0 - eta * eta), -eta * along, 0.0])
        };
        shape.set(node, value, gradient);
    }
    shape
}
