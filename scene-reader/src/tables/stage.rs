//! `[[stage]]`.

use super::{
    BodyForceTable, BoundaryTable, FrictionTable, NonlocalTable, NormalDisplacementTable, PeriodicTable,
    PressureTable, RadialDisplacementTable, RigidBodyTable, SolverTable, StageOutputTable, SumTable,
    TiltingPlatenTable, TractionTable,
};
use keys::{Given, Located};
use macro_solver::problem::LoadingSettings;
use macro_solver::problem::dynamics::DynamicSettings;
use macro_solver::problem::relaxation::RelaxationSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What differs from the tables of the same names for the whole run.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StageTable {
    /// Name for messages and for the column `stage` of the history.
    pub(crate) name: Located<String>,
    /// How the stage is solved.
    #[schemars(extend("x-default" = "as at the top"))]
    pub(crate) procedure: Option<ProcedureKeyword>,
    /// Keys of `[dynamics]` that differ in this stage.
    #[serde(default)]
    pub(crate) dynamics: Given<DynamicSettings>,
    /// Keys of `[relaxation]` that differ in this stage.
    #[serde(default)]
    pub(crate) relaxation: Given<RelaxationSettings>,
    /// Prescribed displacements that begin with this stage.
    #[serde(default)]
    pub(crate) boundary: Vec<Located<BoundaryTable>>,
    /// Pressures that begin with this stage.
    #[serde(default)]
    pub(crate) pressure: Vec<Located<PressureTable>>,
    /// Tractions that begin with this stage.
    #[serde(default)]
    pub(crate) traction: Vec<Located<TractionTable>>,
    /// Body forces that begin with this stage.
    #[serde(default)]
    pub(crate) body_force: Vec<Located<BodyForceTable>>,
    /// Friction between the grains that changes in this stage.
    #[serde(default)]
    pub(crate) friction: Vec<Located<FrictionTable>>,
    /// Tilting platens that begin with this stage.
    #[serde(default)]
    pub(crate) tilting_platen: Vec<Located<TiltingPlatenTable>>,
    /// Displacements along normals that begin with this stage.
    #[serde(default)]
    pub(crate) normal_displacement: Vec<Located<NormalDisplacementTable>>,
    /// Radial displacements that begin with this stage.
    #[serde(default)]
    pub(crate) radial_displacement: Vec<Located<RadialDisplacementTable>>,
    /// Rigid bodies that begin with this stage.
    #[serde(default)]
    pub(crate) rigid_body: Vec<Located<RigidBodyTable>>,
    /// Periodic faces that begin with this stage.
    #[serde(default)]
    pub(crate) periodic: Vec<Located<PeriodicTable>>,
    /// Sums of displacements that are prescribed from this stage on.
    #[serde(default)]
    pub(crate) sum: Vec<Located<SumTable>>,
    /// Names of conditions that end at once before this stage. A condition without a name has that of its set; where conditions of several
    /// tables are called so, they need names of their own.
    #[serde(default)]
    pub(crate) remove: Vec<Located<String>>,
    /// Keys of `[loading]` that differ in this stage.
    #[serde(default)]
    pub(crate) loading: Given<LoadingSettings>,
    /// Keys of `[solver]` that differ in this stage; not those that hold for the whole run.
    #[serde(default)]
    pub(crate) solver: Given<SolverTable>,
    /// Keys of `[nonlocal]` that differ in this stage, such as the radius; `enabled = false` switches averages off.
    #[serde(default)]
    pub(crate) nonlocal: Given<NonlocalTable>,
    /// Keys of `[output]` that differ in this stage.
    #[serde(default)]
    pub(crate) output: StageOutputTable,
}

/// How a stage is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ProcedureKeyword {
    /// Equilibrium at every step, by Newton's method.
    #[default]
    Implicit,
    /// Equilibrium at every step, by dynamic relaxation without tangents.
    Relaxation,
    /// Motion with inertia, by explicit central differences. `loading.duration` is real time.
    Dynamic,
}
