//! What a kind of element consists of, and the list of kinds.

use crate::element::dimension::Dimension;
use crate::element::quadrature::GaussPoint;
use crate::element::shape::Shape;
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

protocol::keywords! {
    pub ElementKind {
        Q4 => "q4",
        Q4Single => "q4_single",
        Q8 => "q8",
        Q8Full => "q8_full",
        T3 => "t3",
        T6 => "t6",
        H8 => "h8",
        H8Single => "h8_single",
        H20 => "h20",
        H20Full => "h20_full",
        T4 => "t4",
        T10 => "t10",
    }
}

/// One kind of element.
pub(crate) struct ElementDefinition {
    /// Its label.
    pub(crate) kind: ElementKind,
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

    /// Corners of one side: the first of its nodes.
    pub fn corner_count(self) -> usize {
        match self {
            Self::Line2 | Self::Line3 => 2,
            Self::Triangle3 | Self::Triangle6 => 3,
            Self::Quad4 | Self::Quad8 => 4,
        }
    }
}
