//! Kinds of elements: their nodes, sides and number of Gauss points.
//!
//! Corners come first. Corners of plane elements run counter-clockwise, mid-side nodes follow in the order of the
//! sides. A hexahedron has its first four corners counter-clockwise on the face of smallest third natural
//! coordinate, the next four above them; then, for H20, the middles of the four lower edges, of the four upper ones
//! and of the four between. A tetrahedron's fourth corner lies on the side to which the first three turn
//! counter-clockwise; the middles of T10 lie on the edges 01, 12, 20, 03, 13, 23. This is the order of VTK files.

use super::Dimension;
use schemars::JsonSchema;
use serde::Deserialize;

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

const QUAD_EDGES: [&[usize]; 4] = [&[0, 1, 4], &[1, 2, 5], &[2, 3, 6], &[3, 0, 7]];
const TRIANGLE_EDGES: [&[usize]; 3] = [&[0, 1, 3], &[1, 2, 4], &[2, 0, 5]];
/// Faces towards -x, +x, -y, +y, -z, +z of the natural coordinates, corners then middles, outward normals.
const HEXAHEDRON_FACES: [&[usize]; 6] = [
    &[0, 4, 7, 3, 16, 15, 19, 11],
    &[1, 2, 6, 5, 9, 18, 13, 17],
    &[0, 1, 5, 4, 8, 17, 12, 16],
    &[3, 7, 6, 2, 19, 14, 18, 10],
    &[0, 3, 2, 1, 11, 10, 9, 8],
    &[4, 5, 6, 7, 12, 13, 14, 15],
];
/// Corners of the edge on which each middle node lies, in the order of the middle nodes.
const QUAD_MIDDLES: [[usize; 2]; 4] = [[0, 1], [1, 2], [2, 3], [3, 0]];
const TRIANGLE_MIDDLES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
const HEXAHEDRON_MIDDLES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
const TETRAHEDRON_MIDDLES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const TETRAHEDRON_FACES: [&[usize]; 4] =
    [&[0, 2, 1, 6, 5, 4], &[0, 1, 3, 4, 8, 7], &[1, 2, 3, 5, 9, 8], &[0, 3, 2, 7, 9, 6]];

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

    /// The keyword of scene files.
    pub fn keyword(self) -> &'static str {
        match self {
            Self::Q4 => "q4",
            Self::Q4Single => "q4_single",
            Self::Q8 => "q8",
            Self::Q8Full => "q8_full",
            Self::T3 => "t3",
            Self::T6 => "t6",
            Self::H8 => "h8",
            Self::H8Single => "h8_single",
            Self::H20 => "h20",
            Self::H20Full => "h20_full",
            Self::T4 => "t4",
            Self::T10 => "t10",
        }
    }

    /// Plane or spatial.
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Q4 | Self::Q4Single | Self::Q8 | Self::Q8Full | Self::T3 | Self::T6 => Dimension::Plane,
            Self::H8 | Self::H8Single | Self::H20 | Self::H20Full | Self::T4 | Self::T10 => Dimension::Space,
        }
    }

    /// Nodes of one element.
    pub fn node_count(self) -> usize {
        match self {
            Self::T3 => 3,
            Self::Q4 | Self::Q4Single | Self::T4 => 4,
            Self::T6 => 6,
            Self::Q8 | Self::Q8Full | Self::H8 | Self::H8Single => 8,
            Self::T10 => 10,
            Self::H20 | Self::H20Full => 20,
        }
    }

    /// Gauss points of one element.
    pub fn point_count(self) -> usize {
        match self {
            Self::Q4Single | Self::T3 | Self::H8Single | Self::T4 => 1,
            Self::T6 => 3,
            Self::Q4 | Self::Q8 | Self::T10 => 4,
            Self::H8 | Self::H20 => 8,
            Self::Q8Full => 9,
            Self::H20Full => 27,
        }
    }

    /// Whether one Gauss point leaves hourglass modes that need control.
    pub fn needs_hourglass_control(self) -> bool {
        matches!(self, Self::Q4Single | Self::H8Single)
    }

    /// Whether edges have middle nodes.
    pub fn is_quadratic(self) -> bool {
        matches!(self, Self::Q8 | Self::Q8Full | Self::T6 | Self::H20 | Self::H20Full | Self::T10)
    }

    /// The element's corners: its nodes without the middles of its edges.
    pub fn corner_count(self) -> usize {
        match self {
            Self::T3 | Self::T6 => 3,
            Self::H8 | Self::H8Single | Self::H20 | Self::H20Full => 8,
            _ => 4,
        }
    }

    /// The two corners between which each middle node lies, in the order of the middle nodes.
    pub fn middles(self) -> &'static [[usize; 2]] {
        match self {
            Self::Q8 | Self::Q8Full => &QUAD_MIDDLES,
            Self::T6 => &TRIANGLE_MIDDLES,
            Self::H20 | Self::H20Full => &HEXAHEDRON_MIDDLES,
            Self::T10 => &TETRAHEDRON_MIDDLES,
            _ => &[],
        }
    }

    /// Edges of a plane element, faces of a solid one.
    pub fn side_count(self) -> usize {
        match self {
            Self::T3 | Self::T6 => 3,
            Self::H8 | Self::H8Single | Self::H20 | Self::H20Full => 6,
            _ => 4,
        }
    }

    /// Shape of all sides.
    pub fn side_kind(self) -> SideKind {
        match self {
            Self::Q4 | Self::Q4Single | Self::T3 => SideKind::Line2,
            Self::Q8 | Self::Q8Full | Self::T6 => SideKind::Line3,
            Self::H8 | Self::H8Single => SideKind::Quad4,
            Self::H20 | Self::H20Full => SideKind::Quad8,
            Self::T4 => SideKind::Triangle3,
            Self::T10 => SideKind::Triangle6,
        }
    }

    /// Local nodes of local side `side`, corners first.
    ///
    /// # Panics
    /// If there is no such side; [`super::Mesh::validate`] finds that first.
    pub fn side(self, side: usize) -> &'static [usize] {
        let nodes = match self {
            Self::T3 | Self::T6 => TRIANGLE_EDGES[side],
            Self::Q4 | Self::Q4Single | Self::Q8 | Self::Q8Full => QUAD_EDGES[side],
            Self::H8 | Self::H8Single | Self::H20 | Self::H20Full => HEXAHEDRON_FACES[side],
            Self::T4 | Self::T10 => TETRAHEDRON_FACES[side],
        };
        &nodes[..self.side_kind().node_count()]
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
