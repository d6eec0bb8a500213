//! What is to be solved: mesh, formulation, and the stages of loading one after the other.
//!
//! A [`Problem`] is plain data. [`Problem::validate`] finds everything that can be wrong with it before a single
//! Gauss point is asked; the solver refuses a problem that does not validate.

use crate::element::hourglass::HourglassControl;
use crate::element::mass::MassError;
use crate::formulation::Formulation;
use crate::mesh::{Mesh, MeshError};
use crate::nonlocal::NonlocalError;
use keys::Fault;
use protocol::{Observables, TangentKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

mod amplitude;
mod condition;
mod criteria;
pub mod dynamics;
pub(crate) mod elimination;
mod equations;
mod error_control;
mod initial_stress;
mod multi_point_constraint;
mod named_strategy;
mod path_control;
mod pore_fluid;
mod rate_history;
pub mod relaxation;
mod rigid_motion;
mod smooth_step;
mod stage;
mod strategy;
mod validation;

pub use amplitude::{Amplitude, Moment};
pub use condition::{Applied, Axis, Condition, Origin, Platen, PressureKind};
pub use criteria::{ConvergenceMeasures, Criteria, DisplacementMeasure, ForceMeasure, Tolerances};
pub use equations::EquationSettings;
pub use error_control::ErrorControl;
pub use initial_stress::{EquilibriumSettings, InitialLimits, InitialPreparation, InitialState, InitialStress};
pub use multi_point_constraint::{ConstraintTerm, Directions, MultiPointConstraint};
pub use named_strategy::{NamedStrategy, QuasiNewton, TangentUpdate};
pub use path_control::PathControl;
pub use pore_fluid::PoreFluid;
pub use rate_history::{Rate, RateHistory};
pub use smooth_step::SmoothRamp;
pub use stage::{LoadingSettings, Procedure, Stabilisation, Stage, StepControl, StepRule};
pub use strategy::{Predictor, SecantGates, Strategy};
pub use validation::Prescribed;

/// How the global equations are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EquationSolver {
    /// Sparse LU; the choice for the plane and for small solids.
    #[default]
    Direct,
    /// BiCGStab with an incomplete factorization; what it cannot solve is solved directly and counted.
    Iterative,
}

/// A boundary-value problem; in the plane per metre of thickness.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Geometry and named sets.
    pub mesh: Mesh,
    /// What is done to the body, one stage after the other; each goes on from the state that the one before has left.
    pub stages: Vec<Stage>,
    /// What is asked of the stress that the points start with.
    pub initial: InitialState,
    /// What motion means for the points, and which stress is integrated where.
    pub formulation: Formulation,
    /// How the global equations are solved.
    pub equations: EquationSolver,
    /// What holds the hourglass modes of elements with one point.
    pub hourglass: HourglassControl,
    /// Optional results asked of every point in every evaluation.
    pub observables: Observables,
    /// Strain that a point applies in one ramp increment: a step fixes each point's number of increments to its
    /// predicted largest `|H_ij|` over this. 0 lets the engine choose at every evaluation, which makes the stress
    /// jump with the strain; only for laws without a ramp.
    pub strain_per_step: f64,
    /// Error that the strain per ramp increment is chosen for, step by step, starting with `strain_per_step`; `None`: it stays. Needs a
    /// material that estimates its error.
    pub error_control: Option<ErrorControl>,
    /// Fluid in the pores that cannot drain; `None`: pores are dry, or drain freely.
    pub pore_fluid: Option<PoreFluid>,
}

impl Problem {
    /// A problem of one stage on `mesh` with default control, tolerances and strategy and no ramp. Pressures are
    /// constant, everything else ramps up from 0.
    pub fn new(mesh: Mesh, conditions: Vec<Condition>) -> Self {
        Self {
            mesh,
            stages: vec![Stage::new("loading", conditions.into_iter().map(Applied::from).collect())],
            initial: InitialState::default(),
            formulation: Formulation::default(),
            equations: EquationSolver::default(),
            hourglass: HourglassControl::default(),
            observables: Observables::NONE,
            strain_per_step: 0.0,
            error_control: None,
            pore_fluid: None,
        }
    }

    /// Number of Gauss points, numbered through as in [`Mesh::first_points`].
    pub fn point_count(&self) -> usize {
        self.mesh.point_count()
    }

    /// The tangent operators that its stages ask for, each once.
    pub fn tangents(&self) -> Vec<TangentKind> {
        let mut tangents: Vec<TangentKind> = Vec::new();
        for stage in &self.stages {
            if !tangents.contains(&stage.strategy.tangent) {
                tangents.push(stage.strategy.tangent);
            }
        }
        tangents
    }

    /// Whether the friction between grains is changed in any stage.
    pub fn changes_friction(&self) -> bool {
        let conditions = self.stages.iter().flat_map(|stage| &stage.conditions);
        conditions.into_iter().any(|applied| matches!(applied.condition, Condition::Friction { .. }))
    }

    /// Time from the start of the run to the beginning of a stage, s.
    pub fn begin_of(&self, stage: usize) -> f64 {
        self.stages[..stage].iter().map(|stage| stage.duration).sum()
    }
}

