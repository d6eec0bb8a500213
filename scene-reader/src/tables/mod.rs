//! The keys of a scene: every table is a struct, every key a documented field. Checks, `grainspan explain` and the reference
//! come from here, see the crate `keys`.

mod conditions;
mod constraints;
mod economy;
mod initial_stress;
mod mesh;
mod nonlocal;
mod output;
mod pool;
mod pore_fluid;
mod probe;
mod region;
mod solving;
mod stage;
mod study;

pub(crate) use conditions::{
    BodyForceTable, BoundaryTable, Components, FrictionTable, History, PressureTable, TractionTable,
};
pub(crate) use constraints::{
    NormalDisplacementTable, PeriodicTable, RadialDisplacementTable, RigidBodyTable, SumTable, TiltingPlatenTable,
};
pub(crate) use economy::EconomyTable;
pub(crate) use initial_stress::{InitialStressTable, StressTable};
pub(crate) use mesh::{Generator, MeshTable};
pub(crate) use nonlocal::NonlocalTable;
pub(crate) use output::*;
pub(crate) use pool::*;
pub(crate) use pore_fluid::PoreFluidTable;
pub(crate) use probe::{PartTable, ProbeKind, ProbeTable, ProfileTable};
pub(crate) use region::{RegionTable, Vary};
pub(crate) use solving::*;
pub(crate) use stage::*;
pub use study::{EnsembleStatistic, PathStrain, RowMeasure};
pub(crate) use study::{ExpectedEntry, QuantityEntry, StudyFile, Take};

use keys::{Given, Located};
use macro_solver::checkpoint::CheckpointPolicy;
use macro_solver::material::error_estimate::ErrorEstimateSettings;
use macro_solver::problem::LoadingSettings;
use macro_solver::problem::dynamics::DynamicSettings;
use macro_solver::problem::relaxation::RelaxationSettings;
use rve_server::contact::ContactTable;
use rve_server::definition::RveOptions;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// A scene: a boundary-value problem whose Gauss points are packings of grains. `grainspan run` and `grainspan check` read it.
/// Paths are relative to the folder of the scene. Units are SI; tension is positive unless a key says compression or pressure.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    /// Name of the run: letters, digits, `-` and `_`. The output folder is `out/NAME` unless `--out` names another.
    #[schemars(extend("x-default" = "name of the file"))]
    pub(crate) name: Option<Located<String>>,
    /// Packing file (JSON) behind every Gauss point that lies in no `[[region]]`.
    pub(crate) packing: PathBuf,
    /// The finite-element mesh: generated, or read from a Gmsh file.
    pub(crate) mesh: Located<MeshTable>,
    /// The contact law between grains.
    pub(crate) contact: ContactTable,
    /// Accuracy of the grain solver of one RVE. The same for all regions.
    #[serde(default)]
    pub(crate) rve: RveOptions,
    /// Estimate of the error of the grain solver, from Gauss points that are solved once more with half the strain per ramp step.
    #[serde(default)]
    pub(crate) error_estimate: Given<ErrorEstimateSettings>,
    /// Work that a run leaves out because its result is known.
    #[serde(default)]
    pub(crate) economy: EconomyTable,
    /// Elements whose Gauss points have another packing or contact law than the rest. Where regions overlap, the last one holds.
    #[serde(default)]
    pub(crate) region: Vec<Located<RegionTable>>,
    /// Prescribed displacements: supports and moved boundaries.
    #[serde(default)]
    pub(crate) boundary: Vec<Located<BoundaryTable>>,
    /// Pressure on a side set.
    #[serde(default)]
    pub(crate) pressure: Vec<Located<PressureTable>>,
    /// Force per area of a side set.
    #[serde(default)]
    pub(crate) traction: Vec<Located<TractionTable>>,
    /// Force per volume of an element set, for example weight.
    #[serde(default)]
    pub(crate) body_force: Vec<Located<BodyForceTable>>,
    /// Friction between the grains that changes from the beginning of the first stage.
    #[serde(default)]
    pub(crate) friction: Vec<Located<FrictionTable>>,
    /// A rigid, smooth platen that may tilt: the nodes stay in one plane, which carries no moment.
    #[serde(default)]
    pub(crate) tilting_platen: Vec<Located<TiltingPlatenTable>>,
    /// Displacement of a side set along its normals, free along the side.
    #[serde(default)]
    pub(crate) normal_displacement: Vec<Located<NormalDisplacementTable>>,
    /// Displacement of a node set away from a point, or a line along z.
    #[serde(default)]
    pub(crate) radial_displacement: Vec<Located<RadialDisplacementTable>>,
    /// Nodes that move as one rigid body. Rotations are linearised about the positions at the beginning of the stage.
    #[serde(default)]
    pub(crate) rigid_body: Vec<Located<RigidBodyTable>>,
    /// Periodic faces: every node of one set moves as its partner in the other one plus a jump.
    #[serde(default)]
    pub(crate) periodic: Vec<Located<PeriodicTable>>,
    /// A sum of mean displacements of node sets that has a given value.
    #[serde(default)]
    pub(crate) sum: Vec<Located<SumTable>>,
    /// Checks of the stress at the start, which is that of the packings.
    #[serde(default)]
    pub(crate) initial_stress: InitialStressTable,
    /// Fluid in the pores that cannot drain: an undrained body.
    pub(crate) pore_fluid: Option<PoreFluidTable>,
    /// How all stages are solved that do not say otherwise.
    #[serde(default)]
    pub(crate) procedure: ProcedureKeyword,
    /// Load steps.
    #[serde(default)]
    pub(crate) loading: Given<LoadingSettings>,
    /// Explicit dynamics: keys of stages with procedure = "dynamic".
    #[serde(default)]
    pub(crate) dynamics: Given<DynamicSettings>,
    /// Dynamic relaxation: keys of stages with procedure = "relaxation".
    #[serde(default)]
    pub(crate) relaxation: Given<RelaxationSettings>,
    /// Nonlocal averages of strain increments over neighbouring Gauss points. Needs `solver.formulation` "corotational" or
    /// "small_strain". A stage may have a table `nonlocal` of its own.
    #[serde(default)]
    pub(crate) nonlocal: Given<NonlocalTable>,
    /// Loading stages, one after the other. The conditions at the top of the scene act from the beginning of the first one.
    #[serde(default)]
    pub(crate) stage: Vec<Located<StageTable>>,
    /// Formulation, convergence and nonlinear solution strategy.
    #[serde(default)]
    pub(crate) solver: Given<SolverTable>,
    /// What is recorded.
    #[serde(default)]
    pub(crate) output: OutputTable,
    /// Columns of `history.csv`.
    #[serde(default)]
    pub(crate) probe: Vec<Located<ProbeTable>>,
    /// Quantities along an axis, a file `profiles/NAME.csv` each with the columns `step, time, coordinate, value`; `coordinate` is that of
    /// the centre of the bin in the mesh as given, m.
    #[serde(default)]
    pub(crate) profile: Vec<Located<ProfileTable>>,
    /// When the state of the run is written. Changes no result and may differ when a run is continued.
    #[serde(default)]
    pub(crate) checkpoint: Given<CheckpointPolicy>,
    /// Who solves the Gauss points, and how workers are supervised. Only `engine`, `points`, `difference_strain` and `difference_reuses` change a result; the other keys
    /// may differ when a run is continued.
    #[serde(default)]
    pub(crate) pool: Given<PoolTable>,
}
