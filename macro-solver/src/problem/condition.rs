//! Supports and loads.

use super::amplitude::Amplitude;
use super::axis::Axis;
use super::multi_point_constraint::MultiPointConstraint;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether a pressure turns and stretches with the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PressureKind {
    /// Acts on the current side along its current normal, as cell water does on a membrane.
    #[default]
    Follower,
    /// The force on the initial side, kept in size and direction.
    Dead,
}

/// How a platen holds the ends of a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Platen {
    /// Prescribes the displacement across the platen only.
    Smooth,
    /// Prescribes the displacement across the platen and forbids those along it.
    Rough,
}

/// Where a prescribed displacement counts from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// From where each node stands when the stage begins, so that value 0 holds the node there.
    #[default]
    Stage,
    /// From where each node stood when the run began: the history leads from where the node is to there.
    Run,
}

/// A condition and how it comes about over a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Applied {
    /// What is prescribed.
    pub condition: Condition,
    /// The factor on its value over the stage.
    pub history: Amplitude,
    /// Where displacements count from; without meaning for forces.
    pub origin: Origin,
}

impl Applied {
    /// A condition with a history; displacements count from the beginning of the stage.
    pub fn new(condition: Condition, history: Amplitude) -> Self {
        Self { condition, history, origin: Origin::Stage }
    }
}

/// What a condition prescribes over a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    /// A support that moves.
    MovingSupport,
    /// A load that changes.
    ChangingLoad,
    /// Something that stays as it is, supports at rest among them.
    Constant,
}

impl Applied {
    /// Whether it changes anything over its stage.
    pub fn changes(&self) -> bool {
        self.action() != Action::Constant
    }

    /// Whether it moves a support or what is linked.
    pub(super) fn moves_support(&self) -> bool {
        self.action() == Action::MovingSupport
    }

    /// What it does over the stage.
    pub(super) fn action(&self) -> Action {
        let changes = match self.history {
            Amplitude::Constant => false,
            Amplitude::Ramp { from, to }
            | Amplitude::Smooth { from, to }
            | Amplitude::SmoothRamp { from, to, .. } => from != to,
            Amplitude::Table(_) | Amplitude::Sine { .. } | Amplitude::Rate(_) => true,
        };
        let kept = Action::Constant;
        // Back to where a node stood when the run began, 0 is a motion like any other value.
        let moves = |values: &[f64]| self.origin == Origin::Run || values.iter().any(|value| *value != 0.0);
        match &self.condition {
            Condition::Pressure { value, .. } if changes && *value != 0.0 => Action::ChangingLoad,
            Condition::Traction { value, .. } | Condition::BodyForce { value, .. }
                if changes && *value != [0.0; 3] =>
            {
                Action::ChangingLoad
            }
            Condition::Pressure { .. } | Condition::Traction { .. } | Condition::BodyForce { .. } => kept,
            // What a body carries falls with its friction, also at once at the beginning of a stage.
            Condition::Friction { from, to, .. } if from != to => Action::ChangingLoad,
            Condition::Friction { .. } => kept,
            // A displacement of constant factor is reached in the first step, by a motion too.
            Condition::Displacement { value, .. } if moves(&[*value]) => Action::MovingSupport,
            Condition::Platen { displacement, .. } if moves(&[*displacement]) => Action::MovingSupport,
            Condition::MultiPointConstraint(constraint) if constraint.moves() => Action::MovingSupport,
            Condition::Displacement { .. } | Condition::Platen { .. } | Condition::MultiPointConstraint(_) => kept,
        }
    }
}

impl From<Condition> for Applied {
    /// A pressure is constant, everything else ramps up from 0.
    fn from(condition: Condition) -> Self {
        let history = match condition {
            Condition::Pressure { .. } => Amplitude::Constant,
            Condition::Displacement { .. }
            | Condition::Platen { .. }
            | Condition::Traction { .. }
            | Condition::BodyForce { .. }
            | Condition::MultiPointConstraint(_)
            | Condition::Friction { .. } => Amplitude::RAMP,
        };
        Self::new(condition, history)
    }
}

