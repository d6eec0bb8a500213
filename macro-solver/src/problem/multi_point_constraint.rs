//! Conditions that tie displacements to one another: rigid bodies, tilting platens, periodic faces, sums.

use super::axis::Axis;

/// A condition between displacements. What it says counts from the beginning of its stage: rotations are linearised about
/// the positions at that time.
#[derive(Clone, Debug, PartialEq)]
pub enum MultiPointConstraint {
    /// The nodes move as one rigid body. A component left out is free.
    RigidBody {
        /// Node set.
        nodes: String,
        /// Displacement of the middle of the extent of the set at factor 1, m.
        displacement: [Option<f64>; 3],
        /// Rotation vector at factor 1, rad; in the plane only the third component.
        rotation: [Option<f64>; 3],
    },
    /// A rigid, smooth platen that may tilt: across it the nodes stay in one plane, along it they slide freely. It carries
    /// no moment.
    TiltingPlaten {
        /// Node set.
        nodes: String,
        /// Normal of the platen.
        axis: Axis,
        /// Displacement of its middle along the axis at factor 1, m; `None`: it moves freely, under loads.
        displacement: Option<f64>,
        /// Rotation vector at factor 1, rad; a component that is left out is free, that along the normal has to be.
        rotation: [Option<f64>; 3],
    },
    /// Nodes move by a given amount along directions of their own, and freely across them.
    Guided {
        /// The directions, and the set.
        along: Directions,
        /// Displacement at factor 1, m.
        displacement: f64,
    },
    /// Every node of one set moves as its image in the other one plus a jump that is the same for all pairs.
    Periodic {
        /// Node set.
        from: String,
        /// Node set: the same, shifted.
        to: String,
        /// Displacement of `to` minus that of `from` at factor 1, m; a component left out finds its own value.
        jump: [Option<f64>; 3],
    },
    /// A sum of mean displacements of node sets.
    Sum {
        /// Summands.
        terms: Vec<ConstraintTerm>,
        /// Value of the sum at factor 1, m.
        value: f64,
    },
}

/// Directions of the nodes of [`MultiPointConstraint::Guided`], as at the beginning of the stage.
#[derive(Clone, Debug, PartialEq)]
pub enum Directions {
    /// The outward normals of a side set: at a node the mean of the sides that meet there, weighted by area.
    Normal {
        /// Side set.
        sides: String,
    },
    /// Away from a line along z, or in the plane from a point.
    Radial {
        /// Node set.
        nodes: String,
        /// A point of the line, m.
        centre: [f64; 2],
    },
}

/// A summand of [`MultiPointConstraint::Sum`].
#[derive(Clone, Debug, PartialEq)]
pub struct ConstraintTerm {
    /// Node set; its mean displacement counts.
    pub nodes: String,
    /// Component.
    pub axis: Axis,
    /// Coefficient, dimensionless.
    pub coefficient: f64,
}

impl MultiPointConstraint {
    /// Every number in it.
    pub(super) fn numbers(&self) -> Vec<f64> {
        match self {
            Self::RigidBody { displacement, rotation, .. } => {
                displacement.iter().chain(rotation).flatten().copied().collect()
            }
            Self::TiltingPlaten { displacement, rotation, .. } => {
                displacement.iter().chain(rotation.iter().flatten()).copied().collect()
            }
            Self::Guided { along, displacement } => match along {
                Directions::Normal { .. } => vec![*displacement],
                Directions::Radial { centre, .. } => vec![*displacement, centre[0], centre[1]],
            },
            Self::Periodic { jump, .. } => jump.iter().flatten().copied().collect(),
            Self::Sum { terms, value } => terms.iter().map(|term| term.coefficient).chain([*value]).collect(),
        }
    }

    /// Whether it prescribes a motion.
    pub(super) fn moves(&self) -> bool {
        let any = |values: &[Option<f64>]| values.iter().flatten().any(|value| *value != 0.0);
        match self {
            Self::RigidBody { displacement, rotation, .. } => any(displacement) || any(rotation),
            Self::TiltingPlaten { displacement, rotation, .. } => any(&[*displacement]) || any(rotation),
            Self::Guided { displacement, .. } => *displacement != 0.0,
            Self::Periodic { jump, .. } => any(jump),
            Self::Sum { value, .. } => *value != 0.0,
        }
    }

    /// The same with every value 0 and what was free still free: how it holds on in later stages.
    #[must_use]
    pub fn held(&self) -> Self {
        let mut held = self.clone();
        let clear = |values: &mut [Option<f64>]| values.iter_mut().flatten().for_each(|value| *value = 0.0);
        match &mut held {
            Self::RigidBody { displacement, rotation, .. } => {
                clear(displacement);
                clear(rotation);
            }
            Self::TiltingPlaten { displacement, rotation, .. } => {
                clear(std::slice::from_mut(displacement));
                clear(rotation);
            }
            Self::Guided { displacement, .. } => *displacement = 0.0,
            Self::Periodic { jump, .. } => clear(jump),
            Self::Sum { value, .. } => *value = 0.0,
        }
        held
    }
}
