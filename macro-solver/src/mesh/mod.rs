//! Nodes, elements and named sets of a plane or spatial mesh, which may mix element kinds.
//!
//! Positions always have three coordinates; those of a plane mesh have `z = 0` and lie in a body of unit thickness.
//! The order of an element's nodes and sides is that of [`ElementKind`]; Gauss points are numbered through, element by
//! element ([`Mesh::first_points`]).

use std::collections::BTreeMap;
use thiserror::Error;

pub mod block;
pub mod geotechnical;
pub mod gmsh;
mod identity;
mod lattice;
pub mod ring;
mod seams;
mod validation;

pub use crate::element::{Dimension, ElementKind, SideKind};

pub use seams::{Seam, SeamKind};

use crate::element::side::{area_vector, side_shapes};
use crate::element::{point_geometry, shapes_at_points};
use nalgebra::Vector3;

/// Sum of the area vectors of a side set over the sum of their lengths, below which it has no direction: that of a closed surface is rounding.
const LEAST_DIRECTION: f64 = 1e-6;

/// One side of one element: an edge of a plane element, a face of a solid one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Side {
    /// Element, from 0.
    pub element: usize,
    /// Local side, from 0, in the order of [`ElementKind::side`].
    pub local: usize,
}

/// A mesh. Lengths in m.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Plane or spatial.
    pub dimension: Dimension,
    /// Initial positions, m; `z` is 0 in the plane.
    pub nodes: Vec<[f64; 3]>,
    /// Node numbers of each element, in the order of its kind.
    pub elements: Vec<Vec<usize>>,
    /// Kind of each element.
    pub kinds: Vec<ElementKind>,
    /// Named node sets, each sorted.
    pub node_sets: BTreeMap<String, Vec<usize>>,
    /// Named side sets, each sorted.
    pub side_sets: BTreeMap<String, Vec<Side>>,
    /// Named element sets, the regions of the body, each sorted.
    pub element_sets: BTreeMap<String, Vec<usize>>,
}

impl Mesh {
    /// A mesh of one element kind without sets, from node positions (m) and the nodes of every element in the order of its kind.
    pub fn uniform(kind: ElementKind, nodes: Vec<[f64; 3]>, elements: Vec<Vec<usize>>) -> Self {
        let kinds = vec![kind; elements.len()];
        Self {
            dimension: kind.dimension(),
            nodes,
            elements,
            kinds,
            node_sets: BTreeMap::new(),
            side_sets: BTreeMap::new(),
            element_sets: BTreeMap::new(),
        }
    }

    /// Degrees of freedom: `dimension x nodes`, numbered `dimension * node + axis`.
    pub fn degrees_of_freedom(&self) -> usize {
        self.dimension.count() * self.nodes.len()
    }

    /// Number of the first Gauss point of each element, and after the last one the number of all points.
    pub fn first_points(&self) -> Vec<usize> {
        let mut next = 0;
        let mut firsts = Vec::with_capacity(self.kinds.len() + 1);
        firsts.push(0);
        for kind in &self.kinds {
            next += kind.point_count();
            firsts.push(next);
        }
        firsts
    }

    /// Gauss points of all elements.
    pub fn point_count(&self) -> usize {
        self.kinds.iter().map(|kind| kind.point_count()).sum()
    }

    /// Positions of the nodes of one element, m.
    pub fn element_positions(&self, element: usize) -> Vec<[f64; 3]> {
        self.elements[element].iter().map(|&node| self.nodes[node]).collect()
    }

    /// Node numbers of a side, in the order of its [`SideKind`]: seen from outside, the corners of a face run
    /// counter-clockwise; the body lies to the left of an edge.
    pub fn side_nodes(&self, side: Side) -> Vec<usize> {
        let nodes = &self.elements[side.element];
        self.kinds[side.element].side(side.local).iter().map(|&local| nodes[local]).collect()
    }

