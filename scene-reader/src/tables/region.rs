//! `[[region]]`.

use keys::Located;
use rve_server::contact::ContactTable;
use rve_server::preparation::Removal;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Elements whose Gauss points have other grains than the rest of the scene.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RegionTable {
    /// Name for messages, probes, and the element set that `[[body_force]]` and `[[friction]]` may name: the elements of the region that
    /// no later one takes. An element set of the mesh with this name takes precedence.
    pub(crate) name: String,
    /// Element set of the region. Give this or the box `from`, `to`.
    pub(crate) elements: Option<Located<String>>,
    /// Lower corner of a box: the region holds the elements whose centres lie in it.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) from: Option<Vec<f64>>,
    /// Upper corner of the box.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) to: Option<Vec<f64>>,
    /// Packing files.
    #[serde(default)]
    #[schemars(extend("x-default" = "the packing of the scene"))]
    pub(crate) packings: Vec<Located<PathBuf>>,
    /// Angles by which the packings are turned as a whole, counter-clockwise in the plane, in space about z: cell vectors, grains
    /// and tangential forces.
    #[serde(default = "upright")]
    #[schemars(extend("x-unit" = "degrees"))]
    pub(crate) rotations: Vec<f64>,
    /// Random grains that are taken out of each packing, at most a quarter; the rest is brought back to the stress that the packing
    /// had. The same seed gives the same bits whenever the scene is read.
    pub(crate) removal: Option<Removal>,
    /// Another contact law, as a whole table.
    #[schemars(extend("x-default" = "[contact]"))]
    pub(crate) contact: Option<ContactTable>,
    /// Seed of the random choice. Required if there are several packings or rotations: every packing in every rotation then gets
    /// the same share of the points. Equal seeds give equal materials.
    #[schemars(range(max = 9_223_372_036_854_775_807_i64))]
    pub(crate) seed: Option<u64>,
    /// Whether Gauss points are sampled independently or element by element.
    #[serde(default)]
    pub(crate) vary: Vary,
}

fn upright() -> Vec<f64> {
    vec![0.0]
}

/// What is sampled where a region has several cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Vary {
    /// Every Gauss point is sampled independently.
    #[default]
    Point,
    /// The points of an element share one cell.
    Element,
}
