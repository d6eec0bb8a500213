//! Kinds of elements: one file for each family, one list.
//!
//! An [`ElementDefinition`] is all that a kind consists of: an [`Interpolation`] (nodes, shape functions, sides, numbers in file
//! formats) and its quadrature. A new kind is a variant of [`ElementKind`], a definition in the file of its family, and a line in
//! `DEFINITIONS`; nothing else matches on kinds.
//!
//! Corners come first. Corners of plane elements run counter-clockwise, mid-side nodes follow in the order of the
//! sides. A hexahedron has its first four corners counter-clockwise on the face of smallest third natural
//! coordinate, the next four above them; then, for H20, the middles of the four lower edges, of the four upper ones
//! and of the four between. A tetrahedron's fourth corner lies on the side to which the first three turn
//! counter-clockwise; the middles of T10 lie on the edges 01, 12, 20, 03, 13, 23. This is the order of VTK files.

mod barycentric;
mod hexahedron;
mod quadrilateral;
mod tetrahedron;
mod triangle;

pub(crate) use quadrilateral::{bilinear, serendipity};
pub(crate) use triangle::{linear_triangle, quadratic_triangle};

use super::quadrature::GaussPoint;
use super::{Dimension, Shape};
use schemars::JsonSchema;
use serde::Deserialize;
use vtkio::model::CellType;

/// Shape functions and quadrature of an element; read from the keyword that [`ElementKind::keyword`] gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ElementKind {
    /// Bilinear quadrilateral, 2x2 points.
    Q4,
    /// Bilinear quadrilateral, one point and hourglass control.
    Q4Single,
    /// Serendipity quadrilateral, 2x2 points (reduced).
    Q8,
    /// Serendipity quadrilateral, 3x3 points (full).
    Q8Full,
    /// Linear triangle, one point.
    T3,
    /// Quadratic triangle, three points.
    T6,
    /// Trilinear hexahedron, 2x2x2 points.
    H8,
    /// Trilinear hexahedron, one point and hourglass control.
    H8Single,
    /// Serendipity hexahedron, 2x2x2 points (reduced).
    H20,
    /// Serendipity hexahedron, 3x3x3 points (full).
    H20Full,
    /// Linear tetrahedron, one point.
    T4,
    /// Quadratic tetrahedron, four points.
    T10,
}

/// All definitions, in the order of the variants of [`ElementKind`].
static DEFINITIONS: [&ElementDefinition; 12] = [
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

/// One kind of element.
pub(crate) struct ElementDefinition {
    /// Its label.
    pub(crate) kind: ElementKind,
    /// Keyword of scene files.
    pub(crate) keyword: &'static str,
    /// Nodes and shape functions.
    pub(crate) interpolation: Interpolation,
    /// Number of Gauss points.
    pub(crate) point_count: usize,
    /// Gauss points, by local number.
    pub(crate) points: fn() -> &'static [GaussPoint],
    /// Points that integrate the square of every shape function exactly over the natural element, for lumped masses.
    pub(crate) mass_points: fn() -> Vec<GaussPoint>,
    /// What the single point of an element with hourglass modes stands for; `None` without such modes.
    pub(crate) single_point: Option<SinglePoint>,
}

/// Gradients at the single Gauss point of an element whose hourglass modes need control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SinglePoint {
    /// Those at the centre.
    Centre,
    /// Their mean over the element (Flanagan and Belytschko 1981), taken over the points of this kind: those at the centre would
    /// fail the patch test on irregular hexahedra.
    MeanOver(ElementKind),
}

/// Nodes, shape functions and sides that several kinds may share.
#[derive(Clone, Copy)]
pub(crate) struct Interpolation {
    /// Plane or spatial.
    pub(crate) dimension: Dimension,
    /// Natural coordinates of the nodes.
    pub(crate) places: &'static [[f64; 3]],
    /// Nodes without the middles of edges.
    pub(crate) corner_count: usize,
    /// Shape functions at natural coordinates.
    pub(crate) shape: fn([f64; 3]) -> Shape,
    /// The two corners between which each middle node lies, in the order of the middle nodes.
    pub(crate) middles: &'static [[usize; 2]],
    /// Local nodes of every side, corners first; of a linear element only the corners count.
    pub(crate) sides: &'static [&'static [usize]],
    /// Shape of all sides.
    pub(crate) side_kind: SideKind,
    /// Cell type in VTK files.
    pub(crate) vtk: CellType,
    /// Number of the shape in Gmsh files.
    pub(crate) gmsh: u32,
    /// Place in Gmsh's order of each node; empty: the same order.
    pub(crate) gmsh_order: &'static [usize],
}

/// Shape of a side of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SideKind {
    /// Straight edge: start, end.
    Line2,
    /// Quadratic edge: start, end, middle.
    Line3,
    /// Linear triangle.
    Triangle3,
    /// Quadratic triangle.
    Triangle6,
    /// Bilinear quadrilateral.
    Quad4,
    /// Serendipity quadrilateral.
    Quad8,
}

impl ElementKind {
    /// All kinds.
    pub const ALL: [Self; 12] = [
        Self::Q4,
        Self::Q4Single,
        Self::Q8,
        Self::Q8Full,
        Self::T3,
        Self::T6,
        Self::H8,
        Self::H8Single,
        Self::H20,
        Self::H20Full,
        Self::T4,
        Self::T10,
    ];

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

    /// The keyword of scene files.
    pub fn keyword(self) -> &'static str {
        self.definition().keyword
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

impl SideKind {
    /// Nodes of one side.
    pub fn node_count(self) -> usize {
        match self {
            Self::Line2 => 2,
            Self::Line3 | Self::Triangle3 => 3,
            Self::Quad4 => 4,
            Self::Triangle6 => 6,
            Self::Quad8 => 8,
        }
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
            let Interpolation { places, corner_count, middles, .. } = definition.interpolation;
            assert_eq!(places.len(), corner_count + middles.len(), "{kind:?}");
        }
    }
}
