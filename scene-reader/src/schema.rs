//! Keys of the scene file, exactly as `docs/scene.md` lists them. What they mean together is in `build`.

use super::motion::{DynamicsTable, RelaxationTable};
use macro_solver::mesh::ElementKind;
use macro_solver::nonlocal::NonlocalSettings;
use macro_solver::problem::Axis;
use protocol::TangentKind;
use rve_server::contact::ContactTable;
use rve_server::definition::RveOptions;
use rve_server::preparation::Removal;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use toml::Spanned;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) packing: PathBuf,
    pub(crate) mesh: Spanned<MeshTable>,
    pub(crate) contact: ContactTable,
    #[serde(default)]
    pub(crate) rve: RveOptions,
    #[serde(default)]
    pub(crate) region: Vec<Spanned<RegionTable>>,
    #[serde(default)]
    pub(crate) boundary: Vec<Spanned<BoundaryTable>>,
    #[serde(default)]
    pub(crate) pressure: Vec<Spanned<PressureTable>>,
    #[serde(default)]
    pub(crate) traction: Vec<Spanned<TractionTable>>,
    #[serde(default)]
    pub(crate) body_force: Vec<Spanned<BodyForceTable>>,
    #[serde(default)]
    pub(crate) tilting_platen: Vec<Spanned<TiltingPlatenTable>>,
    #[serde(default)]
    pub(crate) rigid_body: Vec<Spanned<RigidBodyTable>>,
    #[serde(default)]
    pub(crate) periodic: Vec<Spanned<PeriodicTable>>,
    #[serde(default)]
    pub(crate) sum: Vec<Spanned<SumTable>>,
    #[serde(default)]
    pub(crate) initial_stress: InitialStressTable,
    #[serde(default)]
    pub(crate) procedure: ProcedureKeyword,
    #[serde(default)]
    pub(crate) loading: LoadingTable,
    #[serde(default)]
    pub(crate) dynamics: DynamicsTable,
    #[serde(default)]
    pub(crate) relaxation: RelaxationTable,
    pub(crate) nonlocal: Option<NonlocalSettings>,
    #[serde(default)]
    pub(crate) stage: Vec<Spanned<StageTable>>,
    #[serde(default)]
    pub(crate) solver: SolverTable,
    #[serde(default)]
    pub(crate) output: OutputTable,
    #[serde(default)]
    pub(crate) probe: Vec<Spanned<ProbeTable>>,
    #[serde(default)]
    pub(crate) checkpoint: CheckpointTable,
    #[serde(default)]
    pub(crate) pool: PoolTable,
}

/// `[checkpoint]`: when the state of a run is written. Changes no result.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct CheckpointTable {
    pub(crate) enabled: Option<bool>,
    pub(crate) steps: Option<Spanned<u64>>,
    pub(crate) seconds: Option<Spanned<f64>>,
}

/// `[pool]`: who solves the points and how the workers are led. Only `engine` and `points` change a result.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct PoolTable {
    pub(crate) hang_floor: Option<Spanned<f64>>,
    pub(crate) hang_factor: Option<Spanned<f64>>,
    pub(crate) hang_unknown: Option<Spanned<f64>>,
    pub(crate) stopped_limit: Option<Spanned<f64>>,
    pub(crate) patience: Option<Spanned<f64>>,
    pub(crate) restarts: Option<Spanned<u32>>,
    pub(crate) quarantine_after: Option<Spanned<u32>>,
    pub(crate) slice: Option<Spanned<usize>>,
    pub(crate) window: Option<Spanned<usize>>,
    pub(crate) lanes: Option<bool>,
    pub(crate) wait: Option<Spanned<String>>,
    pub(crate) engine: Option<String>,
    pub(crate) points: BTreeMap<String, Vec<Spanned<usize>>>,
    pub(crate) difference_strain: Option<Spanned<f64>>,
    pub(crate) difference_reuses: Option<Spanned<u32>>,
    pub(crate) most_workers: Option<Spanned<usize>>,
    pub(crate) recycle_jobs: Option<u64>,
    pub(crate) recycle_memory: Option<u64>,
}

/// `[mesh]`: the keys of all generators; which belong together is checked in `mesh`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshTable {
    pub(crate) file: Option<Spanned<PathBuf>>,
    pub(crate) generator: Option<Spanned<Generator>>,
    pub(crate) size: Option<Spanned<Vec<f64>>>,
    pub(crate) elements: Option<Spanned<Vec<usize>>>,
    pub(crate) grading: Option<Spanned<Vec<f64>>>,
    pub(crate) run: Option<Spanned<f64>>,
    pub(crate) element: Option<ElementKind>,
}

