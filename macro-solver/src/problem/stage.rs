//! One stage of a problem: conditions, and how the solver goes through it.

use super::amplitude::Moment;
use super::condition::{Action, Applied, Condition};
use super::criteria::Tolerances;
use super::path_control::PathControl;
use super::step_control::StepControl;
use super::strategy::Strategy;
use crate::nonlocal::NonlocalSettings;
use crate::problem::dynamics::DynamicSettings;
use crate::problem::relaxation::RelaxationSettings;

/// How a stage is solved.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Procedure {
    /// Equilibrium at every step, by Newton's method.
    #[default]
    Implicit,
    /// Equilibrium at every step, by a damped motion without any matrix.
    Relaxation(RelaxationSettings),
    /// Motion with inertia, by explicit integration in time.
    Dynamic(Box<DynamicSettings>),
}

impl Procedure {
    /// The keyword of scene files.
    pub fn keyword(&self) -> &'static str {
        match self {
            Self::Implicit => "implicit",
            Self::Relaxation(_) => "relaxation",
            Self::Dynamic(_) => "dynamic",
        }
    }

    /// Whether it solves linear equations with the stiffness of the body.
    pub(crate) fn solves_equations(&self) -> bool {
        matches!(self, Self::Implicit)
    }
}

/// A part of the path with its own conditions and its own way of solving. The conditions of a stage are complete: what it
/// does not list does not act in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// For people and outputs.
    pub name: String,
    /// Supports and loads.
    pub conditions: Vec<Applied>,
    /// Length, s. In a quasi-static stage a parameter of the path, which histories over time refer to.
    pub duration: f64,
    /// How it is solved.
    pub procedure: Procedure,
    /// Load steps.
    pub control: StepControl,
    /// Convergence.
    pub tolerances: Tolerances,
    /// Path to the answer.
    pub strategy: Strategy,
    /// Average of strain increments over neighbouring points; `None`: every point sees its own.
    pub nonlocal: Option<NonlocalSettings>,
}

impl Stage {
    /// An implicit stage of 1 s with default control, tolerances and strategy.
    pub fn new(name: impl Into<String>, conditions: Vec<Applied>) -> Self {
        Self {
            name: name.into(),
            conditions,
            duration: 1.0,
            procedure: Procedure::default(),
            control: StepControl::default(),
            tolerances: Tolerances::default(),
            strategy: Strategy::default(),
            nonlocal: None,
        }
    }

    /// Whether friction is all that changes.
    pub fn changes_friction_alone(&self) -> bool {
        let mut changing = self.conditions.iter().filter(|applied| applied.changes()).peekable();
        changing.peek().is_some() && changing.all(|applied| matches!(applied.condition, Condition::Friction { .. }))
    }

    /// Whether supports move while all loads stay as they are. Then a body that gives way reaches another equilibrium further on; under
    /// loads that grow it need not, and the load it carries is what smaller and smaller steps find.
    pub fn is_driven_by_supports(&self) -> bool {
        let does = |action| self.conditions.iter().any(|applied| applied.action() == action);
        does(Action::MovingSupport) && !does(Action::ChangingLoad)
    }

    /// Whether nothing changes along its path: what has been removed or added at its start acts from its first step on, and smaller steps
    /// are the same problem.
    pub fn changes_nothing(&self) -> bool {
        !self.conditions.iter().any(Applied::changes)
    }

    /// Whether its load factor is an unknown. Only Newton's method finds it; other procedures lead it from 0 to 1 whatever `control` says,
    /// which they may have from the tables of the whole run.
    pub fn finds_load_factor(&self) -> bool {
        self.procedure == Procedure::Implicit && self.control.path != PathControl::Load
    }

    /// The moment at a share of the stage.
    pub fn moment(&self, load: f64) -> Moment {
        Moment { load, time: load * self.duration }
    }
}
