//! The recipe of a packing: the TOML description that `grainspan pack` reads.

use super::grading::Grading;
use super::stress_target::StressTarget;
use crate::contact::ContactTable;
use crate::definition::{MOST_GRAINS, PackingError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Smallest tolerance that rounding lets a packing reach.
const LEAST_TOLERANCE: f64 = 1e-13;

/// The description of a packing. `[contact]` holds the law during preparation: its `friction` is the preparation
/// friction, low values give dense packings. The packing may be used with any other law later.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PackingRecipe {
    /// 2 for discs, 3 for spheres.
    #[serde(default = "plane_dimension", skip_serializing_if = "is_plane")]
    #[schemars(range(min = 2, max = 3), extend("x-default" = "2"))]
    pub dimension: u32,
    /// Number of grains, before any are removed.
    #[schemars(range(min = 10, max = MOST_GRAINS))]
    pub number: usize,
    /// Seed of the random generator.
    pub seed: u64,
    /// Target isotropic pressure, Pa, compression positive. Either this or `stress`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "Pa", "x-instead-of" = "stress"))]
    pub pressure: Option<f64>,
    /// Target stress tensor, Pa, tension positive, symmetric; axis 1 is the direction of Y1. Either this or `pressure`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "Pa", "x-instead-of" = "pressure"))]
    pub stress: Option<Vec<Vec<f64>>>,
    /// Side lengths of the cell in proportion, before the stress is applied; a cube if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-", "x-default" = "equal sides"))]
    pub aspect: Option<Vec<f64>>,
    /// Out-of-plane thickness; plane packings only.
    #[serde(default = "unit_thickness")]
    #[schemars(extend("x-unit" = "m"))]
    pub thickness: f64,
    /// Largest unbalanced force over mean normal contact force at the end.
    #[serde(default = "fine_tolerance")]
    #[schemars(extend("x-unit" = "-"))]
    pub tolerance: f64,
    /// Largest deviation of a stress component from the target over the pressure.
    #[serde(default = "fine_stress")]
    #[schemars(extend("x-unit" = "-"))]
    pub stress_tolerance: f64,
    /// Grain sizes.
    pub grading: Grading,
    /// Contact law during preparation.
    pub contact: ContactTable,
    /// Density or coordination to be met through the preparation friction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<StateTarget>,
    /// Fabric anisotropy to be met by shearing and unloading the packing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anisotropy: Option<AnisotropyTarget>,
    /// Grains to be taken out at the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub removal: Option<Removal>,
}

/// The table `[target]`: exactly one quantity, reached by searching the preparation friction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateTarget {
    /// Void volume over grain volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-"))]
    pub void_ratio: Option<f64>,
    /// Void volume over cell volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-"))]
    pub porosity: Option<f64>,
    /// 2 x contacts over grains, rattlers counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-"))]
    pub coordination_number: Option<f64>,
    /// The same without rattlers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-"))]
    pub coordination_number_no_rattlers: Option<f64>,
    /// Largest accepted difference.
    #[schemars(extend("x-unit" = "-"))]
    pub tolerance: f64,
    /// Smallest and largest preparation friction that is tried.
    #[serde(default = "friction_range")]
    #[schemars(extend("x-unit" = "-"))]
    pub friction: [f64; 2],
}

/// Which quantity a [`StateTarget`] names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateQuantity {
    /// Void volume over grain volume.
    VoidRatio,
    /// Void volume over cell volume.
    Porosity,
    /// 2 x contacts over grains.
    CoordinationNumber,
    /// The same without rattlers.
    CoordinationNumberNoRattlers,
}

protocol::keywords! {
    pub StateQuantity {
        VoidRatio => "void_ratio",
        Porosity => "porosity",
        CoordinationNumber => "coordination_number",
        CoordinationNumberNoRattlers => "coordination_number_no_rattlers",
    }
}

/// The table `[anisotropy]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnisotropyTarget {
    /// Major over minor principal value of the contact fabric, minus 1, as in [Liu2018].
    #[schemars(extend("x-unit" = "-"))]
    pub value: f64,
    /// Largest accepted difference.
    #[schemars(extend("x-unit" = "-"))]
    pub tolerance: f64,
    /// Axis along which most contacts point: 1, 2 or 3.
    #[serde(default = "second_axis")]
    #[schemars(range(min = 1, max = 3))]
    pub axis: u32,
    /// Friction while the packing is sheared and unloaded; without any, a packing hardly remembers a shear.
    #[schemars(extend("x-unit" = "-"))]
    pub friction: f64,
}

/// The table `[removal]`: as in [Liu2015] section 3.4, where cells are weakened by taking grains out. The rest is brought
/// back to the target stress: a cell kept as it is would often bear no stress at all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Removal {
    /// Number of grains taken out at random, at most a quarter of all.
    #[schemars(range(min = 1))]
    pub number: usize,
    /// Seed of their choice.
    #[schemars(range(max = 9_223_372_036_854_775_807_i64))]
    pub seed: u64,
}

fn plane_dimension() -> u32 {
    2
}

fn is_plane(dimension: &u32) -> bool {
    *dimension == 2
}

fn unit_thickness() -> f64 {
    1.0
}

fn fine_tolerance() -> f64 {
    1e-8
}

fn fine_stress() -> f64 {
    1e-6
}

fn friction_range() -> [f64; 2] {
    [0.0, 1.0]
}

fn second_axis() -> u32 {
    2
}

impl PackingRecipe {
    /// Reads and checks a recipe.
    ///
    /// # Errors
    /// [`PackingError::Content`] with the parser's location or the offending key.
    pub fn from_toml(text: &str) -> Result<Self, PackingError> {
        let recipe: Self = toml::from_str(text).map_err(|error| PackingError::Content(error.to_string()))?;
        recipe.validate()?;
        Ok(recipe)
    }

