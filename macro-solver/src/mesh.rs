//! Nodes, elements and named sets of a plane mesh of one element kind.
//!
//! Corner nodes of an element run counter-clockwise; the mid-side nodes of Q8 follow in the same order, node `4 + e`
//! between corners `e` and `e + 1`. Local edge `e` runs from corner `e` to corner `e + 1`, so the material lies to
//! its left and the outward normal to its right.

use std::collections::BTreeMap;
use thiserror::Error;

pub mod block;
mod validation;

/// Gauss points of every element: 2x2.
pub const POINTS_PER_ELEMENT: usize = 4;

/// Shape of all elements of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementKind {
    /// Bilinear quadrilateral.
    Q4,
    /// Serendipity quadrilateral with mid-side nodes; 2x2 Gauss points (reduced).
    Q8,
}

impl ElementKind {
    /// Nodes of one element.
    pub fn node_count(self) -> usize {
        match self {
            Self::Q4 => 4,
            Self::Q8 => 8,
        }
    }

    /// Nodes of one edge.
    pub fn edge_node_count(self) -> usize {
        match self {
            Self::Q4 => 2,
            Self::Q8 => 3,
        }
    }
}

/// One side of one element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Element, from 0.
    pub element: usize,
    /// Local edge, 0 to 3: from corner `local` to corner `local + 1`.
    pub local: usize,
}

/// A plane mesh. Lengths in m.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Initial positions, m.
    pub nodes: Vec<[f64; 2]>,
    /// Node numbers of each element, in the order of the module's first paragraph.
    pub elements: Vec<Vec<usize>>,
    /// Kind of all elements.
    pub kind: ElementKind,
    /// Named node sets, each sorted.
    pub node_sets: BTreeMap<String, Vec<usize>>,
    /// Named edge sets, each sorted.
    pub edge_sets: BTreeMap<String, Vec<Edge>>,
}

/// Why a mesh was refused. Elements and nodes are counted from 0.
#[derive(Debug, Error, PartialEq)]
pub enum MeshError {
    /// No element at all.
    #[error("the mesh has no elements")]
    Empty,
    /// Wrong number of nodes for the element kind.
    #[error("element {element} has {found} nodes, {kind:?} needs {expected}")]
    NodeCount {
        /// Element.
        element: usize,
        /// Nodes given.
        found: usize,
        /// Nodes needed.
        expected: usize,
        /// Kind of the mesh.
        kind: ElementKind,
    },
    /// A node number beyond the last node.
    #[error("{entity} refers to node {node}, but the mesh has nodes 0 to {last}")]
    NoSuchNode {
        /// Element or set.
        entity: String,
        /// Number given.
        node: usize,
        /// Last node.
        last: usize,
    },
    /// An edge set names an element or side that does not exist.
    #[error("edge set '{set}' refers to side {local} of element {element}, which does not exist")]
    NoSuchEdge {
        /// Edge set.
        set: String,
        /// Element.
        element: usize,
        /// Side.
        local: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} has a coordinate that is not a finite number")]
    NotFinite {
        /// Node.
        node: usize,
    },
    /// The mapping of an element is not invertible.
    #[error(
        "element {element} is inverted or degenerate: det J = {determinant:.6e} at Gauss point {point} \
         (are its corners listed counter-clockwise?)"
    )]
    Inverted {
        /// Element.
        element: usize,
        /// Local Gauss point.
        point: usize,
        /// Determinant of the Jacobian, m2.
        determinant: f64,
    },
    /// A node that no element uses would leave the equations singular.
    #[error("node {node} belongs to no element")]
    LooseNode {
        /// Node.
        node: usize,
    },
    /// A block needs positive lengths and at least one element each way.
    #[error("a block of {width} m x {height} m with {columns} x {rows} elements is not possible")]
    Block {
        /// Width, m.
        width: f64,
        /// Height, m.
        height: f64,
        /// Elements along x.
        columns: usize,
        /// Elements along y.
        rows: usize,
    },
}
