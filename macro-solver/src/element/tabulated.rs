//! Gauss points of every element kind and the shape functions there, tabulated once.

use super::kinds::ElementKind;
use super::quadrature::GaussPoint;
use super::shape::Shape;
use std::sync::LazyLock;

/// Shape functions of an element kind at natural coordinates `place`.
pub fn shape(kind: ElementKind, place: [f64; 3]) -> Shape {
    (kind.interpolation().shape)(place)
}

/// The quadrature points of an element kind, by local number.
pub fn gauss_points(kind: ElementKind) -> &'static [GaussPoint] {
    (kind.definition().points)()
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
