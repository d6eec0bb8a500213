//! Trilinear and serendipity hexahedra.

use super::definition::{ElementDefinition, ElementKind, Interpolation, SideKind, SinglePoint};
use crate::element::dimension::Dimension;
use crate::element::quadrature::{CUBE_EIGHT, CUBE_ONE, cube_twenty_seven};
use crate::element::shape::Shape;
use vtkio::model::CellType;

/// H8: 2x2x2 points.
pub(super) static H8: ElementDefinition = ElementDefinition {
    kind: ElementKind::H8,
    interpolation: TRILINEAR,
    point_count: 8,
    points: || &CUBE_EIGHT,
    mass_points: || CUBE_EIGHT.to_vec(),
    single_point: None,
};

/// H8 with one point and hourglass control.
pub(super) static H8_SINGLE: ElementDefinition = ElementDefinition {
    kind: ElementKind::H8Single,
    interpolation: TRILINEAR,
    point_count: 1,
    points: || &CUBE_ONE,
    mass_points: || CUBE_EIGHT.to_vec(),
    single_point: Some(SinglePoint::MeanOver(ElementKind::H8)),
};

/// H20 with reduced integration.
pub(super) static H20: ElementDefinition = ElementDefinition {
    kind: ElementKind::H20,
    interpolation: SERENDIPITY,
    point_count: 8,
    points: || &CUBE_EIGHT,
    mass_points: || cube_twenty_seven().to_vec(),
    single_point: None,
};

/// H20 with full integration.
pub(super) static H20_FULL: ElementDefinition = ElementDefinition {
    kind: ElementKind::H20Full,
    interpolation: SERENDIPITY,
    point_count: 27,
    points: cube_twenty_seven,
    mass_points: || cube_twenty_seven().to_vec(),
    single_point: None,
};

const TRILINEAR: Interpolation = Interpolation {
    dimension: Dimension::Space,
    places: NODES.split_at(8).0,
    corner_count: 8,
    shape: trilinear,
    middles: &[],
    sides: &FACES,
    side_kind: SideKind::Quad4,
    vtk: CellType::Hexahedron,
    gmsh: 5,
    gmsh_order: &[],
};

const SERENDIPITY: Interpolation = Interpolation {
    dimension: Dimension::Space,
    places: &NODES,
    corner_count: 8,
    shape: serendipity,
    middles: &MIDDLES,
    sides: &FACES,
    side_kind: SideKind::Quad8,
    vtk: CellType::QuadraticHexahedron,
    gmsh: 17,
    gmsh_order: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
};

/// Faces towards -x, +x, -y, +y, -z, +z of the natural coordinates, corners then middles, outward normals.
const FACES: [&[usize]; 6] = [
    &[0, 4, 7, 3, 16, 15, 19, 11],
    &[1, 2, 6, 5, 9, 18, 13, 17],
    &[0, 1, 5, 4, 8, 17, 12, 16],
    &[3, 7, 6, 2, 19, 14, 18, 10],
    &[0, 3, 2, 1, 11, 10, 9, 8],
    &[4, 5, 6, 7, 12, 13, 14, 15],
];

const MIDDLES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Natural coordinates of the nodes of H20; the first eight are those of H8.
const NODES: [[f64; 3]; 20] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
];

/// `N = (1 + a xi)(1 + b eta)(1 + c zeta) / 8`.
fn trilinear(place: [f64; 3]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (node, corner) in NODES.iter().enumerate().take(8) {
        let factors: [f64; 3] = std::array::from_fn(|i| 1.0 + corner[i] * place[i]);
        let gradient = std::array::from_fn(|i| 0.125 * corner[i] * factors[(i + 1) % 3] * factors[(i + 2) % 3]);
        shape.set(node, 0.125 * factors[0] * factors[1] * factors[2], gradient);
    }
    shape
}

/// Quadratic along every edge, without face and middle nodes.
fn serendipity(place: [f64; 3]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (node, corner) in NODES.iter().enumerate() {
        let factors: [f64; 3] = std::array::from_fn(|i| 1.0 + corner[i] * place[i]);
        let (value, gradient) = match (0..3).find(|&i| corner[i] == 0.0) {
            None => corner_function(corner, &factors),
            Some(along) => middle_function(corner, &factors, place[along], along),
        };
        shape.set(node, value, gradient);
    }
    shape
}

fn corner_function(corner: &[f64; 3], factors: &[f64; 3]) -> (f64, [f64; 3]) {
    // lift = a xi + b eta + c zeta - 2.
    let lift = factors.iter().sum::<f64>() - 5.0;
    let value = 0.125 * factors[0] * factors[1] * factors[2] * lift;
    let gradient = std::array::from_fn(|i| {
        0.125 * corner[i] * factors[(i + 1) % 3] * factors[(i + 2) % 3] * (lift + factors[i])
    });
    (value, gradient)
}

/// `N = (1 - s^2) (1 + ..)(1 + ..) / 4` for the middle of an edge along natural direction `along`.
fn middle_function(corner: &[f64; 3], factors: &[f64; 3], s: f64, along: usize) -> (f64, [f64; 3]) {
    let (first, second) = ((along + 1) % 3, (along + 2) % 3);
    let bubble = 1.0 - s * s;
    let mut gradient = [0.0; 3];
    gradient[along] = -0.5 * s * factors[first] * factors[second];
    gradient[first] = 0.25 * bubble * corner[first] * factors[second];
    gradient[second] = 0.25 * bubble * factors[first] * corner[second];
    (0.25 * bubble * factors[first] * factors[second], gradient)
}