    /// Unit outward normal of a side set, averaged over its area; `None` for one that does not exist or has no direction in common, as around
    /// a hole.
    pub fn mean_normal(&self, side_set: &str) -> Option<[f64; 3]> {
        let (mut sum, mut area) = (Vector3::zeros(), 0.0);
        for &side in self.side_sets.get(side_set)? {
            let nodes = self.side_nodes(side);
            for shape in side_shapes(self.kinds[side.element].side_kind()) {
                let part = area_vector(shape, &nodes, &self.nodes) * shape.weight;
                sum += part;
                area += part.norm();
            }
        }
        let length = sum.norm();
        (length > LEAST_DIRECTION * area).then(|| (sum / length).into())
    }

    /// The kinds that occur, in the order of [`ElementKind::ALL`].
    pub fn kinds_present(&self) -> Vec<ElementKind> {
        ElementKind::ALL.into_iter().filter(|kind| self.kinds.contains(kind)).collect()
    }
}

/// Why a mesh was refused. Elements and nodes are counted from 0.
#[derive(Debug, Error, PartialEq)]
pub enum MeshError {
    /// No element at all.
    #[error("the mesh has no elements")]
    Empty,
    /// One kind per element is needed.
    #[error("the mesh has {elements} elements but {kinds} element kinds")]
    KindCount {
        /// Elements.
        elements: usize,
        /// Kinds given.
        kinds: usize,
    },
    /// A plane element in a spatial mesh or the reverse.
    #[error("element {element} is a {kind:?}, which does not fit into a mesh of dimension {dimension}")]
    MixedDimensions {
        /// Element.
        element: usize,
        /// Its kind.
        kind: ElementKind,
        /// Dimension of the mesh.
        dimension: usize,
    },
    /// Wrong number of nodes for the element kind.
    #[error("element {element} has {found} nodes, {kind:?} needs {expected}")]
    NodeCount {
        /// Element.
        element: usize,
        /// Nodes given.
        found: usize,
        /// Nodes needed.
        expected: usize,
        /// Kind of the element.
        kind: ElementKind,
    },
    /// Two elements with the same nodes.
    #[error("elements {first} and {second} have the same nodes: the body would be there twice")]
    SameNodes {
        /// The one.
        first: usize,
        /// The other.
        second: usize,
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
    /// A side set names an element or side that does not exist.
    #[error("side set '{set}' refers to side {local} of element {element}, which does not exist")]
    NoSuchSide {
        /// Side set.
        set: String,
        /// Element.
        element: usize,
        /// Side.
        local: usize,
    },
    /// An element set names an element that does not exist.
    #[error("element set '{set}' refers to element {element}, which does not exist")]
    NoSuchElement {
        /// Element set.
        set: String,
        /// Element.
        element: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} has a coordinate that is not a finite number")]
    NotFinite {
        /// Node.
        node: usize,
    },
    /// A node of a plane mesh that does not lie in the plane.
    #[error("node {node} has z = {height:.6e} m, but the mesh is plane")]
    OutOfPlane {
        /// Node.
        node: usize,
        /// Its third coordinate, m.
        height: f64,
    },
    /// The mapping of an element is not invertible.
    #[error(
        "element {element} is inverted or degenerate: det J = {determinant:.6e} at Gauss point {point} \
         (are its corners listed in the order of the element kind, counter-clockwise in the plane?)"
    )]
    Inverted {
        /// Element.
        element: usize,
        /// Local Gauss point.
        point: usize,
        /// Determinant of the Jacobian, m2 or m3.
        determinant: f64,
    },
    /// The mapping of an element turns over near one of its corners.
    #[error(
        "element {element} is folded at node {node}: det J = {determinant:.6e} (its angle there exceeds 180 degrees, or \
         its middle nodes are not between its corners)"
    )]
    Folded {
        /// Element.
        element: usize,
        /// Node of the corner.
        node: usize,
        /// Determinant of the Jacobian, m2 or m3.
        determinant: f64,
    },
    /// A node that no element uses would leave the equations singular.
    #[error(
        "node {node} belongs to no element: Gmsh saves no elements of a surface or volume that is in no physical group, if there is any group"
    )]
    LooseNode {
        /// Node.
        node: usize,
    },
    /// A ring needs a hole, and enough elements around it to close.
    #[error(
        "a ring with a hole of radius {inner} m and {around} elements around is not possible: it takes a positive radius and at least \
         {least} elements"
    )]
    Ring {
        /// Radius of the hole, m.
        inner: f64,
        /// Elements around.
        around: usize,
        /// Fewest that close.
        least: usize,
    },
    /// A generator needs positive lengths and at least one element each way.
    #[error("a block of {size} m with {elements} elements is not possible")]
    Block {
        /// Sides, m.
        size: String,
        /// Elements each way.
        elements: String,
    },
}

