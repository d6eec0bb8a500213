//! The stress that a body should start with, and how well it has to be met.

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A stress field, Pa, tension positive.
#[derive(Clone, Debug, PartialEq)]
pub enum InitialStress {
    /// The same everywhere, by rows.
    Uniform([[f64; 3]; 3]),
    /// That of a level ground at rest: the vertical pressure is the surcharge plus unit weight times depth, the
    /// horizontal ones are `rest_coefficient` times that, and there is no shear. Above the surface only the surcharge.
    Geostatic {
        /// Height of the surface, m, along y.
        surface: f64,
        /// Mass density times the acceleration of gravity, N/m3.
        unit_weight: f64,
        /// K0, horizontal over vertical stress.
        rest_coefficient: f64,
        /// Vertical pressure at the surface, Pa, **compression positive**.
        surcharge: f64,
    },
    /// That of each Gauss point, by rows: of a body in equilibrium with the loads at the start, see [`EquilibriumSettings`].
    AtPoints(Vec<[[f64; 3]; 3]>),
}

/// A body whose stress cells are brought to: `equilibrium` of `[initial_stress]`. It has the mesh, supports and loads of the scene at its start
/// and is isotropic, elastic and, beyond a friction angle, plastic without change of volume.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EquilibriumSettings {
    /// Earth-pressure coefficient at rest K0 of the elastic body: horizontal over vertical pressure where no side moves.
    #[serde(default = "default_rest_coefficient")]
    #[schemars(extend("x-unit" = "-", "exclusiveMaximum" = 1), range(min = 0.0))]
    pub rest_coefficient: f64,
    /// Largest friction angle that the stress of a point may take up. Choose one below that of the cells: at their own strength they flow.
    #[schemars(extend("x-unit" = "degrees", "exclusiveMinimum" = 0, "exclusiveMaximum" = 90))]
    pub friction_angle: f64,
}

fn default_rest_coefficient() -> f64 {
    0.5
}

impl InitialStress {
    /// The stress of a Gauss point at a place, m.
    pub fn at(&self, point: usize, place: [f64; 3]) -> Matrix3<f64> {
        match self {
            Self::Uniform(rows) => Matrix3::from_fn(|i, j| rows[i][j]),
            Self::AtPoints(rows) => Matrix3::from_fn(|i, j| rows[point][i][j]),
            Self::Geostatic { surface, unit_weight, rest_coefficient, surcharge } => {
                let vertical = -(surcharge + unit_weight * (surface - place[1]).max(0.0));
                let horizontal = rest_coefficient * vertical;
                Matrix3::from_diagonal(&[horizontal, vertical, horizontal].into())
            }
        }
    }

    /// Every number in it.
    pub(super) fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Uniform(rows) => rows.iter().flatten().copied().collect(),
            Self::AtPoints(points) => points.iter().flatten().flatten().copied().collect(),
            Self::Geostatic { surface, unit_weight, rest_coefficient, surcharge } => {
                vec![*surface, *unit_weight, *rest_coefficient, *surcharge]
            }
        }
    }
}

/// What is asked of the stress that the points start with. Without limits everything is reported and nothing refused:
/// what is out of balance is equilibrated in step 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InitialState {
    /// What it should be.
    pub expected: Option<InitialStress>,
    /// How well it has to be met.
    pub limits: InitialLimits,
    /// Whether cells are brought to it.
    pub preparation: InitialPreparation,
}

/// Whether and how cells are brought to their initial stress before a run starts: keys of `[initial_stress]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct InitialPreparation {
    /// Whether the cells are brought to the expected stress of their Gauss points before the run starts; otherwise the packings must have
    /// been prepared at it. Needs `uniform`, `geostatic` or `equilibrium`.
    pub prepare: bool,
    /// Pressures that differ by less than this share are prepared at their mean, in one cell; 0: every pressure has a cell of its own. Not with `equilibrium`, where every point has one.
    #[schemars(extend("x-unit" = "-"), range(min = 0.0, max = 0.5))]
    pub prepare_spacing: f64,
}

/// How well an initial stress has to be met: keys of `[initial_stress]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct InitialLimits {
    /// A start is refused if a stress component of any point differs from the expected one by more than this share of the largest
    /// component expected.
    #[schemars(extend("x-unit" = "-", "x-default" = "not checked"), range(min = 0.0))]
    pub largest_deviation: Option<f64>,
    /// A start is refused if the out-of-balance force over reactions or loads is larger.
    #[schemars(extend("x-unit" = "-", "x-default" = "not checked"), range(min = 0.0))]
    pub largest_imbalance: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_at_rest_is_pressed_by_its_depth() {
        let ground =
            InitialStress::Geostatic { surface: 10.0, unit_weight: 2e4, rest_coefficient: 0.5, surcharge: 1e3 };
        let stress = ground.at(0, [3.0, 7.0, 0.0]);
        assert_eq!([stress[(0, 0)], stress[(1, 1)], stress[(2, 2)], stress[(0, 1)]], [-30.5e3, -61e3, -30.5e3, 0.0]);
        assert_eq!(ground.at(0, [0.0, 11.0, 0.0])[(1, 1)], -1e3);
    }
}
