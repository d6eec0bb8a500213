//! Shape functions and Gauss points of element edges.
//!
//! The nodes of an edge are its start, its end and, for Q8, its middle. Two Gauss points integrate every boundary
//! term of Q4 and Q8 exactly (polynomials of degree 3).

use super::GAUSS_POINTS;
use crate::mesh::{Edge, ElementKind, Mesh};

/// Nodes of the longest edge.
pub const MAX_EDGE_NODES: usize = 3;

/// Shape functions at one place of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeShape {
    /// Values, dimensionless.
    pub values: [f64; MAX_EDGE_NODES],
    /// Derivatives with respect to the natural coordinate.
    pub gradients: [f64; MAX_EDGE_NODES],
}

/// Shape functions of an edge at its two Gauss points; every weight is 1.
pub fn edge_shapes(kind: ElementKind) -> [EdgeShape; 2] {
    let at = |xi: f64| match kind {
        ElementKind::Q4 => {
            EdgeShape { values: [0.5 * (1.0 - xi), 0.5 * (1.0 + xi), 0.0], gradients: [-0.5, 0.5, 0.0] }
        }
        ElementKind::Q8 => EdgeShape {
            values: [0.5 * xi * (xi - 1.0), 0.5 * xi * (xi + 1.0), 1.0 - xi * xi],
            gradients: [xi - 0.5, xi + 0.5, -2.0 * xi],
        },
    };
    [at(GAUSS_POINTS[0][0]), at(GAUSS_POINTS[2][0])]
}

/// Node numbers of an edge: start, end and, for Q8, middle.
pub fn edge_nodes(mesh: &Mesh, edge: Edge) -> Vec<usize> {
    let element = &mesh.elements[edge.element];
    let mut nodes = vec![element[edge.local], element[(edge.local + 1) % 4]];
    if mesh.kind == ElementKind::Q8 {
        nodes.push(element[4 + edge.local]);
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{NODES, shape};

    #[test]
    fn edge_functions_are_the_trace_of_the_element_functions() {
        for kind in [ElementKind::Q4, ElementKind::Q8] {
            for local in 0..4 {
                let (from, to) = (NODES[local], NODES[(local + 1) % 4]);
                for (gauss, edge) in edge_shapes(kind).iter().enumerate() {
                    let along = if gauss == 0 { GAUSS_POINTS[0][0] } else { GAUSS_POINTS[2][0] };
                    let place = [0, 1].map(|i| 0.5 * ((1.0 - along) * from[i] + (1.0 + along) * to[i]));
                    let values = shape(kind, place).values;
                    assert!((values[local] - edge.values[0]).abs() < 1e-15);
                    assert!((values[(local + 1) % 4] - edge.values[1]).abs() < 1e-15);
                    if kind == ElementKind::Q8 {
                        assert!((values[4 + local] - edge.values[2]).abs() < 1e-15);
                    }
                }
            }
        }
    }
}
