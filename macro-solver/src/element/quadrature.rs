//! Gauss points of every element kind and the shape functions there, tabulated once.

use super::{Shape, shape};
use crate::mesh::ElementKind;
use std::sync::LazyLock;

/// One quadrature point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussPoint {
    /// Natural coordinates.
    pub place: [f64; 3],
    /// Share of the natural volume.
    pub weight: f64,
}

/// 1 / sqrt(3): two-point Gauss rule.
const TWO: f64 = 0.577_350_269_189_625_8;

/// sqrt(3 / 5): three-point Gauss rule.
const THREE: f64 = 0.774_596_669_241_483_4;

/// Offset of the four-point rule of a tetrahedron, (5 - sqrt(5)) / 20.
const TETRAHEDRON: f64 = 0.138_196_601_125_010_5;

const fn point(x: f64, y: f64, z: f64, weight: f64) -> GaussPoint {
    GaussPoint { place: [x, y, z], weight }
}

/// Counter-clockwise from the lower left.
const SQUARE_FOUR: [GaussPoint; 4] =
    [point(-TWO, -TWO, 0.0, 1.0), point(TWO, -TWO, 0.0, 1.0), point(TWO, TWO, 0.0, 1.0), point(-TWO, TWO, 0.0, 1.0)];
const SQUARE_ONE: [GaussPoint; 1] = [point(0.0, 0.0, 0.0, 4.0)];
const CUBE_ONE: [GaussPoint; 1] = [point(0.0, 0.0, 0.0, 8.0)];
/// In the order of the corners of a hexahedron.
const CUBE_EIGHT: [GaussPoint; 8] = [
    point(-TWO, -TWO, -TWO, 1.0),
    point(TWO, -TWO, -TWO, 1.0),
    point(TWO, TWO, -TWO, 1.0),
    point(-TWO, TWO, -TWO, 1.0),
    point(-TWO, -TWO, TWO, 1.0),
    point(TWO, -TWO, TWO, 1.0),
    point(TWO, TWO, TWO, 1.0),
    point(-TWO, TWO, TWO, 1.0),
];
const TRIANGLE_ONE: [GaussPoint; 1] = [point(1.0 / 3.0, 1.0 / 3.0, 0.0, 0.5)];
const TRIANGLE_THREE: [GaussPoint; 3] = [
    point(1.0 / 6.0, 1.0 / 6.0, 0.0, 1.0 / 6.0),
    point(2.0 / 3.0, 1.0 / 6.0, 0.0, 1.0 / 6.0),
    point(1.0 / 6.0, 2.0 / 3.0, 0.0, 1.0 / 6.0),
];
const TETRAHEDRON_ONE: [GaussPoint; 1] = [point(0.25, 0.25, 0.25, 1.0 / 6.0)];
const TETRAHEDRON_FOUR: [GaussPoint; 4] = [
    point(TETRAHEDRON, TETRAHEDRON, TETRAHEDRON, 1.0 / 24.0),
    point(1.0 - 3.0 * TETRAHEDRON, TETRAHEDRON, TETRAHEDRON, 1.0 / 24.0),
    point(TETRAHEDRON, 1.0 - 3.0 * TETRAHEDRON, TETRAHEDRON, 1.0 / 24.0),
    point(TETRAHEDRON, TETRAHEDRON, 1.0 - 3.0 * TETRAHEDRON, 1.0 / 24.0),
];

const LINE_THREE: [(f64, f64); 3] = [(-THREE, 5.0 / 9.0), (0.0, 8.0 / 9.0), (THREE, 5.0 / 9.0)];

/// Row by row from the lower left.
static SQUARE_NINE: LazyLock<Vec<GaussPoint>> = LazyLock::new(|| {
    let row = |&(y, outer): &(f64, f64)| LINE_THREE.map(|(x, inner)| point(x, y, 0.0, inner * outer));
    LINE_THREE.iter().flat_map(row).collect()
});

/// Layer by layer, each as [`SQUARE_NINE`].
static CUBE_TWENTY_SEVEN: LazyLock<Vec<GaussPoint>> = LazyLock::new(|| {
    let layer = |&(z, outer): &(f64, f64)| {
        SQUARE_NINE.iter().map(move |square| point(square.place[0], square.place[1], z, square.weight * outer))
    };
    LINE_THREE.iter().flat_map(layer).collect()
});

/// The quadrature points of an element kind, by local number.
pub fn gauss_points(kind: ElementKind) -> &'static [GaussPoint] {
    match kind {
        ElementKind::Q4 | ElementKind::Q8 => &SQUARE_FOUR,
        ElementKind::Q4Single => &SQUARE_ONE,
        ElementKind::Q8Full => &SQUARE_NINE,
        ElementKind::T3 => &TRIANGLE_ONE,
        ElementKind::T6 => &TRIANGLE_THREE,
        ElementKind::H8 | ElementKind::H20 => &CUBE_EIGHT,
        ElementKind::H8Single => &CUBE_ONE,
        ElementKind::H20Full => &CUBE_TWENTY_SEVEN,
        ElementKind::T4 => &TETRAHEDRON_ONE,
        ElementKind::T10 => &TETRAHEDRON_FOUR,
    }
}

static TABLES: LazyLock<Vec<Vec<Shape>>> = LazyLock::new(|| {
    let table = |kind| gauss_points(kind).iter().map(|point| shape(kind, point.place)).collect();
    ElementKind::ALL.into_iter().map(table).collect()
});

/// Shape functions of a kind at its quadrature points.
pub fn shapes_at_points(kind: ElementKind) -> &'static [Shape] {
    // The variants of a fieldless enum are numbered in the order of `ALL`.
    &TABLES[kind as usize]
}
