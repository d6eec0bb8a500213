//! `[output]` and `[[probe]]`.

use keys::Located;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[output]`.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct OutputTable {
    /// Fields and grains are written after every n-th step, and after the first and the last; 0 writes none.
    pub(crate) fields_every: u64,
    /// Whether the Gauss points are written as a cloud as well (`gauss_points.pvd`).
    pub(crate) gauss_points: bool,
    /// Gauss points whose grains are written.
    #[serde(skip_serializing)]
    pub(crate) grains: Vec<Located<usize>>,
    /// Optional results of every Gauss point.
    #[schemars(extend("x-default" = "all"))]
    pub(crate) observables: Vec<Observable>,
    /// Whether `history.svg` is written.
    pub(crate) plot: bool,
    /// Horizontal axis of the plot and of the first curve of `grainspan report`: a probe, "time" or "load".
    #[serde(skip_serializing)]
    #[schemars(extend("x-default" = "first probe; with one probe the load factor, with several stages the time"))]
    pub(crate) plot_x: Option<Located<String>>,
    /// Vertical axis of the plot.
    #[serde(skip_serializing)]
    #[schemars(extend("x-default" = "second probe, or the only one"))]
    pub(crate) plot_y: Option<Located<String>>,
}

impl Default for OutputTable {
    fn default() -> Self {
        Self {
            fields_every: 1,
            gauss_points: false,
            grains: Vec::new(),
            observables: Observable::ALL.to_vec(),
            plot: true,
            plot_x: None,
            plot_y: None,
        }
    }
}

/// `output` of a stage.
#[derive(Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct StageOutputTable {
    /// Fields and grains are written after every n-th step of this stage, and after its last; 0 writes none.
    #[schemars(extend("x-default" = "as `[output]`"))]
    pub(crate) fields_every: Option<u64>,
}

/// Optional results of every Gauss point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Observable {
    /// Mean rotation of the grains.
    Rotation,
    /// Coordination number without rattlers.
    CoordinationNoRattlers,
    /// Fabric tensor of the contacts.
    Fabric,
    /// Share of contacts that slide.
    SlidingFraction,
    /// Elastic energy and frictional dissipation.
    Energy,
}

impl Observable {
    /// All of them: the default.
    pub(crate) const ALL: [Self; 5] =
        [Self::Rotation, Self::CoordinationNoRattlers, Self::Fabric, Self::SlidingFraction, Self::Energy];
}

/// `[[probe]]`: a column of the history.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProbeTable {
    /// Name of the column. It holds no line feed or other control character.
    pub(crate) name: Located<String>,
    /// Quantity.
    pub(crate) kind: ProbeKind,
    /// Node set; of the kinds that name one.
    pub(crate) set: Option<Located<String>>,
    /// Node set with the smaller coordinate; of "strain" and "compression".
    pub(crate) from: Option<Located<String>>,
    /// Node set with the larger coordinate; of "strain" and "compression".
    pub(crate) to: Option<Located<String>>,
    /// Axis "x", "y" or "z"; of "mean_stress" two of them, such as "xy".
    pub(crate) component: Option<Located<String>>,
}

/// Quantities that a probe can measure.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ProbeKind {
    /// (`set`, `component`) Force of the support on the body, N, in the plane per m of thickness.
    Reaction,
    /// (`set`, `component`) Mean displacement of the set, m.
    Displacement,
    /// (`from`, `to`, `component`) Change of the mean distance over the initial one; elongation positive.
    Strain,
    /// (as `strain`) Minus the strain: compression positive.
    Compression,
    /// Current over initial volume (in the plane: area), minus 1.
    VolumeChange,
    /// (`component`) Mean Cauchy stress component, Pa, tension positive.
    MeanStress,
    /// Mean `sigma_yy` over mean `sigma_xx`.
    StressRatio,
    /// Mean pressure, Pa, compression positive: `-(sigma_xx + sigma_yy) / 2` in the plane, `-(sigma_xx + sigma_yy + sigma_zz) / 3`
    /// in space.
    MeanPressure,
    /// `q = sigma_xx - sigma_yy`, Pa, positive in vertical compression.
    Deviator,
    /// Mean void ratio.
    VoidRatio,
    /// Mean coordination number.
    CoordinationNumber,
    /// Elastic energy of the contacts, J, in the plane per m of thickness. Needs the observable "energy".
    ElasticEnergy,
    /// Work lost to friction, J, in the plane per m of thickness. Needs the observable "energy".
    FrictionalDissipation,
    /// Energy of the hourglass control of elements with one Gauss point, J, in the plane per m of thickness.
    HourglassEnergy,
    /// (`set`, `component`) Mean velocity of the set, m/s; 0 in a quasi-static stage.
    Velocity,
    /// (`set`, `component`) Mean acceleration of the set, m/s2; 0 in a quasi-static stage.
    Acceleration,
    /// Kinetic energy of the body, J, in the plane per m of thickness; 0 in a quasi-static stage.
    KineticEnergy,
    /// Residual of the energy balance over the largest energy of the stage so far.
    EnergyResidual,
}

impl ProbeKind {
    /// The word of the scene file.
    pub(crate) fn keyword(self) -> &'static str {
        match self {
            Self::Reaction => "reaction",
            Self::Displacement => "displacement",
            Self::Strain => "strain",
            Self::Compression => "compression",
            Self::VolumeChange => "volume_change",
            Self::MeanStress => "mean_stress",
            Self::StressRatio => "stress_ratio",
            Self::MeanPressure => "mean_pressure",
            Self::Deviator => "deviator",
            Self::VoidRatio => "void_ratio",
            Self::CoordinationNumber => "coordination_number",
            Self::ElasticEnergy => "elastic_energy",
            Self::FrictionalDissipation => "frictional_dissipation",
            Self::HourglassEnergy => "hourglass_energy",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::KineticEnergy => "kinetic_energy",
            Self::EnergyResidual => "energy_residual",
        }
    }
}
