//! `[initial_stress]`.

use macro_solver::problem::{EquilibriumSettings, InitialLimits, InitialPreparation};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[initial_stress]`.
#[derive(Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(default)]
pub(crate) struct InitialStressTable {
    /// Stress expected everywhere, tension positive; a component that is left out is 0.
    #[schemars(extend("x-unit" = "Pa", "x-instead-of" = "geostatic"))]
    pub(crate) uniform: Option<StressTable>,
    /// Stress expected in level ground at rest. The vertical pressure is the surcharge plus unit weight times depth below the
    /// surface, the horizontal one K0 times that.
    #[schemars(extend("x-instead-of" = "uniform"))]
    pub(crate) geostatic: Option<GeostaticTable>,
    /// Stress of an elastic, frictional body on the mesh in equilibrium with the loads at the start: of a slope, an embankment or any other
    /// ground that is not level. Not together with `uniform` or `geostatic`.
    pub(crate) equilibrium: Option<EquilibriumSettings>,
    #[serde(flatten)]
    pub(crate) limits: InitialLimits,
    #[serde(flatten)]
    pub(crate) preparation: InitialPreparation,
}

/// Components of a symmetric stress.
#[derive(Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-folded" = true))]
pub(crate) struct StressTable {
    /// Normal stress along x.
    pub(crate) xx: f64,
    /// Normal stress along y.
    pub(crate) yy: f64,
    /// Normal stress along z.
    pub(crate) zz: f64,
    /// Shear stress in the plane.
    pub(crate) xy: f64,
    /// Shear stress between x and z.
    pub(crate) xz: f64,
    /// Shear stress between y and z.
    pub(crate) yz: f64,
}

/// `geostatic` of `[initial_stress]`.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GeostaticTable {
    /// Height of the surface along y.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) surface: f64,
    /// Weight per volume.
    #[schemars(extend("x-unit" = "N/m3"))]
    pub(crate) unit_weight: f64,
    /// Earth-pressure coefficient at rest K0: horizontal over vertical pressure.
    #[schemars(extend("x-unit" = "-"))]
    pub(crate) rest_coefficient: f64,
    /// Pressure on the surface.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa"))]
    pub(crate) surcharge: f64,
}
