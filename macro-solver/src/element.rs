//! Shape functions and Gauss points of plane elements and their edges.
//!
//! Natural coordinates run from -1 to 1. Node order is that of [`crate::mesh`].

use crate::mesh::{ElementKind, POINTS_PER_ELEMENT};
use nalgebra::Matrix2;

pub mod edge;

/// Nodes of the largest element; arrays of smaller elements are padded with zeros.
pub const MAX_NODES: usize = 8;

/// Natural coordinates of the 2x2 Gauss points, counter-clockwise from the lower left; every weight is 1.
pub const GAUSS_POINTS: [[f64; 2]; POINTS_PER_ELEMENT] =
    [[-GAUSS, -GAUSS], [GAUSS, -GAUSS], [GAUSS, GAUSS], [-GAUSS, GAUSS]];

/// 1 / sqrt(3).
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// Natural coordinates of the nodes of Q8; the first four are those of Q4.
pub const NODES: [[f64; 2]; MAX_NODES] =
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];

/// Shape functions at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Values, dimensionless.
    pub values: [f64; MAX_NODES],
    /// Derivatives with respect to the natural coordinates.
    pub gradients: [[f64; 2]; MAX_NODES],
}

/// Shape functions of an element kind at natural coordinates `place`.
pub fn shape(kind: ElementKind, place: [f64; 2]) -> Shape {
    match kind {
        ElementKind::Q4 => bilinear(place),
        ElementKind::Q8 => serendipity(place),
    }
}

fn bilinear([xi, eta]: [f64; 2]) -> Shape {
    let mut shape = Shape { values: [0.0; MAX_NODES], gradients: [[0.0; 2]; MAX_NODES] };
    for (node, &[a, b]) in NODES.iter().enumerate().take(4) {
        shape.values[node] = 0.25 * (1.0 + a * xi) * (1.0 + b * eta);
        shape.gradients[node] = [0.25 * a * (1.0 + b * eta), 0.25 * b * (1.0 + a * xi)];
    }
    shape
}

fn serendipity([xi, eta]: [f64; 2]) -> Shape {
    let mut shape = Shape { values: [0.0; MAX_NODES], gradients: [[0.0; 2]; MAX_NODES] };
    for (node, &[a, b]) in NODES.iter().enumerate() {
        let (along, across) = (1.0 + a * xi, 1.0 + b * eta);
        (shape.values[node], shape.gradients[node]) = if node < 4 {
            let lift = a * xi + b * eta - 1.0;
            (0.25 * along * across * lift, [0.25 * a * across * (lift + along), 0.25 * b * along * (lift + across)])
        } else if a == 0.0 {
            (0.5 * (1.0 - xi * xi) * across, [-xi * across, 0.5 * b * (1.0 - xi * xi)])
        } else {
            (0.5 * (1.0 - eta * eta) * along, [0.5 * a * (1.0 - eta * eta), -eta * along])
        };
    }
    shape
}

/// Gradients in space and the area that a Gauss point stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointGeometry {
    /// Derivatives of the shape functions with respect to position, 1/m.
    pub gradients: [[f64; 2]; MAX_NODES],
    /// Weight times Jacobian determinant, m2. Not positive where the element is inverted; gradients are then
    /// meaningless.
    pub area: f64,
}

/// Geometry of Gauss point `local` of an element whose nodes lie at `positions`.
pub fn point_geometry(kind: ElementKind, positions: &[[f64; 2]], local: usize) -> PointGeometry {
    let shape = shape(kind, GAUSS_POINTS[local]);
    let mut jacobian = Matrix2::zeros();
    for (position, gradient) in positions.iter().zip(&shape.gradients) {
        for i in 0..2 {
            for j in 0..2 {
                jacobian[(i, j)] += position[i] * gradient[j];
            }
        }
    }
    let area = jacobian.determinant();
    let mut gradients = [[0.0; 2]; MAX_NODES];
    if let Some(inverse) = jacobian.try_inverse() {
        for (spatial, natural) in gradients.iter_mut().zip(&shape.gradients) {
            for (j, component) in spatial.iter_mut().enumerate() {
                *component = natural[0] * inverse[(0, j)] + natural[1] * inverse[(1, j)];
            }
        }
    }
    PointGeometry { gradients, area }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [ElementKind; 2] = [ElementKind::Q4, ElementKind::Q8];

    #[test]
    fn shape_functions_are_one_at_their_node_and_zero_at_the_others() {
        for kind in KINDS {
            for (place, &corner) in NODES.iter().enumerate().take(kind.node_count()) {
                let values = shape(kind, corner).values;
                for (node, value) in values.iter().enumerate() {
                    assert_eq!(*value, f64::from(node == place), "{kind:?} function {node} at node {place}");
                }
            }
        }
    }

    #[test]
    fn shape_functions_sum_to_one_and_their_gradients_match_differences() {
        let step = 1e-6;
        for kind in KINDS {
            for place in [[0.3, -0.7], [-0.2, 0.9]] {
                let here = shape(kind, place);
                assert!((here.values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                for axis in 0..2 {
                    let shifted = |sign: f64| {
                        let mut moved = place;
                        moved[axis] += sign * step;
                        shape(kind, moved).values
                    };
                    let (ahead, behind) = (shifted(1.0), shifted(-1.0));
                    for node in 0..MAX_NODES {
                        let difference = (ahead[node] - behind[node]) / (2.0 * step);
                        assert!((difference - here.gradients[node][axis]).abs() < 1e-9);
                    }
                }
            }
        }
    }

    #[test]
    fn gradients_of_a_linear_field_on_a_distorted_element_are_exact() {
        let corners = [[0.0, 0.0], [2.0, 0.3], [1.7, 1.9], [-0.2, 1.1]];
        for kind in KINDS {
            let mut positions = corners.to_vec();
            for side in 0..4 {
                let (from, to) = (corners[side], corners[(side + 1) % 4]);
                positions.push([0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])]);
            }
            positions.truncate(kind.node_count());
            let mut area = 0.0;
            for local in 0..POINTS_PER_ELEMENT {
                let geometry = point_geometry(kind, &positions, local);
                area += geometry.area;
                let mut gradient = [0.0; 2];
                for (position, weight) in positions.iter().zip(&geometry.gradients) {
                    let field = 3.0 * position[0] - 2.0 * position[1];
                    gradient[0] += field * weight[0];
                    gradient[1] += field * weight[1];
                }
                assert!((gradient[0] - 3.0).abs() < 1e-13 && (gradient[1] + 2.0).abs() < 1e-13);
            }
            // Shoelace formula.
            let exact: f64 = (0..4)
                .map(|side| {
                    let (from, to) = (corners[side], corners[(side + 1) % 4]);
                    0.5 * (from[0] * to[1] - to[0] * from[1])
                })
                .sum();
            assert!((area - exact).abs() < 1e-13);
        }
    }
}
