//! `[mesh]`.

use keys::Located;
use macro_solver::mesh::ElementKind;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// The keys of all generators; which of them belong together is checked where the mesh is made.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshTable {
    /// A Gmsh mesh (ASCII, format 4.1 or 2.2) in place of a generated one; only `element` may be given together with it.
    pub(crate) file: Option<Located<PathBuf>>,
    /// Generator of the mesh.
    #[schemars(extend("x-default" = "\"block\""))]
    pub(crate) generator: Option<Located<Generator>>,
    /// Lengths of the sections that the generator has. Required unless `file` is given.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) size: Option<Located<Vec<f64>>>,
    /// Number of elements of each section; triangles and tetrahedra subdivide them. Required unless `file` is given.
    pub(crate) elements: Option<Located<Vec<usize>>>,
    /// For each section the length of its last cell over that of its first.
    #[schemars(extend("x-unit" = "-", "x-default" = "1 for each section"))]
    pub(crate) grading: Option<Located<Vec<f64>>>,
    /// Horizontal extent of the inclined face. Required by the generator "slope", refused by the others.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) run: Option<Located<f64>>,
    /// Angle of the ring, counter-clockwise from the x axis: 90, 180 or 360. Refused by generators other than "ring".
    #[schemars(extend("x-unit" = "degrees", "x-default" = "90"))]
    pub(crate) angle: Option<Located<f64>>,
    /// Kind of all elements. With `file` it chooses the quadrature of elements with the same nodes.
    #[schemars(extend("x-default" = "\"q8\""))]
    pub(crate) element: Option<ElementKind>,
}

/// Mesh generators. All meshes but rings begin at the origin; x is horizontal, y vertical. Solid elements need one more section, along
/// z, and have the further side sets `back` and `front`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Generator {
    /// Sections x, y; side sets `left`, `right`, `bottom`, `top`; edges and corners as node sets such as `bottom_left`.
    #[default]
    Block,
    /// Sections body (crest and face) and toe along x, base (below the toe) and rise along y; side sets `left`, `right`,
    /// `bottom`, `crest`, `face`, `ground`.
    Slope,
    /// Sections half the footing and the surface next to it along x, depth along y; side sets `left` (symmetry), `right`,
    /// `bottom`, `top` and its parts `footing`, `surface`.
    Footing,
    /// Sections width along x, soil below the wall and the wall along y; side sets `left` and its parts `wall`, `below`,
    /// `right`, `bottom`, `top`. Nodes at the foot of the wall are in `wall`, not in `below`: the reaction of `wall` holds the share that they
    /// take of the element below, about a sixth of its height times the horizontal stress there with `q8`. Lower elements make it smaller.
    Wall,
    /// A quarter, half or whole ring about the origin. `size` is inner and outer radius, `elements` counts outwards and around;
    /// side sets `inner`, `outer`, the ends `bottom` (on the x axis) and of a quarter `left` (on the y axis); node sets `axis_x`,
    /// `axis_y`: nodes on the axes. Corners and middle nodes lie on circles.
    Ring,
}

protocol::keywords! {
    pub(crate) Generator {
        Block => "block",
        Slope => "slope",
        Footing => "footing",
        Wall => "wall",
        Ring => "ring",
    }
}
