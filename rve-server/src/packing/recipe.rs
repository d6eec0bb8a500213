//! What a packing is to be: the TOML description that `grainspan pack` reads.

use crate::definition::ContactTable;
use crate::packing::PackingError;
use serde::{Deserialize, Serialize};

/// Grain sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "distribution", rename_all = "snake_case", deny_unknown_fields)]
pub enum Grading {
    /// Radii evenly spread between two values: grain k of N has the radius at the quantile (k + 1/2) / N, so every seed
    /// has the same sizes and only their places differ.
    Uniform {
        /// Smallest radius, m.
        smallest_radius: f64,
        /// Largest radius, m.
        largest_radius: f64,
    },
    /// Given radii, repeated in order until there are enough.
    List {
        /// Radii, m.
        radii: Vec<f64>,
    },
}

/// The description of a packing. `[contact]` holds the law during preparation: its `friction` is the preparation
/// friction, low values give dense packings. The packing may be used with any other law later.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackingRecipe {
    /// Number of grains.
    pub number: usize,
    /// Seed of the random generator.
    pub seed: u64,
    /// Target isotropic pressure, Pa, compression positive.
    pub pressure: f64,
    /// Out-of-plane thickness, m.
    #[serde(default = "unit_thickness")]
    pub thickness: f64,
    /// Largest unbalanced force over mean normal contact force at the end, dimensionless.
    #[serde(default = "fine_tolerance")]
    pub tolerance: f64,
    /// Largest deviation of a stress component from the target over the pressure, dimensionless.
    #[serde(default = "fine_stress")]
    pub stress_tolerance: f64,
    /// Grain sizes.
    pub grading: Grading,
    /// Contact law during preparation.
    pub contact: ContactTable,
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
        let refuse = |reason: String| Err(PackingError::Content(reason));
        if self.number < 10 {
            return refuse(format!("number = {}: a random packing needs at least 10 grains", self.number));
        }
        let positive = [
            ("pressure", self.pressure),
            ("thickness", self.thickness),
            ("tolerance", self.tolerance),
            ("stress_tolerance", self.stress_tolerance),
        ];
        if let Some((key, value)) = positive.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return refuse(format!("{key} = {value} must be a positive number"));
        }
        self.contact.validate().map_err(|error| PackingError::Content(error.to_string()))?;
        match &self.grading {
            Grading::Uniform { smallest_radius, largest_radius } => {
                let sound = *smallest_radius > 0.0 && largest_radius >= smallest_radius && largest_radius.is_finite();
                if !sound {
                    return refuse(format!(
                        "grading: 0 < smallest_radius = {smallest_radius} <= largest_radius = {largest_radius} must hold"
                    ));
                }
            }
            Grading::List { radii } => {
                if radii.is_empty() || !radii.iter().all(|radius| radius.is_finite() && *radius > 0.0) {
                    return refuse("grading.radii must hold positive numbers only, at least one".into());
                }
            }
        }
        Ok(())
    }

    /// The radii of all grains, m.
    pub fn radii(&self) -> Vec<f64> {
        match &self.grading {
            Grading::Uniform { smallest_radius, largest_radius } => (0..self.number)
                .map(|grain| {
                    let quantile = (grain as f64 + 0.5) / self.number as f64;
                    smallest_radius + (largest_radius - smallest_radius) * quantile
                })
                .collect(),
            Grading::List { radii } => radii.iter().copied().cycle().take(self.number).collect(),
        }
    }
}
