//! One stage of a problem: conditions, and how the solver goes through it.

use super::{Applied, Moment, Strategy, Tolerances};
use crate::dynamics::{DynamicSettings, RelaxationSettings};

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
        }
    }

    /// The moment at a share of the stage.
    pub fn moment(&self, load: f64) -> Moment {
        Moment { load, time: load * self.duration }
    }
}

/// How the load factor goes from 0 to 1 over a stage. All sizes are shares of the stage.
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
