//! `[output]`.

use super::ProbeKind;
use keys::Located;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[output]`.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct OutputTable {
    /// Fields and grains are written after every n-th step, and after the first and the last; 0 writes none.
    pub(crate) fields_every: u64,
    /// Quantities that are written as fields, and as columns of `points`, in addition to those that always are: kinds of `[[probe]]` that
    /// are measured at Gauss points and need no component, counted from the start of the run.
    #[serde(skip_serializing)]
    #[schemars(with = "Vec<String>")]
    pub(crate) fields: Vec<Located<ProbeKind>>,
    /// Whether the Gauss points are written as a cloud as well (`gauss_points.pvd`).
    pub(crate) gauss_points: bool,
    /// Gauss points whose grains are written.
    #[serde(skip_serializing)]
    pub(crate) grains: Vec<Located<usize>>,
    /// Name of the stage from whose start the displacement fluctuations of these grains are counted; grains written before it have none.
    #[schemars(extend("x-default" = "the start of the run"))]
    #[serde(skip_serializing)]
    pub(crate) grains_from: Option<Located<String>>,
    /// Whether the last states of all Gauss points are written to `cells/`, for the page of `grainspan watch` and `grainspan report`; not
    /// above 100000 grains in all.
    pub(crate) cells: bool,
    /// Gauss points, numbered through the mesh, of which stress, strain, void ratio, fabric and all other results are written to
    /// `points/point-NUMBER.csv` at every step.
    #[serde(skip_serializing)]
    pub(crate) points: Vec<Located<usize>>,
    /// Optional results of every Gauss point.
    #[schemars(extend("x-default" = "all"))]
    pub(crate) observables: Vec<Observable>,
    /// Whether headers of tables hold units: `top_force [N/m]` in place of `top_force`. The units are in `units.json` in any case.
    pub(crate) units: bool,
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
            fields: Vec::new(),
            gauss_points: false,
            grains: Vec::new(),
            grains_from: None,
            cells: true,
            points: Vec::new(),
            observables: Observable::ALL.to_vec(),
            units: false,
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