/// `[[region]]`: elements whose points are made of something else than the scene's packing.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RegionTable {
    pub(crate) name: String,
    pub(crate) elements: Option<Spanned<String>>,
    pub(crate) from: Option<Vec<f64>>,
    pub(crate) to: Option<Vec<f64>>,
    #[serde(default)]
    pub(crate) packings: Vec<Spanned<PathBuf>>,
    #[serde(default = "upright")]
    pub(crate) rotations: Vec<f64>,
    pub(crate) removal: Option<Removal>,
    pub(crate) contact: Option<ContactTable>,
    pub(crate) seed: Option<u64>,
    #[serde(default)]
    pub(crate) vary: VaryKeyword,
}

fn upright() -> Vec<f64> {
    vec![0.0]
}

/// What gets one lot where cells are dealt out at random.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum VaryKeyword {
    #[default]
    Point,
    Element,
}

/// Mesh generators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Generator {
    #[default]
    Block,
    Slope,
    Footing,
    Wall,
}

/// `[[stage]]`: what differs from the tables of the same names for the whole run.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StageTable {
    pub(crate) name: Spanned<String>,
    pub(crate) procedure: Option<ProcedureKeyword>,
    #[serde(default)]
    pub(crate) dynamics: DynamicsTable,
    #[serde(default)]
    pub(crate) relaxation: RelaxationTable,
    #[serde(default)]
    pub(crate) boundary: Vec<Spanned<BoundaryTable>>,
    #[serde(default)]
    pub(crate) pressure: Vec<Spanned<PressureTable>>,
    #[serde(default)]
    pub(crate) traction: Vec<Spanned<TractionTable>>,
    #[serde(default)]
    pub(crate) body_force: Vec<Spanned<BodyForceTable>>,
    #[serde(default)]
    pub(crate) tilting_platen: Vec<Spanned<TiltingPlatenTable>>,
    #[serde(default)]
    pub(crate) rigid_body: Vec<Spanned<RigidBodyTable>>,
    #[serde(default)]
    pub(crate) periodic: Vec<Spanned<PeriodicTable>>,
    #[serde(default)]
    pub(crate) sum: Vec<Spanned<SumTable>>,
    #[serde(default)]
    pub(crate) remove: Vec<Spanned<String>>,
    #[serde(default)]
    pub(crate) loading: LoadingTable,
    #[serde(default)]
    pub(crate) solver: SolverTable,
    #[serde(default)]
    pub(crate) output: StageOutputTable,
}

/// Ways to solve a stage.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ProcedureKeyword {
    #[default]
    Implicit,
    Relaxation,
    Dynamic,
}

/// `[stage.output]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct StageOutputTable {
    pub(crate) fields_every: Option<u64>,
}

/// `history`: the factor on the value of a condition over its stage.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum HistoryTable {
    Constant,
    Ramp,
    Table(Vec<[f64; 2]>),
    Sine(SineTable),
}

/// `sine` of a history.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SineTable {
    pub(crate) frequency: f64,
    #[serde(default)]
    pub(crate) phase: f64,
}

/// Where displacements count from.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum OriginKeyword {
    #[default]
    Stage,
    Run,
}

/// `[[boundary]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoundaryTable {
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) set: Spanned<String>,
    pub(crate) platen: Option<PlatenKind>,
    pub(crate) displacement: Spanned<Components>,
    pub(crate) history: Option<Spanned<HistoryTable>>,
    #[serde(default)]
    pub(crate) from: OriginKeyword,
}

/// `[[tilting_platen]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TiltingPlatenTable {
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) set: Spanned<String>,
    pub(crate) normal: AxisKeyword,
    pub(crate) displacement: Option<f64>,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

/// `[[rigid_body]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigidBodyTable {
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) set: Spanned<String>,
    #[serde(default)]
    pub(crate) displacement: Components,
    #[serde(default)]
    pub(crate) rotation: Components,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

/// `[[periodic]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PeriodicTable {
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) from: Spanned<String>,
    pub(crate) to: Spanned<String>,
    #[serde(default)]
    pub(crate) jump: Components,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

/// `[[sum]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SumTable {
    pub(crate) name: String,
    pub(crate) terms: Vec<TermTable>,
    #[serde(default)]
    pub(crate) value: f64,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

