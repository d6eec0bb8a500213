//! What is to be solved: mesh, conditions of one load stage, step control, tolerances and strategy.
//!
//! A [`Problem`] is plain data. [`Problem::validate`] finds everything that can be wrong with it before a single
//! Gauss point is asked; the solver refuses a problem that does not validate.

use crate::element::hourglass::HourglassControl;
use crate::formulation::Formulation;
use crate::mesh::{Mesh, MeshError};
use protocol::{Observables, TangentKind};
use thiserror::Error;

mod validation;

/// A space direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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

/// Whether a pressure turns and stretches with the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PressureKind {
    /// Acts on the current side along its current normal, as cell water does on a membrane.
    #[default]
    Follower,
    /// The force on the initial side, kept in size and direction.
    Dead,
}

/// How a platen holds the ends of a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Platen {
    /// Prescribes the displacement across the platen only.
    Smooth,
    /// Prescribes the displacement across the platen and forbids those along it.
    Rough,
}

/// One condition of the stage.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// One displacement component of a node set, `value x load`; 0 holds it.
    Displacement {
        /// Node set.
        nodes: String,
        /// Component.
        axis: Axis,
        /// Value at load 1, m.
        value: f64,
    },
    /// A rigid platen on a node set, moved along its normal by `displacement x load`.
    Platen {
        /// Node set.
        nodes: String,
        /// Smooth or rough.
        contact: Platen,
        /// Normal of the platen.
        axis: Axis,
        /// Displacement along the axis at load 1, m.
        displacement: f64,
    },
    /// A pressure on a side set, constant over the stage.
    Pressure {
        /// Side set.
        sides: String,
        /// Pressure, Pa, **compression positive**.
        value: f64,
        /// Follower or dead.
        kind: PressureKind,
    },
    /// A force per initial area of a side set, `value x load`, kept in direction.
    Traction {
        /// Side set.
        sides: String,
        /// Value at load 1, Pa.
        value: [f64; 3],
    },
    /// A force per initial volume of an element set, `value x load`, kept in direction: weight is mass density times
    /// the acceleration of gravity.
    BodyForce {
        /// Element set.
        elements: String,
        /// Value at load 1, N/m3.
        value: [f64; 3],
    },
}

impl Condition {
    /// Holds one displacement component of a node set.
    pub fn fixed(nodes: impl Into<String>, axis: Axis) -> Self {
        Self::Displacement { nodes: nodes.into(), axis, value: 0.0 }
    }
}

/// How the load factor goes from 0 to 1. All sizes are shares of the stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StepControl {
    /// Number of equal steps if nothing is cut back; the first and largest size is `1 / increments`.
    pub increments: usize,
    /// Smallest size that is still tried.
    pub min: f64,
    /// Factor on the size after an easy step, at least 1; the size never exceeds `1 / increments`.
    pub growth: f64,
    /// Factor on the size after a failed step, below 1.
    pub cut: f64,
    /// A step with at most this many iterations is easy.
    pub target_iterations: usize,
    /// A step that has not converged after this many iterations is cut back.
    pub max_iterations: usize,
}

impl Default for StepControl {
    fn default() -> Self {
        Self { increments: 20, min: 1e-4, growth: 1.5, cut: 0.5, target_iterations: 6, max_iterations: 15 }
    }
}

/// When a step counts as converged: **both** criteria.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Norm of the out-of-balance force at free degrees of freedom over the norm of the reactions or of the applied
    /// loads, whichever is larger.
    pub force: f64,
    /// Norm of the correction that the accepted state would still get over the norm of the displacements of a full
    /// step, `1 / increments` of the stage, at the rate of this step. The correction comes from the tangent at that
    /// state and costs no evaluation. Errors do not add up over steps, since every step restores the whole balance;
    /// so a step that was cut back is not held to a smaller absolute error.
    pub displacement: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { force: 1e-3, displacement: 1e-2 }
    }
}

/// How the first iterate of a step is guessed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Predictor {
    /// The last accepted step's displacements scaled by the ratio of step sizes; the tangent predictor where there
    /// is no such step.
    #[default]
    Linear,
    /// One linear solve with the last tangent.
    Tangent,
}

