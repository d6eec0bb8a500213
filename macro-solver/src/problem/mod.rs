//! What is to be solved: mesh, formulation, and the stages of loading one after the other.
//!
//! A [`Problem`] is plain data. [`Problem::validate`] finds everything that can be wrong with it before a single
//! Gauss point is asked; the solver refuses a problem that does not validate.

use crate::element::hourglass::HourglassControl;
use crate::formulation::Formulation;
use crate::mesh::Mesh;
use protocol::{Observables, TangentKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod amplitude;
mod axis;
mod condition;
mod constraint_equations;
mod criteria;
pub mod dynamics;
pub(crate) mod elimination;
mod equations;
mod error;
mod error_control;
mod initial_stress;
mod multi_point_constraint;
mod named_strategy;
mod path_control;
mod pore_fluid;
mod prescribed;
mod quasi_newton;
mod rate_history;
pub mod relaxation;
mod rigid_motion;
mod smooth_step;
mod stabilisation;
mod stage;
mod step_control;
mod strategy;
mod tangent_update;
mod validation;

pub use amplitude::{Amplitude, Moment};
pub use axis::Axis;
pub use condition::{Applied, Condition, Origin, Platen, PressureKind};
pub use criteria::{ConvergenceMeasures, Criteria, DisplacementMeasure, ForceMeasure, Tolerances};
pub use equations::EquationSettings;
pub use error::ProblemError;
pub use error_control::ErrorControl;
pub use initial_stress::{EquilibriumSettings, InitialLimits, InitialPreparation, InitialState, InitialStress};
pub use multi_point_constraint::{ConstraintTerm, Directions, MultiPointConstraint};
pub use named_strategy::NamedStrategy;
pub use path_control::PathControl;
pub use pore_fluid::PoreFluid;
pub use prescribed::Prescribed;
pub use quasi_newton::QuasiNewton;
pub use rate_history::{Rate, RateHistory};
pub use smooth_step::SmoothRamp;
pub use stabilisation::Stabilisation;
pub use stage::{Procedure, Stage};
pub use step_control::{LoadingSettings, StepAdaptation, StepControl};
pub use strategy::{Predictor, SecantSettings, Strategy};
pub use tangent_update::TangentUpdate;

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
    /// Whether stresses are symmetric, because moments balance on every grain: not where rotations are blocked. Where they should be, others
    /// count as defects of an engine.
    pub symmetric_stresses: bool,
    /// Whether a point that a step does not deform keeps its committed stress unasked, unless a tangent is wanted: what an engine that answers
    /// increments of exactly zero by its committed state would reply, but for round-off.
    pub keeps_still_points: bool,
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
            symmetric_stresses: true,
            keeps_still_points: true,
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

    /// The tangent operators that engines are asked for during a run: those of the stages, and the one that every stage begins with before
    /// it knows which contacts slip.
    pub fn requested_tangents(&self) -> Vec<TangentKind> {
        let mut tangents = self.tangents();
        if !tangents.contains(&TangentKind::TrussLike) {
            tangents.push(TangentKind::TrussLike);
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
