//! The table `[[stage]]`: what moves, and what is held at a stress.

use super::axes::{AXES, axis_of};
use crate::error::DefinitionError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most steps and rows of a stage: the product of both is a number of 64 bits.
const MOST_STEPS: u64 = u32::MAX as u64;

/// One stage. Each axis has at most one of a strain and a stress; axes with neither keep their walls or periods. Walls can be
/// sheared whatever moves them along their normals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Name in the table of results.
    pub name: String,
    /// Steps of the stage, or the most of them if `until_balance` is given.
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// Ends the stage when the unbalanced force over the mean contact force, and the distance of wall stresses from their
    /// targets over the mean target, are below this, and with gravity no grain is without contact. Not in a stage that strains or shears.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub until_balance: Option<f64>,
    /// Strain over the stage per axis, relative to its start, extension positive: of walls, or of periodic sides.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-"))]
    pub strain: AxisTable,
    /// Stress on the walls per axis, Pa, tension positive.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa"))]
    pub stress: AxisTable,
    /// Shear over the stage: displacement of the upper wall of an axis over the distance of both walls at the start of the stage,
    /// the lower wall held. Where the axis is periodic, its images are displaced instead (Lees-Edwards).
    #[serde(default)]
    #[schemars(extend("x-unit" = "-"))]
    pub shear: ShearTable,
    /// Axes (`"x"`, `"y"`, `"z"`) whose walls grip from the start of this stage on: the grains within `walls.glue_depth`, or those
    /// that touch if that is 0, move with their wall as a rigid layer and do not rotate.
    #[serde(default)]
    pub glue: Vec<String>,
    /// Rows of the result table in this stage.
    #[serde(default = "some_rows")]
    #[schemars(range(min = 1))]
    pub rows: u64,
    /// Friction between the grains in this stage, if not that of `[contact]`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "x-default" = "that of `[contact]`"), range(min = 0.0))]
    pub friction: Option<f64>,
}

fn some_rows() -> u64 {
    20
}

/// Values by axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-folded" = true))]
pub struct AxisTable {
    /// Along x.
    pub xx: Option<f64>,
    /// Along y.
    pub yy: Option<f64>,
    /// Along z.
    pub zz: Option<f64>,
}

impl AxisTable {
    /// Values along x, y and z; `None` where the table has no such key.
    pub fn values(&self) -> [Option<f64>; 3] {
        [self.xx, self.yy, self.zz]
    }
}

/// Shear by component: the first letter is the direction of the motion, the second the axis whose upper wall, or image, moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-folded" = true))]
pub struct ShearTable {
    /// The upper y wall along x.
    pub xy: Option<f64>,
    /// The upper z wall along x.
    pub xz: Option<f64>,
    /// The upper z wall along y.
    pub yz: Option<f64>,
    /// The upper x wall along y.
    pub yx: Option<f64>,
    /// The upper x wall along z.
    pub zx: Option<f64>,
    /// The upper y wall along z.
    pub zy: Option<f64>,
}

/// A component of shear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Sheared {
    /// Axis whose upper wall, or image, moves.
    pub side: usize,
    /// Axis along which it moves.
    pub along: usize,
    /// Key, such as `xy`.
    pub name: &'static str,
}

/// All components of [`ShearTable`], in its order.
const COMPONENTS: [Sheared; 6] = [
    Sheared { along: 0, side: 1, name: "xy" },
    Sheared { along: 0, side: 2, name: "xz" },
    Sheared { along: 1, side: 2, name: "yz" },
    Sheared { along: 1, side: 0, name: "yx" },
    Sheared { along: 2, side: 0, name: "zx" },
    Sheared { along: 2, side: 1, name: "zy" },
];

impl ShearTable {
    /// Values in the order of [`COMPONENTS`].
    fn values(&self) -> [Option<f64>; 6] {
        [self.xy, self.xz, self.yz, self.yx, self.zx, self.zy]
    }

    /// The components that the table has.
    pub(super) fn components(&self) -> impl Iterator<Item = Sheared> + use<> {
        COMPONENTS.into_iter().zip(self.values()).filter_map(|(component, value)| value.map(|_| component))
    }

    /// Shear of the upper side of axis `side` along every axis.
    pub(super) fn of_side(&self, side: usize) -> [f64; 3] {
        let mut along = [0.0; 3];
        for (component, value) in COMPONENTS.iter().zip(self.values()) {
            if component.side == side {
                along[component.along] = value.unwrap_or(0.0);
            }
        }
        along
    }
}

