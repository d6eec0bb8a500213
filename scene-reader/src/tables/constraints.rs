//! `[[tilting_platen]]`, `[[normal_displacement]]`, `[[radial_displacement]]`, `[[rigid_body]]`, `[[periodic]]` and `[[sum]]`: multi-point
//! constraints. They act as supports do, with every procedure, and count from the positions at the beginning of the stage.

use super::conditions::{Components, History};
use keys::Located;
use macro_solver::problem::Axis;
use schemars::JsonSchema;
use serde::Deserialize;

/// `[[tilting_platen]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TiltingPlatenTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Node set.
    pub(crate) set: Located<String>,
    /// Normal of the platen.
    pub(crate) normal: Axis,
    /// Displacement of the middle of the platen along its normal; without it the platen moves freely, under loads.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) displacement: Option<f64>,
    /// Rotation of the platen about its middle: a prescribed tilt, with its sign by the right-hand rule. A component that is left out is
    /// free; the one along the normal has to be. In the plane there is only `z`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "rad"))]
    pub(crate) rotation: Components,
    /// Factor on displacement and rotation over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[normal_displacement]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct NormalDisplacementTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Side set.
    pub(crate) set: Located<String>,
    /// Displacement of its nodes along the outward normal at the beginning of the stage; along the side they are free. 0 is a smooth
    /// oblique support. The normal of a node is the mean of the sides of the set that meet there, also at a corner.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) displacement: f64,
    /// Factor on the displacement over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[radial_displacement]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RadialDisplacementTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Node set.
    pub(crate) set: Located<String>,
    /// Displacement of its nodes away from the centre, in the directions at the beginning of the stage; around the centre they are free.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) displacement: f64,
    /// Centre in the plane of x and y; in space a point of the axis along z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) centre: [f64; 2],
    /// Factor on the displacement over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[rigid_body]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigidBodyTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Node set.
    pub(crate) set: Located<String>,
    /// Displacement of the middle of the set; a component that is left out is free.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) displacement: Components,
    /// Rotation about the middle of the set; a component that is left out is free. In the plane there is only `z`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "rad"))]
    pub(crate) rotation: Components,
    /// Factor on displacement and rotation over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[periodic]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PeriodicTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of `from`"))]
    pub(crate) name: Option<String>,
    /// Node set.
    pub(crate) from: Located<String>,
    /// Node set: the shifted image of `from`.
    pub(crate) to: Located<String>,
    /// Displacement of `to` minus that of `from`; a component that is left out is the same for all pairs and is solved for. A mean
    /// strain `E` of a periodic cell is a jump `E L` across each pair of faces, with one node held.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) jump: Components,
    /// Factor on the jump over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[sum]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SumTable {
    /// Name by which later stages replace or remove it.
    pub(crate) name: String,
    /// Summands.
    pub(crate) terms: Vec<TermTable>,
    /// Value of the sum at factor 1 of the history.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) value: f64,
    /// Factor on the value over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// A summand of `[[sum]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TermTable {
    /// Node set, whose mean displacement counts.
    pub(crate) set: Located<String>,
    /// Component of the displacement.
    pub(crate) component: Axis,
    /// Coefficient of the summand.
    #[schemars(extend("x-unit" = "-"))]
    pub(crate) coefficient: f64,
}
