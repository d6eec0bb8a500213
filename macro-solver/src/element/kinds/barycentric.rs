//! Linear and quadratic functions of triangles and tetrahedra, from their barycentric coordinates.
//!
//! Corner `c` has the barycentric coordinate `l_c`: `l_0 = 1 - xi - eta (- zeta)`, `l_1 = xi`, `l_2 = eta`,
//! `l_3 = zeta`. Linear functions are the `l_c`; quadratic ones are `l_c (2 l_c - 1)` at corners and `4 l_a l_b` at the
//! middle of the edge from `a` to `b`.

use crate::element::shape::Shape;

/// Linear functions of barycentric coordinates with these constant derivatives.
pub(super) fn linear(barycentric: &[f64], slopes: &[[f64; 3]]) -> Shape {
    let mut shape = Shape::EMPTY;
    for (corner, (value, slope)) in barycentric.iter().zip(slopes).enumerate() {
        shape.set(corner, *value, *slope);
    }
    shape
}

/// Quadratic functions with a middle node on each of these edges.
pub(super) fn quadratic(barycentric: &[f64], slopes: &[[f64; 3]], edges: &[[usize; 2]]) -> Shape {
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
