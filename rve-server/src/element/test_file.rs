//! The element test file: packing, contact law, solver options and path.

use super::ElementError;
use crate::definition::{ContactTable, RveOptions};
use crate::plane::{self, Plane};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// An element test as written in its TOML file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ElementTest {
    /// Packing file, relative to the test file.
    pub packing: PathBuf,
    /// Largest difference between a controlled stress component and its target, relative to the mean pressure of the
    /// row; dimensionless.
    #[serde(default = "default_stress_tolerance")]
    pub stress_tolerance: f64,
    /// Contact law.
    pub contact: ContactTable,
    /// Solver options.
    #[serde(default)]
    pub rve: RveOptions,
    /// Segments, one after the other.
    pub path: Vec<Segment>,
}

/// One segment of the path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Number of increments, at least 1.
    pub increments: u32,
    /// How often the segment is done, default 1. Every time E acts on the F reached, so that `repeat` small segments of
    /// `E = exp(e) - 1` follow a logarithmic strain exactly.
    #[serde(default = "once")]
    pub repeat: u32,
    /// Prescribed displacement gradient over the segment, dimensionless: `F` goes linearly from F0 to `(I + E) F0`.
    #[serde(default)]
    pub strain: Components,
    /// Components driven linearly from where they are to these values, Pa, tension positive.
    #[serde(default)]
    pub stress: Components,
}

/// Components of a plane tensor, each given or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Components {
    /// Component 11.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xx: Option<f64>,
    /// Component 12.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xy: Option<f64>,
    /// Component 21.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yx: Option<f64>,
    /// Component 22.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yy: Option<f64>,
}

/// Keys of the four components, in the order of [`Components::values`].
pub(super) const COMPONENT_KEYS: [&str; 4] = ["xx", "xy", "yx", "yy"];

impl Components {
    /// The components in the order 11, 12, 21, 22.
    pub fn values(&self) -> [Option<f64>; 4] {
        [self.xx, self.xy, self.yx, self.yy]
    }

    /// The tensor, with zero for components not given.
    pub fn plane(&self) -> Plane {
        let [xx, xy, yx, yy] = self.values().map(|value| value.unwrap_or(0.0));
        [[xx, xy], [yx, yy]]
    }
}

fn once() -> u32 {
    1
}

fn default_stress_tolerance() -> f64 {
    1e-3
}

impl ElementTest {
    /// Reads and checks a test file's text.
    ///
    /// # Errors
    /// [`ElementError::Test`] with the line and key of the first defect.
    pub fn from_toml(text: &str) -> Result<Self, ElementError> {
        let test: Self = toml::from_str(text).map_err(|error| ElementError::Test(error.to_string()))?;
        test.validated()
    }

    /// Reads and checks a test given as a table, for instance after overrides.
    ///
    /// # Errors
    /// [`ElementError::Test`] with the key of the first defect.
    pub fn from_table(table: toml::Table) -> Result<Self, ElementError> {
        let test: Self = table.try_into().map_err(|error: toml::de::Error| ElementError::Test(error.to_string()))?;
        test.validated()
    }

    fn validated(self) -> Result<Self, ElementError> {
        self.contact.validate().map_err(|error| ElementError::Test(error.to_string()))?;
        self.rve.validate().map_err(|error| ElementError::Test(error.to_string()))?;
        if !(self.stress_tolerance > 0.0 && self.stress_tolerance.is_finite()) {
            return refuse(format!("stress_tolerance = {} must be a positive number", self.stress_tolerance));
        }
        if self.path.is_empty() {
            return refuse("path is empty: add at least one [[path]] segment".into());
        }
        for (number, segment) in self.path.iter().enumerate() {
            segment.validate(number + 1)?;
        }
        Ok(self)
    }
}

impl Segment {
    fn validate(&self, number: usize) -> Result<(), ElementError> {
        if self.increments == 0 {
            return refuse(format!("path segment {number}: increments must be at least 1"));
        }
        if self.repeat == 0 {
            return refuse(format!("path segment {number}: repeat must be at least 1"));
        }
        let (strain, stress) = (self.strain.values(), self.stress.values());
        for (place, key) in COMPONENT_KEYS.iter().enumerate() {
            for (table, value) in [("strain", strain[place]), ("stress", stress[place])] {
                if value.is_some_and(|value| !value.is_finite()) {
                    return refuse(format!("path segment {number}: {table}.{key} is not a finite number"));
                }
            }
            if strain[place].is_some() && stress[place].is_some() {
                return refuse(format!(
                    "path segment {number}: {key} is in both strain and stress; remove one of them"
                ));
            }
        }
        if stress[1].is_some() && stress[2].is_some() {
            return refuse(format!(
                "path segment {number}: stress.xy and stress.yx are the same stress; give one of them"
            ));
        }
        let end = plane::add_scaled(&plane::IDENTITY, 1.0, &self.strain.plane());
        if plane::determinant(&end) <= 0.0 {
            return refuse(format!("path segment {number}: the strain turns the cell inside out"));
        }
        Ok(())
    }
}

fn refuse<T>(message: String) -> Result<T, ElementError> {
    Err(ElementError::Test(message))
}
