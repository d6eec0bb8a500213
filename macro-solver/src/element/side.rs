//! Shape functions and quadrature of element sides, for loads on the boundary.
//!
//! The two tangents of a side span it; their cross product is the outward normal times the area per natural area.
//! An edge of a plane element is a strip of unit thickness, whose second tangent is the unit vector along z.

use super::SideKind;
use super::kinds::{bilinear, linear_triangle, quadratic_triangle, serendipity};
use nalgebra::Vector3;
use std::sync::LazyLock;

/// Nodes of the largest side.
pub const MAX_SIDE_NODES: usize = 8;

/// Shape functions at one quadrature point of a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideShape {
    /// Values, dimensionless.
    pub values: [f64; MAX_SIDE_NODES],
    /// Derivatives with respect to the two natural coordinates; the second one is 0 on an edge.
    pub gradients: [[f64; 2]; MAX_SIDE_NODES],
    /// Weight of the point.
    pub weight: f64,
    /// Whether the side is an edge of a plane element.
    pub is_edge: bool,
}

impl SideShape {
    /// The two tangents for nodes at `positions`.
    pub fn tangents(&self, positions: impl Iterator<Item = [f64; 3]>) -> [Vector3<f64>; 2] {
        let mut tangents = [Vector3::zeros(), if self.is_edge { Vector3::z() } else { Vector3::zeros() }];
        for (position, slope) in positions.zip(&self.gradients) {
            let position = Vector3::from(position);
            tangents[0] += slope[0] * position;
            tangents[1] += slope[1] * position;
        }
        tangents
    }
}

/// Outward normal times area per natural area, of a side with these nodes.
pub(crate) fn area_vector(shape: &SideShape, nodes: &[usize], positions: &[[f64; 3]]) -> Vector3<f64> {
    let [first, second] = shape.tangents(nodes.iter().map(|&node| positions[node]));
    first.cross(&second)
}

/// 1 / sqrt(3) and sqrt(3 / 5).
const TWO: f64 = 0.577_350_269_189_625_8;
const THREE: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// Six points of degree 4 on a triangle: barycentric coordinate of the two equal ones and weight.
const SIX: [(f64, f64); 2] =
    [(0.445_948_490_915_964_9, 0.223_381_589_678_011_47), (0.091_576_213_509_770_74, 0.109_951_743_655_321_87)];

static TABLES: LazyLock<[Vec<SideShape>; 6]> = LazyLock::new(|| {
    let edge = |quadratic: bool| [-TWO, TWO].map(|place| edge_shape(quadratic, place)).to_vec();
    let square = |places: &[(f64, f64)], function: fn([f64; 3]) -> super::Shape, count| -> Vec<SideShape> {
        let row = |&(y, outer): &(f64, f64)| {
            places.iter().map(move |&(x, inner)| face_shape(&function([x, y, 0.0]), count, inner * outer))
        };
        places.iter().flat_map(row).collect::<Vec<_>>()
    };
    let triangle = |function: fn([f64; 3]) -> super::Shape, count| -> Vec<SideShape> {
        let points = SIX.iter().flat_map(|&(equal, weight)| {
            let third = 1.0 - 2.0 * equal;
            [[equal, equal, 0.0], [third, equal, 0.0], [equal, third, 0.0]].map(|place| (place, 0.5 * weight))
        });
        points.map(|(place, weight)| face_shape(&function(place), count, weight)).collect()
    };
    [
        edge(false),
        edge(true),
        triangle(linear_triangle, 3),
        triangle(quadratic_triangle, 6),
        square(&[(-TWO, 1.0), (TWO, 1.0)], bilinear, 4),
        square(&THREE, serendipity, 8),
    ]
});

/// Shape functions of a side at its quadrature points.
pub fn side_shapes(kind: SideKind) -> &'static [SideShape] {
    // The variants are numbered in the order of the table.
    &TABLES[kind as usize]
}

fn edge_shape(quadratic: bool, xi: f64) -> SideShape {
    let mut shape = SideShape {
        values: [0.0; MAX_SIDE_NODES],
        gradients: [[0.0; 2]; MAX_SIDE_NODES],
        weight: 1.0,
        is_edge: true,
    };
    let (values, slopes) = if quadratic {
        ([0.5 * xi * (xi - 1.0), 0.5 * xi * (xi + 1.0), 1.0 - xi * xi], [xi - 0.5, xi + 0.5, -2.0 * xi])
    } else {
        ([0.5 * (1.0 - xi), 0.5 * (1.0 + xi), 0.0], [-0.5, 0.5, 0.0])
    };
    shape.values[..3].copy_from_slice(&values);
    for (gradient, slope) in shape.gradients.iter_mut().zip(slopes) {
        gradient[0] = slope;
    }
    shape
}

fn face_shape(plane: &super::Shape, count: usize, weight: f64) -> SideShape {
    let mut shape =
        SideShape { values: [0.0; MAX_SIDE_NODES], gradients: [[0.0; 2]; MAX_SIDE_NODES], weight, is_edge: false };
    for node in 0..count {
        shape.values[node] = plane.values[node];
        shape.gradients[node] = [plane.gradients[node][0], plane.gradients[node][1]];
    }
    shape
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{Dimension, ElementKind, node_places, shape};

    /// Integrals of the normal over the closed surface vanish, and `x . n` integrates to dimension times volume.
    #[test]
    fn sides_close_the_element_with_outward_normals() {
        for kind in ElementKind::ALL {
            let count = kind.dimension().count() as f64;
            let places = node_places(kind);
            let (mut closure, mut flux) = (Vector3::zeros(), 0.0);
            for side in 0..kind.side_count() {
                let nodes: Vec<[f64; 3]> = kind.side(side).iter().map(|&node| places[node]).collect();
                for shape in side_shapes(kind.side_kind()) {
                    let [first, second] = shape.tangents(nodes.iter().copied());
                    let normal = first.cross(&second) * shape.weight;
                    let place: Vector3<f64> =
                        nodes.iter().zip(&shape.values).map(|(place, value)| Vector3::from(*place) * *value).sum();
                    closure += normal;
                    flux += place.dot(&normal);
                }
            }
            let volume = match kind {
                ElementKind::T3 | ElementKind::T6 => 0.5,
                ElementKind::T4 | ElementKind::T10 => 1.0 / 6.0,
                _ => 2f64.powi(kind.dimension().count() as i32),
            };
            assert!(closure.norm() < 1e-14, "{kind:?}");
            assert!((flux - count * volume).abs() < 1e-13, "{kind:?}: {flux}");
        }
    }

    #[test]
    fn side_functions_are_the_trace_of_the_element_functions() {
        for kind in ElementKind::ALL {
            let places = node_places(kind);
            for side in 0..kind.side_count() {
                let locals = kind.side(side);
                for table in side_shapes(kind.side_kind()) {
                    let mut place = [0.0; 3];
                    for (&node, value) in locals.iter().zip(&table.values) {
                        (0..3).for_each(|i| place[i] += value * places[node][i]);
                    }
                    let inside = shape(kind, place).values;
                    for (&node, value) in locals.iter().zip(&table.values) {
                        assert!((inside[node] - value).abs() < 1e-14, "{kind:?} side {side}");
                    }
                }
            }
            assert!(kind.dimension() == Dimension::Space || side_shapes(kind.side_kind())[0].is_edge);
        }
    }
}