    /// Checks every key.
    ///
    /// # Errors
    /// [`PackingError::Content`] naming the key and the remedy.
    pub fn validate(&self) -> Result<(), PackingError> {
        if !(self.dimension == 2 || self.dimension == 3) {
            return refuse(format!("dimension = {} must be 2 (discs) or 3 (spheres)", self.dimension));
        }
        if self.number < 10 {
            return refuse(format!("number = {}: a random packing needs at least 10 grains", self.number));
        }
        if self.number > MOST_GRAINS {
            return refuse(format!("number = {}: a packing has at most {MOST_GRAINS} grains", self.number));
        }
        let positive = [
            ("thickness", self.thickness),
            ("tolerance", self.tolerance),
            ("stress_tolerance", self.stress_tolerance),
        ];
        if let Some((key, value)) = positive.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return refuse(format!("{key} = {value} must be a positive number"));
        }
        if let Some((key, value)) = positive[1..].iter().find(|(_, value)| *value < LEAST_TOLERANCE) {
            return refuse(format!(
                "{key} = {value:e} lies below rounding; at least {LEAST_TOLERANCE:e} can be reached"
            ));
        }
        if self.dimension == 3 && self.thickness != 1.0 {
            return refuse("thickness belongs to plane packings; remove it".into());
        }
        self.stress_target()?;
        if let Some(aspect) = &self.aspect {
            let sound =
                aspect.len() == self.dimension as usize && aspect.iter().all(|side| (0.05..=20.0).contains(side));
            if !sound {
                return refuse(format!(
                    "aspect = {aspect:?} needs {} numbers between 0.05 and 20, one per side of the cell",
                    self.dimension
                ));
            }
        }
        let sound = self.contact.validate().and_then(|()| self.contact.validate_for(self.dimension as usize));
        let sound = sound.and_then(|()| self.contact.refuse_inner_blocked());
        sound.map_err(|error| PackingError::Content(error.to_string()))?;
        self.grading.validate(self.number)?;
        if let Some(target) = &self.target {
            target.validate()?;
        }
        if let Some(anisotropy) = &self.anisotropy {
            anisotropy.validate(self.dimension)?;
        }
        match &self.removal {
            Some(removal) if removal.number == 0 || removal.number > self.number / 4 => refuse(format!(
                "removal.number = {} must be at least 1 and at most a quarter of the {} grains",
                removal.number, self.number
            )),
            _ => Ok(()),
        }
    }

    /// The stress that the packing is brought to.
    ///
    /// # Errors
    /// [`PackingError::Content`] if `pressure` and `stress` are both there or both missing, or not sound.
    pub fn stress_target(&self) -> Result<StressTarget, PackingError> {
        match (self.pressure, &self.stress) {
            (Some(pressure), None) => StressTarget::isotropic(pressure, self.dimension as usize),
            (None, Some(rows)) => StressTarget::from_rows(rows, self.dimension as usize),
            (Some(_), Some(_)) => refuse("give pressure or stress, not both".into()),
            (None, None) => {
                refuse("pressure (Pa, compression positive) or stress (Pa, tension positive) is missing".into())
            }
        }
    }

    /// The radii of all grains.
    pub fn radii(&self) -> Vec<f64> {
        self.grading.radii(self.number, self.dimension)
    }
}

impl StateTarget {
    fn validate(&self) -> Result<(), PackingError> {
        let (quantity, value) = self.quantity()?;
        if !(value.is_finite() && value > 0.0) {
            return refuse(format!("target.{} = {value} must be a positive number", quantity.keyword()));
        }
        if !(self.tolerance.is_finite() && self.tolerance > 0.0) {
            return refuse(format!("target.tolerance = {} must be a positive number", self.tolerance));
        }
        let [low, high] = self.friction;
        if !(low >= 0.0 && high > low && high.is_finite()) {
            return refuse(format!("target.friction = [{low}, {high}] must ascend from 0 or more"));
        }
        Ok(())
    }

    /// The quantity and its value.
    ///
    /// # Errors
    /// [`PackingError::Content`] unless exactly one is given.
    pub fn quantity(&self) -> Result<(StateQuantity, f64), PackingError> {
        let given: Vec<(StateQuantity, f64)> = [
            (StateQuantity::VoidRatio, self.void_ratio),
            (StateQuantity::Porosity, self.porosity),
            (StateQuantity::CoordinationNumber, self.coordination_number),
            (StateQuantity::CoordinationNumberNoRattlers, self.coordination_number_no_rattlers),
        ]
        .into_iter()
        .filter_map(|(quantity, value)| value.map(|value| (quantity, value)))
        .collect();
        match given.as_slice() {
            [one] => Ok(*one),
            _ => refuse(
                "target: give exactly one of void_ratio, porosity, coordination_number, \
                 coordination_number_no_rattlers; one friction cannot meet two"
                    .into(),
            ),
        }
    }
}

impl AnisotropyTarget {
    fn validate(&self, dimension: u32) -> Result<(), PackingError> {
        let positive = [("anisotropy.value", self.value), ("anisotropy.tolerance", self.tolerance)];
        if let Some((key, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && *value < 1.0)) {
            return refuse(format!("{key} = {value} must lie between 0 and 1"));
        }
        if !(1..=dimension).contains(&self.axis) {
            return refuse(format!("anisotropy.axis = {} must be one of the axes 1 to {dimension}", self.axis));
        }
        if !(self.friction.is_finite() && self.friction > 0.0) {
            return refuse(format!("anisotropy.friction = {} must be a positive number", self.friction));
        }
        Ok(())
    }
}

fn refuse<T>(reason: String) -> Result<T, PackingError> {
    Err(PackingError::Content(reason))
}
