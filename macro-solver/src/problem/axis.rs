//! Directions of space.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A space direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Horizontal.
    X,
    /// Vertical.
    Y,
    /// Out of the plane; only in space.
    Z,
}

impl Axis {
    /// The axes of the plane, then the third one of space.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// 0 for x, 1 for y, 2 for z.
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }
}
