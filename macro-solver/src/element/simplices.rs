//! Linear and quadratic triangles and tetrahedra, from their barycentric coordinates.
//!
//! Corner `c` has the barycentric coordinate `l_c`: `l_0 = 1 - xi - eta (- zeta)`, `l_1 = xi`, `l_2 = eta`,
//! `l_3 = zeta`. Linear functions are the `l_c`; quadratic ones are `l_c (2 l_c - 1)` at corners and `4 l_a l_b` at the
//! middle of the edge from `a` to `b`.

use super::Shape;

/// Natural coordinates of the nodes of T6; the first three are those of T3.
pub const TRIANGLE_NODES: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.0]];

/// Natural coordinates of the nodes of T10; the first four are those of T4.
pub const TETRAHEDRON_NODES: [[f64; 3]; 10] = [
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

const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const TRIANGLE_SLOPES: [[f64; 3]; 3] = [[-1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const TETRAHEDRON_SLOPES: [[f64; 3]; 4] = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// T3.
pub fn linear_triangle([xi, eta, _]: [f64; 3]) -> Shape {
    linear(&[1.0 - xi - eta, xi, eta], &TRIANGLE_SLOPES)
}

/// T6.
pub fn quadratic_triangle([xi, eta, _]: [f64; 3]) -> Shape {
    quadratic(&[1.0 - xi - eta, xi, eta], &TRIANGLE_SLOPES, &TRIANGLE_EDGES)
}

/// T4.
pub fn linear_tetrahedron([xi, eta, zeta]: [f64; 3]) -> Shape {
    linear(&[1.0 - xi - eta - zeta, xi, eta, zeta], &TETRAHEDRON_SLOPES)
}

/// T10.
pub fn quadratic_tetrahedron([xi, eta, zeta]: [f64; 3]) -> Shape {
    quadratic(&[1.0 - xi - eta - zeta, xi, eta, zeta], &TETRAHEDRON_SLOPES, &TETRAHEDRON_EDGES)
}

fn linear(barycentric: &[f64], slopes: &[[f64; 3]]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (corner, (value, slope)) in barycentric.iter().zip(slopes).enumerate() {
        shape.set(corner, *value, *slope);
    }
    shape
}

fn quadratic(barycentric: &[f64], slopes: &[[f64; 3]], edges: &[[usize; 2]]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (corner, (&value, slope)) in barycentric.iter().zip(slopes).enumerate() {
        shape.set(corner, value * (2.0 * value - 1.0), slope.map(|component| (4.0 * value - 1.0) * component));
    }
    for (edge, &[from, to]) in edges.iter().enumerate() {
        let gradient =
            std::array::from_fn(|i| 4.0 * (barycentric[from] * slopes[to][i] + barycentric[to] * slopes[from][i]));
        shape.set(barycentric.len() + edge, 4.0 * barycentric[from] * barycentric[to], gradient);
    }
    shape
}
