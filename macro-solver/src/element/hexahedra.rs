//! Trilinear and serendipity hexahedra.

use super::Shape;

/// Natural coordinates of the nodes of H20; the first eight are those of H8.
pub const NODES: [[f64; 3]; 20] = [
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
pub fn trilinear(place: [f64; 3]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (node, corner) in NODES.iter().enumerate().take(8) {
        let factors: [f64; 3] = std::array::from_fn(|i| 1.0 + corner[i] * place[i]);
        let gradient = std::array::from_fn(|i| 0.125 * corner[i] * factors[(i + 1) % 3] * factors[(i + 2) % 3]);
        shape.set(node, 0.125 * factors[0] * factors[1] * factors[2], gradient);
    }
    shape
}

/// Quadratic along every edge, without face and middle nodes.
pub fn serendipity(place: [f64; 3]) -> Shape {
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
