//! Bilinear and serendipity quadrilaterals.

use super::Shape;

/// Natural coordinates of the nodes of Q8; the first four are those of Q4.
pub const NODES: [[f64; 3]; 8] = [
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
pub fn bilinear([xi, eta, _]: [f64; 3]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (node, &[a, b, _]) in NODES.iter().enumerate().take(4) {
        let gradient = [0.25 * a * (1.0 + b * eta), 0.25 * b * (1.0 + a * xi), 0.0];
        shape.set(node, 0.25 * (1.0 + a * xi) * (1.0 + b * eta), gradient);
    }
    shape
}

/// Quadratic along every edge, without a middle node.
pub fn serendipity([xi, eta, _]: [f64; 3]) -> Shape {
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
