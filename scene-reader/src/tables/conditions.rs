//! `[[boundary]]`, `[[pressure]]`, `[[traction]]`, `[[body_force]]` and `[[friction]]`.

use keys::Located;
use macro_solver::problem::{Amplitude, Axis, Origin, Platen, PressureKind, SmoothRamp};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[boundary]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoundaryTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Node set.
    pub(crate) set: Located<String>,
    /// Whether a rigid platen holds the set. What is prescribed then has one component only, along the normal of the platen.
    #[schemars(extend("x-default" = "none"))]
    pub(crate) platen: Option<Platen>,
    /// Displacement at factor 1 of the history. A component that is left out is free, 0 holds it. Either this or `velocity` or
    /// `acceleration` is given.
    #[schemars(extend("x-unit" = "m", "x-default" = "none"))]
    pub(crate) displacement: Option<Located<Components>>,
    /// Velocity at factor 1 of the history, integrated exactly over the time since the stage began.
    #[schemars(extend("x-unit" = "m/s", "x-default" = "none"))]
    pub(crate) velocity: Option<Located<Components>>,
    /// Acceleration at factor 1 of the history, integrated exactly, from rest at the beginning of the stage.
    #[schemars(extend("x-unit" = "m/s2", "x-default" = "none"))]
    pub(crate) acceleration: Option<Located<Components>>,
    /// Factor on what is prescribed over the stage.
    #[schemars(extend("x-default" = "\"ramp\" for a displacement, \"constant\" for a velocity or an acceleration"))]
    pub(crate) history: Option<Located<History>>,
    /// Position from which displacements count.
    #[serde(default)]
    pub(crate) from: Origin,
}

/// `[[pressure]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Side set.
    pub(crate) set: Located<String>,
    /// Pressure, compression positive.
    #[schemars(extend("x-unit" = "Pa"))]
    pub(crate) value: f64,
    /// Whether the pressure follows the deformed side.
    #[serde(default)]
    pub(crate) kind: PressureKind,
    /// Factor on the pressure over the stage.
    #[schemars(extend("x-default" = "\"constant\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[traction]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TractionTable {
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Side set.
    pub(crate) set: Located<String>,
    /// Force per initial area; a component that is left out is 0.
    #[schemars(extend("x-unit" = "Pa"))]
    pub(crate) value: Components,
    /// Factor on the traction over the stage.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[body_force]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BodyForceTable {
    /// Element set, or the name of a `[[region]]`.
    #[serde(default = "all")]
    pub(crate) set: Located<String>,
    /// Force per initial volume; a component that is left out is 0.
    #[schemars(extend("x-unit" = "N/m3"))]
    pub(crate) value: Components,
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Factor on the force over the stage; a ramp increases gravity gradually.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

/// `[[friction]]`: friction between the grains that changes during the run.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FrictionTable {
    /// Element set, or the name of a `[[region]]`.
    #[serde(default = "all")]
    pub(crate) set: Located<String>,
    /// Friction at factor 1 of the history, over that of `[contact]` or of the region, which is the largest of the run; at factor 0 it is
    /// that of the stage before.
    #[schemars(extend("x-unit" = "-"), range(min = 0.0, max = 1.0))]
    pub(crate) factor: f64,
    /// Name by which later stages replace or remove it.
    #[schemars(extend("x-default" = "the name of the set"))]
    pub(crate) name: Option<String>,
    /// Factor on the change of friction over the stage; between 0 and 1, so no sine.
    #[schemars(extend("x-default" = "\"ramp\""))]
    pub(crate) history: Option<Located<History>>,
}

fn all() -> Located<String> {
    Located::new(0..0, "all".to_owned())
}

/// Components of a vector.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-folded" = true))]
pub(crate) struct Components {
    /// Along x.
    pub(crate) x: Option<f64>,
    /// Along y.
    pub(crate) y: Option<f64>,
    /// Along z.
    pub(crate) z: Option<f64>,
}

impl Components {
    /// By axis.
    pub(crate) fn by_axis(self) -> [(Axis, Option<f64>); 3] {
        [(Axis::X, self.x), (Axis::Y, self.y), (Axis::Z, self.z)]
    }
}

/// The factor on the value of a condition over its stage. Time within a stage is the load factor times `loading.duration`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum History {
    /// 1 from the first step of the stage on.
    Constant,
    /// Grows with the load factor, from 0 to 1.
    Ramp,
    /// From 0 to 1 by `10 x^3 - 15 x^4 + 6 x^5` of the load factor `x`: at rest and without acceleration at both ends.
    Smooth,
    /// From 0 to 1 at a constant rate that is reached and left smoothly.
    SmoothRamp(SmoothRampTable),
    /// Straight lines between points `[time since the stage began in s, factor]`; before the first and after the last time the
    /// factor there.
    #[schemars(extend("x-unit" = "s, -"))]
    Table(Vec<[f64; 2]>),
    /// `sin(2 pi f t + p)`.
    Sine(SineTable),
}

impl From<&History> for Amplitude {
    fn from(history: &History) -> Self {
        match history {
            History::Constant => Self::Constant,
            History::Ramp => Self::RAMP,
            History::Smooth => Self::SMOOTH,
            History::SmoothRamp(ramp) => {
                let shape = SmoothRamp { start: ramp.start, stop: ramp.stop };
                Self::SmoothRamp { from: 0.0, to: 1.0, shape }
            }
            History::Table(points) => Self::Table(points.clone()),
            History::Sine(sine) => Self::Sine { frequency: sine.frequency, phase: sine.phase },
        }
    }
}

/// A ramp with smooth ends: its rate grows from 0 and falls to 0 without jumps of velocity and acceleration.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SmoothRampTable {
    /// Share of the stage over which the rate is reached.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0, max = 1.0))]
    pub(crate) start: f64,
    /// Share of the stage at its end over which the rate is left; with `start` at most 1.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0, max = 1.0))]
    pub(crate) stop: f64,
}

/// A sine over time.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SineTable {
    /// Frequency `f`.
    #[schemars(extend("x-unit" = "Hz", "exclusiveMinimum" = 0))]
    pub(crate) frequency: f64,
    /// Phase `p` at the beginning of the stage.
    #[serde(default)]
    #[schemars(extend("x-unit" = "rad"))]
    pub(crate) phase: f64,
}
