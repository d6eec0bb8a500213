//! Why a problem is refused.

use super::axis::Axis;
use crate::element::mass::MassError;
use crate::mesh::MeshError;
use crate::nonlocal::NonlocalError;
use keys::Fault;
use thiserror::Error;

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
    /// One of the conditions of a stage is at fault.
    #[error("{error}")]
    Condition {
        /// Number of the condition in [`Stage::conditions`](super::Stage::conditions), from 0.
        number: usize,
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
         change with it at the start; give displacements of the stage the history \"ramp\", and loads \"ramp\" or \"constant\""
    )]
    HistoryAtRest,
    /// Prescribed motion that an unknown load factor does not lead along its history.
    #[error(
        "the load factor is an unknown of this stage (loading.control), and a displacement of it does not grow in proportion to that factor: it \
         would miss its history; give it the history \"ramp\", or prescribe it in a stage before this one"
    )]
    MotionOffRamp,
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
        "the friction of element {element} is given twice, by sets '{first}' and '{second}'; give the sets no element \
         in common, or let the later condition replace the earlier one by the same `name`"
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
    #[error(
        "a plane problem has no direction z: displacements and forces along it, and rotations but that about z, must be left out"
    )]
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
    /// The load factor is to follow from displacements that it does not change.
    #[error(
        "loading.control measures displacements that do not depend on the load factor, since they are held, or those of a set relative to \
         itself; measure a set that the load moves"
    )]
    NothingMeasured,
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

impl ProblemError {
    /// The same, known to be the fault of a condition of its stage.
    pub(super) fn of_condition(self, number: usize) -> Self {
        Self::Condition { number, error: Box::new(self) }
    }

    /// What is wrong, whichever stage or condition it is found in.
    pub fn cause(&self) -> &Self {
        match self {
            Self::Stage { error, .. } | Self::Condition { error, .. } => error.cause(),
            cause => cause,
        }
    }

    /// As [`ProblemError::cause`], without what it is found in.
    pub fn into_cause(self) -> Self {
        match self {
            Self::Stage { error, .. } | Self::Condition { error, .. } => error.into_cause(),
            cause => cause,
        }
    }
}

/// A place for people, m.
fn coordinates(place: &[f64; 3]) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", place[0], place[1], place[2])
}