/// A summand of `[[sum]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TermTable {
    pub(crate) set: Spanned<String>,
    pub(crate) component: AxisKeyword,
    pub(crate) coefficient: f64,
}

/// Axes.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum AxisKeyword {
    X,
    Y,
    Z,
}

/// `[initial_stress]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct InitialStressTable {
    pub(crate) uniform: Option<StressTable>,
    pub(crate) geostatic: Option<GeostaticTable>,
    pub(crate) largest_deviation: Option<f64>,
    pub(crate) largest_imbalance: Option<f64>,
}

/// Components of a symmetric stress, Pa; what is left out is zero.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct StressTable {
    pub(crate) xx: f64,
    pub(crate) yy: f64,
    pub(crate) zz: f64,
    pub(crate) xy: f64,
    pub(crate) xz: f64,
    pub(crate) yz: f64,
}

/// `geostatic` of `[initial_stress]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GeostaticTable {
    pub(crate) surface: f64,
    pub(crate) unit_weight: f64,
    pub(crate) rest_coefficient: f64,
    #[serde(default)]
    pub(crate) surcharge: f64,
}

/// Components of a displacement (what is left out is free) or of a traction (what is left out is zero).
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Components {
    pub(crate) x: Option<f64>,
    pub(crate) y: Option<f64>,
    pub(crate) z: Option<f64>,
}

impl Components {
    /// By axis.
    pub(crate) fn by_axis(self) -> [(Axis, Option<f64>); 3] {
        [(Axis::X, self.x), (Axis::Y, self.y), (Axis::Z, self.z)]
    }
}

/// Platens.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PlatenKind {
    Smooth,
    Rough,
}

/// `[[pressure]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureTable {
    pub(crate) set: Spanned<String>,
    pub(crate) value: f64,
    #[serde(default)]
    pub(crate) kind: PressureKeyword,
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

/// Pressures.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PressureKeyword {
    #[default]
    Follower,
    Dead,
}

/// `[[traction]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TractionTable {
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) set: Spanned<String>,
    pub(crate) value: Components,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

/// `[[body_force]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BodyForceTable {
    #[serde(default = "all")]
    pub(crate) set: Spanned<String>,
    pub(crate) value: Components,
    pub(crate) name: Option<Spanned<String>>,
    pub(crate) history: Option<Spanned<HistoryTable>>,
}

fn all() -> Spanned<String> {
    Spanned::new(0..0, "all".to_owned())
}

/// `[loading]`; what is left out takes the solver's default.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LoadingTable {
    pub(crate) increments: Option<Spanned<usize>>,
    pub(crate) duration: Option<Spanned<f64>>,
    pub(crate) smallest_increment: Option<Spanned<f64>>,
    pub(crate) growth: Option<Spanned<f64>>,
    pub(crate) cut: Option<Spanned<f64>>,
    pub(crate) easy_iterations: Option<Spanned<usize>>,
    pub(crate) max_iterations: Option<Spanned<usize>>,
    pub(crate) control: Option<ControlTable>,
    pub(crate) adapt: Option<AdaptKeyword>,
    pub(crate) stabilise: Option<Spanned<bool>>,
    pub(crate) stabilise_after: Option<Spanned<usize>>,
    pub(crate) stabilise_increments: Option<Spanned<usize>>,
    pub(crate) stabilise_drag: Option<Spanned<f64>>,
}

/// How the step size follows the iterations.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum AdaptKeyword {
    Easy,
    Target,
}

/// `control` of `[loading]`: what a step prescribes.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ControlTable {
    Load,
    ArcLength(ArcLengthTable),
    Indirect(IndirectTable),
}

/// `arc_length`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ArcLengthTable {
    pub(crate) first_load: f64,
    pub(crate) set: Option<String>,
    pub(crate) component: Option<ComponentKeyword>,
}

/// `indirect`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct IndirectTable {
    pub(crate) set: String,
    pub(crate) relative_to: Option<String>,
    pub(crate) component: ComponentKeyword,
    pub(crate) growth: f64,
}

/// A space direction.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ComponentKeyword {
    X,
    Y,
    Z,
}

impl ComponentKeyword {
    /// The axis.
    pub(crate) fn axis(self) -> Axis {
        match self {
            Self::X => Axis::X,
            Self::Y => Axis::Y,
            Self::Z => Axis::Z,
        }
    }
}

