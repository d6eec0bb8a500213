//! Quadrature rules of natural elements.

use super::dimension::Dimension;
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
pub(crate) static SQUARE_FOUR: [GaussPoint; 4] =
    [point(-TWO, -TWO, 0.0, 1.0), point(TWO, -TWO, 0.0, 1.0), point(TWO, TWO, 0.0, 1.0), point(-TWO, TWO, 0.0, 1.0)];
pub(crate) static SQUARE_ONE: [GaussPoint; 1] = [point(0.0, 0.0, 0.0, 4.0)];
pub(crate) static CUBE_ONE: [GaussPoint; 1] = [point(0.0, 0.0, 0.0, 8.0)];
/// In the order of the corners of a hexahedron.
pub(crate) static CUBE_EIGHT: [GaussPoint; 8] = [
    point(-TWO, -TWO, -TWO, 1.0),
    point(TWO, -TWO, -TWO, 1.0),
    point(TWO, TWO, -TWO, 1.0),
    point(-TWO, TWO, -TWO, 1.0),
    point(-TWO, -TWO, TWO, 1.0),
    point(TWO, -TWO, TWO, 1.0),
    point(TWO, TWO, TWO, 1.0),
    point(-TWO, TWO, TWO, 1.0),
];
pub(crate) static TRIANGLE_ONE: [GaussPoint; 1] = [point(1.0 / 3.0, 1.0 / 3.0, 0.0, 0.5)];
pub(crate) static TRIANGLE_THREE: [GaussPoint; 3] = [
    point(1.0 / 6.0, 1.0 / 6.0, 0.0, 1.0 / 6.0),
    point(2.0 / 3.0, 1.0 / 6.0, 0.0, 1.0 / 6.0),
    point(1.0 / 6.0, 2.0 / 3.0, 0.0, 1.0 / 6.0),
];
pub(crate) static TETRAHEDRON_ONE: [GaussPoint; 1] = [point(0.25, 0.25, 0.25, 1.0 / 6.0)];
pub(crate) static TETRAHEDRON_FOUR: [GaussPoint; 4] = [
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

/// 3x3 points, row by row from the lower left.
pub(crate) fn square_nine() -> &'static [GaussPoint] {
    &SQUARE_NINE
}

/// 3x3x3 points, layer by layer.
pub(crate) fn cube_twenty_seven() -> &'static [GaussPoint] {
    &CUBE_TWENTY_SEVEN
}

/// Four-point Gauss rule on 0 to 1.
const FOUR: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A product rule collapsed onto the triangle or tetrahedron, exact for polynomials of degree 4.
pub(crate) fn collapsed_points(dimension: Dimension) -> Vec<GaussPoint> {
    let mut points = Vec::new();
    for (u, wu) in FOUR {
        for (v, wv) in FOUR {
            let (x, y) = (u, v * (1.0 - u));
            match dimension {
                Dimension::Plane => {
                    points.push(GaussPoint { place: [x, y, 0.0], weight: wu * wv * (1.0 - u) });
                }
                Dimension::Space => points.extend(FOUR.iter().map(|(w, ww)| GaussPoint {
                    place: [x, y, w * (1.0 - x - y)],
                    weight: wu * wv * ww * (1.0 - u) * (1.0 - x - y),
                })),
            }
        }
    }
    points
}
