//! The element test file: packing, contact law, solver options and path.

use super::error::ElementError;
use super::path::{COMPONENTS, Matrix, tensor_of};
use crate::contact::ContactTable;
use crate::definition::RveOptions;
use crate::programs::frame::FrameOptions;
use crate::space::{Tensor, add_scaled, determinant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// An element test as written in its TOML file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElementTest {
    /// Packing file, relative to the test file.
    pub packing: PathBuf,
    /// Largest difference between a controlled stress component and its target, relative to the mean pressure of the
    /// row, the largest target or a hundredth of the largest stress at which this segment or one before has started, whichever is largest.
    #[serde(default = "default_stress_tolerance")]
    #[schemars(extend("x-unit" = "-"))]
    pub stress_tolerance: f64,
    /// Contact law.
    pub contact: ContactTable,
    /// Solver options.
    #[serde(default)]
    pub rve: RveOptions,
    /// Boundary-particle frame instead of a periodic cell; `rve` is refused then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<FrameOptions>,
    /// Segments, one after the other.
    pub path: Vec<Segment>,
}

/// One segment of the path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Number of increments, at least 1.
    #[schemars(range(min = 1))]
    pub increments: u32,
    /// How often the segment is done, default 1. Every time E acts on the F reached, so that `repeat` small segments of
    /// `E = exp(e) - 1` follow a logarithmic strain exactly.
    #[serde(default = "once")]
    #[schemars(range(min = 1))]
    pub repeat: u32,
    /// Prescribed displacement gradient over the segment: `F` goes linearly from F0 to `(I + E) F0`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-"))]
    pub strain: Components,
    /// Components driven linearly from where they are to these values, Pa, tension positive.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa"))]
    pub stress: Components,
}

/// Components of a tensor, each given or not; those with a z belong to packings of spheres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-folded" = true))]
pub struct Components {
    /// Component 11.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xx: Option<f64>,
    /// Component 12.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xy: Option<f64>,
    /// Component 13.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xz: Option<f64>,
    /// Component 21.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yx: Option<f64>,
    /// Component 22.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yy: Option<f64>,
    /// Component 23.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yz: Option<f64>,
    /// Component 31.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zx: Option<f64>,
    /// Component 32.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zy: Option<f64>,
    /// Component 33.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zz: Option<f64>,
}

/// Keys of the components, in the order of [`Components::values`].
pub(super) const COMPONENT_KEYS: [&str; COMPONENTS] = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];

/// Whether a component lies in the plane of discs.
pub(super) fn is_in_plane(place: usize) -> bool {
    place / 3 < 2 && place % 3 < 2
}

impl Components {
    /// The components in the order 11, 12, 13, 21, ...
    pub fn values(&self) -> [Option<f64>; 9] {
        [self.xx, self.xy, self.xz, self.yx, self.yy, self.yz, self.zx, self.zy, self.zz]
    }

    /// The tensor, with zero for components not given.
    pub fn tensor(&self) -> [[f64; 3]; 3] {
        tensor_of(&self.values().map(|value| value.unwrap_or(0.0)))
    }
}

fn once() -> u32 {
    1
}

/// Share of the mean pressure from which on nothing controls a stress any more.
const LARGEST_STRESS_TOLERANCE: f64 = 0.1;

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

    /// Itself, if it is sound beyond the types and ranges of its keys.
    ///
    /// # Errors
    /// [`ElementError::Test`] with the key of the first defect.
    pub fn validated(self) -> Result<Self, ElementError> {
        self.contact.validate().map_err(|error| ElementError::Test(error.to_string()))?;
        self.rve.validate().map_err(|error| ElementError::Test(error.to_string()))?;
        match &self.frame {
            Some(frame) => frame.validate().and_then(|()| frame.refuse_unused()),
            None => self.contact.refuse_inner_blocked(),
        }
        .map_err(|error| ElementError::Test(error.to_string()))?;
        if self.rve.frame.is_some() {
            return refuse("rve.frame is a key of scenes; an RVE test has the table [frame]".into());
        }
        if !(self.stress_tolerance > 0.0 && self.stress_tolerance <= LARGEST_STRESS_TOLERANCE) {
            return refuse(format!(
                "stress_tolerance = {} must be above 0 and at most {LARGEST_STRESS_TOLERANCE} of the mean pressure: with more a stress is not controlled",
                self.stress_tolerance
            ));
        }
        if self.path.is_empty() {
            return refuse("path is empty: add at least one [[path]] segment".into());
        }
        for (number, segment) in self.path.iter().enumerate() {
            segment.validate(number + 1)?;
            let pulled = [0, 4, 8].into_iter().find(|place| segment.stress.values()[*place] > Some(0.0));
            if let Some(place) = pulled.filter(|_| self.contact.cohesion == 0.0) {
                return refuse(format!(
                    "path segment {}: stress.{} is positive, which is tension, and grains without cohesion bear none; compression is \
                     negative",
                    number + 1,
                    COMPONENT_KEYS[place]
                ));
            }
        }
        Ok(self)
    }
}

impl ElementTest {
    /// Refuses components out of the plane for packings of discs.
    ///
    /// # Errors
    /// [`ElementError::Test`] names the component.
    pub fn check_dimension(&self, dimension: usize) -> Result<(), ElementError> {
        if dimension == 3 {
            return Ok(());
        }
        for (number, segment) in self.path.iter().enumerate() {
            for (table, values) in [("strain", segment.strain.values()), ("stress", segment.stress.values())] {
                if let Some(place) = (0..COMPONENTS).find(|place| values[*place].is_some() && !is_in_plane(*place)) {
                    let (number, key) = (number + 1, COMPONENT_KEYS[place]);
                    return refuse(format!(
                        "path segment {number}: {table}.{key} lies out of the plane of the packing's discs; remove it"
                    ));
                }
            }
        }
        Ok(())
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
        for (place, key) in COMPONENT_KEYS.iter().enumerate() {
            let transposed = 3 * (place % 3) + place / 3;
            if place < transposed && stress[place].is_some() && stress[transposed].is_some() {
                let other = COMPONENT_KEYS[transposed];
                return refuse(format!(
                    "path segment {number}: stress.{key} and stress.{other} are the same stress; give one of them"
                ));
            }
        }
        let end = add_scaled(&Matrix::IDENTITY, 1.0, &self.strain.tensor());
        if determinant(&end) <= 0.0 {
            return refuse(format!("path segment {number}: the strain turns the cell inside out"));
        }
        Ok(())
    }
}

fn refuse<T>(message: String) -> Result<T, ElementError> {
    Err(ElementError::Test(message))
}