/// Rank-one correction of the tangent of each point from its last two evaluations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecantGates {
    /// Pairs of targets closer than this are noise and are not used; dimensionless strain.
    pub min_change: f64,
    /// Pairs whose stress change over target change exceeds this many times the norm of the point's first tangent
    /// are not used (Frobenius norms).
    pub max_ratio: f64,
    /// The smallest eigenvalue of the corrected symmetric part in strain space must stay above this share of the
    /// point's first tangent's `C_2222`; the correction is halved twice, then dropped.
    pub floor: f64,
}

impl Default for SecantGates {
    fn default() -> Self {
        Self { min_change: 2e-5, max_ratio: 3.0, floor: 0.02 }
    }
}

/// Choices that change the path to the answer, not the equations.
#[derive(Clone, Debug, PartialEq)]
pub struct Strategy {
    /// Tangent operator asked of every point.
    pub tangent: TangentKind,
    /// First iterate of a step.
    pub predictor: Predictor,
    /// Per-point secant correction; `None` switches it off.
    pub secant: Option<SecantGates>,
    /// Smallest stiffness against any strain that the global tangent takes from a point, as a share of the `C_2222`
    /// of the point's first tangent; weaker directions are stiffened to it. Tangents of slipping networks can be
    /// nearly singular and would send corrections anywhere; the equations solved are not touched. `None` takes
    /// tangents as they are.
    pub tangent_floor: Option<f64>,
    /// Largest change of any component of any point's `H` from one iterate to the next, dimensionless. Until the
    /// residual of an attempt grows, changes up to the step's own largest predicted `|H_ij|` are allowed too.
    pub capped_change: f64,
    /// Whether a point whose target has not changed in any bit since its last evaluation of this step keeps that
    /// answer instead of being asked again. Exact: a trial is a pure function of its target.
    pub keep_unchanged: bool,
}

impl Default for Strategy {
    fn default() -> Self {
        Self {
            tangent: TangentKind::TrussLikeSlip,
            predictor: Predictor::Linear,
            secant: None,
            tangent_floor: Some(0.02),
            capped_change: 1e-3,
            keep_unchanged: true,
        }
    }
}

/// How the global equations are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EquationSolver {
    /// Sparse LU; the choice for the plane and for small solids.
    #[default]
    Direct,
    /// BiCGStab with an incomplete factorization; what it cannot solve is solved directly and counted.
    Iterative,
}

/// A boundary-value problem of one load stage; in the plane per metre of thickness.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Geometry and named sets.
    pub mesh: Mesh,
    /// Supports and loads.
    pub conditions: Vec<Condition>,
    /// Load steps.
    pub control: StepControl,
    /// Convergence.
    pub tolerances: Tolerances,
    /// Path to the answer.
    pub strategy: Strategy,
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
}

impl Problem {
    /// A problem on `mesh` with default control, tolerances and strategy and no ramp.
    pub fn new(mesh: Mesh, conditions: Vec<Condition>) -> Self {
        Self {
            mesh,
            conditions,
            control: StepControl::default(),
            tolerances: Tolerances::default(),
            strategy: Strategy::default(),
            formulation: Formulation::default(),
            equations: EquationSolver::default(),
            hourglass: HourglassControl::default(),
            observables: Observables::NONE,
            strain_per_step: 0.0,
        }
    }

    /// Number of Gauss points, numbered through as in [`Mesh::first_points`].
    pub fn point_count(&self) -> usize {
        self.mesh.point_count()
    }
}

/// Why a problem was refused.
#[derive(Debug, Error, PartialEq)]
pub enum ProblemError {
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
    /// A condition acts along z on a plane mesh.
    #[error("a plane problem has no direction z: displacements and forces along it must be left out")]
    NoThirdAxis,
    /// Two conditions prescribe different values for one component of one node.
    #[error("node {node} is given two different displacements along {axis:?}: {first:.6e} m and {second:.6e} m")]
    Contradiction {
        /// Node, from 0.
        node: usize,
        /// Component.
        axis: Axis,
        /// Value of the earlier condition, m.
        first: f64,
        /// Value of the later condition, m.
        second: f64,
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