/// Why a problem was refused.
#[derive(Debug, Error, PartialEq)]
pub enum ProblemError {
    /// There is nothing to do.
    #[error("there is no stage; a problem needs at least one")]
    NoStage,
    /// One of several stages is at fault.
    #[error("stage '{stage}': {error}")]
    Stage {
        /// Number of the stage, from 0.
        number: usize,
        /// Its name.
        stage: String,
        /// What is wrong with it.
        error: Box<ProblemError>,
    },
    /// A setting is out of the range of its key.
    #[error(transparent)]
    Setting(#[from] Fault),
    /// The history of a condition is not usable.
    #[error("the history of a condition is not usable: {reason}")]
    History {
        /// What it should be.
        reason: &'static str,
    },
    /// A load factor that is an unknown needs histories that change with it from the first step on.
    #[error(
        "the load factor is an unknown of this stage (loading.control), and a smooth history, a velocity or an acceleration may not \
         change with it at the start; give the conditions of the stage the history \"ramp\" or \"constant\""
    )]
    HistoryAtRest,
    /// The way from one friction to another leaves what lies between them.
    #[error(
        "friction goes from one value to another: its history lies between 0 and 1, so it is \"constant\", \"ramp\", \"smooth\", a smooth \
         ramp or a table of such factors"
    )]
    FrictionHistory,
    /// Friction cannot follow an unknown load factor.
    #[error(
        "friction changes in this stage, and its load factor is an unknown (loading.control): how the forces change with friction is not \
         known to the solver; use control = \"load\""
    )]
    FrictionUnknownLoad,
    /// A node at the centre of its radial displacement, or between sides that cancel.
    #[error("node {node} at {} has no direction along which it could be displaced; leave it out of the set", coordinates(.place))]
    NoDirection {
        /// Node, from 0.
        node: usize,
        /// Its position, m.
        place: [f64; 3],
    },
    /// Two conditions change the friction of one element.
    #[error(
        "the friction of element {element} is given twice, by sets '{first}' and '{second}'; give the sets no element in common"
    )]
    TwoFrictions {
        /// Element, from 0.
        element: usize,
        /// First element set.
        first: String,
        /// Second element set.
        second: String,
    },
    /// The mesh is not usable.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A condition names a node set that the mesh lacks.
    #[error("no node set '{name}'; the mesh has: {available}")]
    UnknownNodeSet {
        /// As written.
        name: String,
        /// What there is.
        available: String,
    },
    /// A condition names a side set that the mesh lacks.
    #[error("no side set '{name}'; the mesh has: {available}")]
    UnknownSideSet {
        /// As written.
        name: String,
        /// What there is.
        available: String,
    },
    /// A condition names an element set that the mesh lacks.
    #[error("no element set '{name}'; the mesh has: {available}")]
    UnknownElementSet {
        /// As written.
        name: String,
        /// What there is.
        available: String,
    },
    /// Dashpots hold nothing at rest.
    #[error(
        "viscous hourglass control does nothing in a quasi-static problem, so elements with one Gauss point would be \
         free to hourglass; use the stiffness form"
    )]
    ViscousHourglass,
    /// The masses of an element are not usable.
    #[error(transparent)]
    Mass(#[from] MassError),
    /// The nonlocal operator is not usable.
    #[error(transparent)]
    Nonlocal(#[from] NonlocalError),
    /// A material that sees rotations cannot be given averages.
    #[error(
        "averages over neighbours are averages of strain increments, but with the formulation \"{formulation}\" the points \
         see displacement gradients, rotations included; use \"corotational\" or \"small_strain\""
    )]
    NonlocalFormulation {
        /// Keyword of the formulation.
        formulation: &'static str,
    },
    /// A condition acts along z on a plane mesh.
    #[error("a plane problem has no direction z: displacements and forces along it must be left out")]
    NoThirdAxis,
    /// Two conditions prescribe different values for one component of one node.
    #[error(
        "node {node} at {} is given two different displacements or histories along {axis:?}: {first:.6e} m by '{first_set}' and \
         {second:.6e} m by '{second_set}'",
        coordinates(.place)
    )]
    Contradiction {
        /// Node, from 0.
        node: usize,
        /// Component.
        axis: Axis,
        /// Value of the earlier condition, m.
        first: f64,
        /// Value of the later condition, m.
        second: f64,
        /// Where the node is, m.
        place: [f64; 3],
        /// Node set of the earlier condition.
        first_set: String,
        /// Node set of the later condition.
        second_set: String,
    },
    /// Two sets are to move alike, but are not images of each other.
    #[error("node {node} has no partner: the node sets '{from}' and '{to}' are not shifted images of each other")]
    NoImage {
        /// Node, from 0.
        node: usize,
        /// One set.
        from: String,
        /// The other one.
        to: String,
    },
    /// Displacements cannot be tied to one another as asked.
    #[error("{reason}; {remedy}")]
    MultiPointConstraint {
        /// What is wrong.
        reason: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// A part of the mesh can still move as a rigid body.
    #[error("the supports leave the part of the mesh around element {element} free to {motion}; hold another node")]
    RigidMotion {
        /// First element of the part.
        element: usize,
        /// The free motion, in words.
        motion: String,
    },
    /// A number is out of range or not finite.
    #[error("{what} must be {requirement}, not {value}")]
    Number {
        /// Name of the quantity.
        what: &'static str,
        /// What it has to be.
        requirement: &'static str,
        /// As given.
        value: f64,
    },
}

/// A place for people, m.
fn coordinates(place: &[f64; 3]) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", place[0], place[1], place[2])
}