/// `[solver]`; what is left out takes the solver's default.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SolverTable {
    pub(crate) formulation: Option<Spanned<FormulationKeyword>>,
    pub(crate) equations: Option<Spanned<EquationKeyword>>,
    pub(crate) hourglass: Option<Spanned<HourglassKeyword>>,
    pub(crate) strategy: Option<Spanned<String>>,
    pub(crate) renewal: Option<RenewalKeyword>,
    pub(crate) renewal_contraction: Option<Spanned<f64>>,
    pub(crate) renewal_uses: Option<Spanned<usize>>,
    pub(crate) quasi_newton_pairs: Option<Spanned<usize>>,
    pub(crate) target_grid: Option<Spanned<f64>>,
    pub(crate) criteria: Option<Spanned<Vec<CriterionKeyword>>>,
    pub(crate) energy_tolerance: Option<Spanned<f64>>,
    pub(crate) hourglass_coefficient: Option<Spanned<f64>>,
    pub(crate) tangent: Option<Spanned<TangentKind>>,
    pub(crate) force_tolerance: Option<Spanned<f64>>,
    pub(crate) displacement_tolerance: Option<Spanned<f64>>,
    pub(crate) predictor: Option<PredictorKeyword>,
    pub(crate) secant: Option<SecantTable>,
    pub(crate) tangent_floor: Option<Spanned<f64>>,
    pub(crate) capped_change: Option<Spanned<f64>>,
    pub(crate) keep_unchanged: Option<bool>,
}

/// What holds hourglass modes.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum HourglassKeyword {
    #[default]
    Stiffness,
    Viscous,
}

/// When tangents are asked for.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RenewalKeyword {
    Always,
    WhenSlow,
    EachStep,
    Once,
}

/// Criteria of convergence.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum CriterionKeyword {
    Force,
    ForceOverReactions,
    Displacement,
    CorrectionOverStep,
    Energy,
}

/// Ways to solve the global equations.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EquationKeyword {
    #[default]
    Direct,
    Iterative,
}

/// Formulations.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FormulationKeyword {
    SmallStrain,
    TotalLagrangian,
    #[default]
    Updated,
    Corotational,
}

/// Predictors.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PredictorKeyword {
    Linear,
    Tangent,
}

/// `[solver.secant]`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SecantTable {
    #[serde(default = "yes")]
    pub(crate) enabled: bool,
    pub(crate) min_change: Option<f64>,
    pub(crate) max_ratio: Option<f64>,
    pub(crate) floor: Option<f64>,
    pub(crate) carried: Option<bool>,
}

fn yes() -> bool {
    true
}

/// `[output]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct OutputTable {
    pub(crate) fields_every: u64,
    pub(crate) gauss_points: bool,
    pub(crate) grains: Vec<Spanned<usize>>,
    pub(crate) observables: Vec<ObservableKeyword>,
    pub(crate) plot: bool,
    pub(crate) plot_x: Option<Spanned<String>>,
    pub(crate) plot_y: Option<Spanned<String>>,
}

impl Default for OutputTable {
    fn default() -> Self {
        Self {
            fields_every: 1,
            gauss_points: false,
            grains: Vec::new(),
            observables: ObservableKeyword::ALL.to_vec(),
            plot: true,
            plot_x: None,
            plot_y: None,
        }
    }
}

/// Optional results of every Gauss point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ObservableKeyword {
    Rotation,
    CoordinationNoRattlers,
    Fabric,
    SlidingFraction,
    Energy,
}

impl ObservableKeyword {
    /// All of them: the default.
    pub(crate) const ALL: [Self; 5] =
        [Self::Rotation, Self::CoordinationNoRattlers, Self::Fabric, Self::SlidingFraction, Self::Energy];
}

/// `[[probe]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProbeTable {
    pub(crate) name: Spanned<String>,
    pub(crate) kind: ProbeKind,
    pub(crate) set: Option<Spanned<String>>,
    pub(crate) from: Option<Spanned<String>>,
    pub(crate) to: Option<Spanned<String>>,
    pub(crate) component: Option<Spanned<String>>,
}

/// What a probe measures.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ProbeKind {
    Reaction,
    Displacement,
    Strain,
    Compression,
    VolumeChange,
    MeanStress,
    StressRatio,
    MeanPressure,
    Deviator,
    VoidRatio,
    CoordinationNumber,
    ElasticEnergy,
    FrictionalDissipation,
    HourglassEnergy,
    Velocity,
    Acceleration,
    KineticEnergy,
    EnergyResidual,
}

impl ProbeKind {
    /// The keyword of the scene file.
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