impl Stage {
    pub(super) fn validate(&self, dimension: usize, periodic: [bool; 3]) -> Result<(), DefinitionError> {
        if self.steps == 0 || self.rows == 0 {
            return Err(DefinitionError("steps and rows must be at least 1".into()));
        }
        if let Some((key, value)) =
            [("steps", self.steps), ("rows", self.rows)].iter().find(|(_, value)| *value > MOST_STEPS)
        {
            return Err(DefinitionError(format!("{key} = {value} must be at most {MOST_STEPS}")));
        }
        if self.until_balance.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
            return Err(DefinitionError("until_balance must be a positive number".into()));
        }
        let strains = self.strain.values().into_iter().flatten();
        let shears = (0..dimension).flat_map(|axis| self.shear.of_side(axis));
        if self.until_balance.is_some() && strains.chain(shears).any(|strain| strain != 0.0) {
            return Err(DefinitionError(
                "until_balance would end the stage before it has strained as far as it should; strain in a stage without it, and let the \
                 grains come to balance in the next one"
                    .into(),
            ));
        }
        if self.friction.is_some_and(|value| !(value.is_finite() && value >= 0.0)) {
            return Err(DefinitionError("friction must be zero or positive".into()));
        }
        for (axis, (strain, stress)) in self.strain.values().into_iter().zip(self.stress.values()).enumerate() {
            let name = ["xx", "yy", "zz"][axis];
            if (strain.is_some() || stress.is_some()) && axis >= dimension {
                return Err(DefinitionError(format!("{name} has no walls in this specimen")));
            }
            if stress.is_some() && periodic[axis] {
                return Err(DefinitionError(format!(
                    "stress.{name}: {} is periodic and has no walls; give strain.{name}, or take it out of `periodic`",
                    AXES[axis]
                )));
            }
            if strain.is_some() && stress.is_some() {
                return Err(DefinitionError(format!("{name}: give strain or stress, not both")));
            }
            if strain.is_some_and(|value| !(value > -0.9 && value < 10.0)) {
                return Err(DefinitionError(format!("strain.{name} must lie between -0.9 and 10")));
            }
            if stress.is_some_and(|value| !(value.is_finite() && value < 0.0)) {
                return Err(DefinitionError(format!(
                    "stress.{name} must be compressive (negative): grains bear no tension; for a free surface give strain.{name} instead, which \
                     draws both walls off the grains"
                )));
            }
        }
        self.check_shear(dimension, periodic)?;
        for name in &self.glue {
            match axis_of(name) {
                Some(axis) if axis < dimension && !periodic[axis] => {}
                _ => {
                    return Err(DefinitionError(format!("glue = \"{name}\" is no axis with walls in this specimen")));
                }
            }
        }
        Ok(())
    }

    fn check_shear(&self, dimension: usize, periodic: [bool; 3]) -> Result<(), DefinitionError> {
        for (Sheared { side, along, name }, value) in COMPONENTS.into_iter().zip(self.shear.values()) {
            let Some(value) = value else { continue };
            if side >= dimension || along >= dimension {
                return Err(DefinitionError(format!("shear.{name} needs a specimen in space")));
            }
            if !(value.is_finite() && value.abs() <= 10.0) {
                return Err(DefinitionError(format!("shear.{name} must lie between -10 and 10")));
            }
            if periodic[side] && !periodic[along] {
                return Err(DefinitionError(format!(
                    "shear.{name}: the images of {} would move against the walls of {}; make both periodic, or neither",
                    AXES[side], AXES[along]
                )));
            }
            if periodic[side] && along > side {
                return Err(DefinitionError(format!(
                    "shear.{name}: between periodic axes give shear.{}{}: a specimen keeps Y1 along x and Y2 in the plane of x and y",
                    AXES[side], AXES[along]
                )));
            }
        }
        Ok(())
    }

    /// Numbers of the axes of `glue`.
    pub(super) fn glued_axes(&self) -> Vec<usize> {
        self.glue.iter().filter_map(|name| axis_of(name)).collect()
    }

    /// Whether the stage strains or shears the sides of an axis.
    pub(super) fn moves(&self, axis: usize) -> bool {
        self.strain.values()[axis].is_some() || self.shear.components().any(|component| component.side == axis)
    }
}