/// Where a mesh has a defect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshPlace {
    /// At an element.
    Element(usize),
    /// At a node.
    Node(usize),
    /// At neither.
    Mesh,
}

impl MeshError {
    /// Where the defect is.
    pub fn place(&self) -> MeshPlace {
        match *self {
            Self::MixedDimensions { element, .. }
            | Self::NodeCount { element, .. }
            | Self::NoSuchSide { element, .. }
            | Self::Inverted { element, .. }
            | Self::Folded { element, .. } => MeshPlace::Element(element),
            Self::SameNodes { second, .. } => MeshPlace::Element(second),
            Self::NotFinite { node } | Self::OutOfPlane { node, .. } | Self::LooseNode { node } => {
                MeshPlace::Node(node)
            }
            _ => MeshPlace::Mesh,
        }
    }

    /// The same with other numbers of elements and nodes, such as those of the file that the mesh comes from.
    #[must_use]
    pub fn renumbered(mut self, of_element: impl Fn(usize) -> usize, of_node: impl Fn(usize) -> usize) -> Self {
        match &mut self {
            Self::MixedDimensions { element, .. }
            | Self::NodeCount { element, .. }
            | Self::NoSuchSide { element, .. }
            | Self::NoSuchElement { element, .. }
            | Self::Inverted { element, .. } => *element = of_element(*element),
            Self::Folded { element, node, .. } => (*element, *node) = (of_element(*element), of_node(*node)),
            Self::SameNodes { first, second } => (*first, *second) = (of_element(*first), of_element(*second)),
            Self::NotFinite { node } | Self::OutOfPlane { node, .. } | Self::LooseNode { node } => {
                *node = of_node(*node)
            }
            Self::Empty
            | Self::KindCount { .. }
            | Self::NoSuchNode { .. }
            | Self::Ring { .. }
            | Self::Block { .. } => {}
        }
        self
    }
}

/// Initial volumes of all Gauss points of a mesh, m3; in the plane areas, m2.
pub fn point_volumes(mesh: &Mesh) -> Vec<f64> {
    let of_element = |element: usize| {
        let (kind, positions) = (mesh.kinds[element], mesh.element_positions(element));
        (0..kind.point_count()).map(move |local| point_geometry(kind, &positions, local).volume)
    };
    (0..mesh.elements.len()).flat_map(of_element).collect()
}

/// Initial places of all Gauss points of a mesh, m.
pub fn point_places(mesh: &Mesh) -> Vec<[f64; 3]> {
    let of_element = |element: usize| {
        let positions = mesh.element_positions(element);
        shapes_at_points(mesh.kinds[element]).iter().map(move |shape| {
            let mut place = [0.0; 3];
            for (position, value) in positions.iter().zip(&shape.values) {
                (0..3).for_each(|axis| place[axis] += value * position[axis]);
            }
            place
        })
    };
    (0..mesh.elements.len()).flat_map(of_element).collect()
}

/// Volume of a mesh by its quadrature, m3, in the plane m2.
#[cfg(test)]
fn volume(mesh: &Mesh) -> f64 {
    let of = |element: usize| -> f64 {
        let (kind, positions) = (mesh.kinds[element], mesh.element_positions(element));
        (0..kind.point_count()).map(|local| crate::element::point_geometry(kind, &positions, local).volume).sum()
    };
    (0..mesh.elements.len()).map(of).sum()
}
