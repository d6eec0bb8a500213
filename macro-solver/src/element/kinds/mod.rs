//! Kinds of elements: one file for each family, one list.
//!
//! An [`ElementDefinition`] is all that a kind consists of: an [`Interpolation`] (nodes, shape functions, sides, numbers in file
//! formats) and its quadrature. A new kind is a variant of [`ElementKind`] with its keyword, a definition in the file of its family, and a
//! line in `DEFINITIONS`; nothing else matches on kinds.
//!
//! Corners come first. Corners of plane elements run counter-clockwise, mid-side nodes follow in the order of the
//! sides. A hexahedron has its first four corners counter-clockwise on the face of smallest third natural
//! coordinate, the next four above them; then, for H20, the middles of the four lower edges, of the four upper ones
//! and of the four between. A tetrahedron's fourth corner lies on the side to which the first three turn
//! counter-clockwise; the middles of T10 lie on the edges 01, 12, 20, 03, 13, 23. This is the order of VTK files.

mod barycentric;
mod definition;
mod hexahedron;
mod quadrilateral;
mod tetrahedron;
mod triangle;

pub use definition::{ElementKind, SideKind};
pub(crate) use definition::{Interpolation, SinglePoint};
pub(crate) use quadrilateral::{bilinear, serendipity};
pub(crate) use triangle::{linear_triangle, quadratic_triangle};

use super::dimension::Dimension;
use definition::ElementDefinition;

/// All definitions, in the order of the variants of [`ElementKind`].
static DEFINITIONS: [&ElementDefinition; ElementKind::ALL.len()] = [
    &quadrilateral::Q4,
    &quadrilateral::Q4_SINGLE,
    &quadrilateral::Q8,
    &quadrilateral::Q8_FULL,
    &triangle::T3,
    &triangle::T6,
    &hexahedron::H8,
    &hexahedron::H8_SINGLE,
    &hexahedron::H20,
    &hexahedron::H20_FULL,
    &tetrahedron::T4,
    &tetrahedron::T10,
];

impl ElementKind {
    /// Everything about the kind.
    pub(crate) fn definition(self) -> &'static ElementDefinition {
        let definition = DEFINITIONS[self as usize];
        debug_assert_eq!(definition.kind, self, "the list has the order of the kinds");
        definition
    }

    /// Its nodes and shape functions.
    pub(crate) fn interpolation(self) -> &'static Interpolation {
        &self.definition().interpolation
    }

    /// Plane or spatial.
    pub fn dimension(self) -> Dimension {
        self.interpolation().dimension
    }

    /// Nodes of one element.
    pub fn node_count(self) -> usize {
        self.interpolation().places.len()
    }

    /// Gauss points of one element.
    pub fn point_count(self) -> usize {
        self.definition().point_count
    }

    /// Whether one Gauss point leaves hourglass modes that need control.
    pub fn needs_hourglass_control(self) -> bool {
        self.definition().single_point.is_some()
    }

    /// Whether edges have middle nodes.
    pub fn is_quadratic(self) -> bool {
        !self.middles().is_empty()
    }

    /// The element's corners: its nodes without the middles of its edges.
    pub fn corner_count(self) -> usize {
        self.interpolation().corner_count
    }

    /// The two corners between which each middle node lies, in the order of the middle nodes.
    pub fn middles(self) -> &'static [[usize; 2]] {
        self.interpolation().middles
    }

    /// Edges of a plane element, faces of a solid one.
    pub fn side_count(self) -> usize {
        self.interpolation().sides.len()
    }

    /// Shape of all sides.
    pub fn side_kind(self) -> SideKind {
        self.interpolation().side_kind
    }

    /// Local nodes of local side `side`, corners first.
    ///
    /// # Panics
    /// If there is no such side; [`crate::mesh::Mesh::validate`] finds that first.
    pub fn side(self, side: usize) -> &'static [usize] {
        let interpolation = self.interpolation();
        &interpolation.sides[side][..interpolation.side_kind.node_count()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_are_listed_in_the_order_of_the_kinds() {
        for (kind, definition) in ElementKind::ALL.into_iter().zip(DEFINITIONS) {
            assert_eq!(definition.kind, kind);
            assert_eq!(kind as usize, ElementKind::ALL.iter().position(|other| *other == kind).unwrap());
            assert_eq!(serde_json::from_value::<ElementKind>(kind.keyword().into()).unwrap(), kind);
            let Interpolation { places, corner_count, middles, .. } = definition.interpolation;
            assert_eq!(places.len(), corner_count + middles.len(), "{kind:?}");
        }
    }
}