/// One condition; its value is multiplied by the factor of a history, see [`Applied`].
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// One displacement component of a node set; 0 holds it.
    Displacement {
        /// Node set.
        nodes: String,
        /// Component.
        axis: Axis,
        /// Value at factor 1, m; with a history of a rate in m/s or m/s2.
        value: f64,
    },
    /// A rigid platen on a node set, moved along its normal by `displacement`.
    Platen {
        /// Node set.
        nodes: String,
        /// Smooth or rough.
        contact: Platen,
        /// Normal of the platen.
        axis: Axis,
        /// Displacement along the axis at factor 1, m; with a history of a rate in m/s or m/s2.
        displacement: f64,
    },
    /// A pressure on a side set.
    Pressure {
        /// Side set.
        sides: String,
        /// Pressure, Pa, **compression positive**.
        value: f64,
        /// Follower or dead.
        kind: PressureKind,
    },
    /// A force per initial area of a side set, kept in direction.
    Traction {
        /// Side set.
        sides: String,
        /// Value at factor 1, Pa.
        value: [f64; 3],
    },
    /// A force per initial volume of an element set, kept in direction: weight is mass density times the acceleration
    /// of gravity.
    BodyForce {
        /// Element set.
        elements: String,
        /// Value at factor 1, N/m3.
        value: [f64; 3],
    },
    /// Displacements that are tied to one another.
    MultiPointConstraint(MultiPointConstraint),
    /// Friction between the grains of an element set, over that of their definition: at first `from`, at factor 1 `to`.
    Friction {
        /// Element set.
        elements: String,
        /// Over the friction of the definition at factor 0, 0 to 1.
        from: f64,
        /// The same at factor 1.
        to: f64,
    },
}

impl Condition {
    /// Holds one displacement component of a node set.
    pub fn fixed(nodes: impl Into<String>, axis: Axis) -> Self {
        Self::Displacement { nodes: nodes.into(), axis, value: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn supports_that_move_and_loads_that_change_are_told_apart() {
        let pressure = |value| Condition::Pressure { sides: "s".into(), value, kind: PressureKind::Follower };
        let platen = |displacement| Condition::Platen {
            nodes: "n".into(),
            contact: Platen::Smooth,
            axis: Axis::Y,
            displacement,
        };
        let action = |condition: Condition, history: &Amplitude| Applied::new(condition, history.clone()).action();
        let (constant, ramp) = (Amplitude::Constant, Amplitude::RAMP);
        assert_eq!(action(pressure(1e5), &constant), Action::Constant);
        assert_eq!(action(pressure(1e5), &Amplitude::Ramp { from: 1.0, to: 1.0 }), Action::Constant);
        assert_eq!(action(pressure(1e5), &ramp), Action::ChangingLoad);
        assert_eq!(action(pressure(0.0), &ramp), Action::Constant);
        let weight = Condition::BodyForce { elements: "all".into(), value: [0.0, -2e4, 0.0] };
        assert_eq!(action(weight.clone(), &ramp), Action::ChangingLoad);
        assert_eq!(action(weight, &constant), Action::Constant);
        assert_eq!(action(platen(-1e-3), &ramp), Action::MovingSupport);
        assert_eq!(action(platen(0.0), &ramp), Action::Constant);
        assert_eq!(action(Condition::fixed("n", Axis::X), &ramp), Action::Constant);
        let friction = |to| Condition::Friction { elements: "all".into(), from: 1.0, to };
        assert_eq!(action(friction(0.5), &ramp), Action::ChangingLoad);
        assert_eq!(action(friction(1.0), &ramp), Action::Constant);
        let back = Applied { condition: platen(0.0), history: ramp.clone(), origin: Origin::Run };
        assert_eq!(back.action(), Action::MovingSupport);
        let jump = |x| {
            let (from, to) = ("left".into(), "right".into());
            Condition::MultiPointConstraint(MultiPointConstraint::Periodic { from, to, jump: [x, Some(0.0), None] })
        };
        assert_eq!(action(jump(Some(1e-3)), &ramp), Action::MovingSupport);
        assert_eq!(action(jump(None), &ramp), Action::Constant);
    }
}
