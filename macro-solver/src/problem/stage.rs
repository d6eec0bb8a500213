//! One stage of a problem: conditions, and how the solver goes through it.

use super::amplitude::Moment;
use super::condition::{Action, Applied, Condition};
use super::criteria::Tolerances;
use super::path_control::PathControl;
use super::strategy::Strategy;
use crate::nonlocal::NonlocalSettings;
use crate::problem::dynamics::DynamicSettings;
use crate::problem::relaxation::RelaxationSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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

/// How long a stage is and how it goes along its path: the table `[loading]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LoadingSettings {
    /// Length of the stage: the time of histories, and real time in a dynamic stage. In quasi-static stages it scales the column
    /// `time` alone.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub duration: f64,
    /// Load steps.
    #[serde(flatten)]
    pub control: StepControl,
}

impl LoadingSettings {
    /// Those of a stage.
    pub fn of(stage: &Stage) -> Self {
        Self { duration: stage.duration, control: stage.control.clone() }
    }
}

impl Default for LoadingSettings {
    fn default() -> Self {
        Self { duration: 1.0, control: StepControl::default() }
    }
}

/// How a stage goes along its path, by default the load factor from 0 to 1: keys of `[loading]`. All sizes are shares of the stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct StepControl {
    /// Number of equal steps if nothing is cut back. No step is larger.
    #[schemars(range(min = 1), extend("x-procedures" = "implicit relaxation"))]
    pub increments: usize,
    /// Smallest step, as a share of the stage. A step that fails at this size is stabilised; if that fails too, or is switched off,
    /// the run ends with exit code 1.
    #[serde(rename = "smallest_increment")]
    #[schemars(
        extend(
            "x-unit" = "-", "exclusiveMinimum" = 0, "x-most-inverse-of" = "increments", "x-procedures" = "implicit relaxation"
        ),
        range(max = 1.0)
    )]
    pub min: f64,
    /// Factor on the step size after an easy step.
    #[schemars(extend("x-unit" = "-", "x-procedures" = "implicit relaxation"), range(min = 1.0))]
    pub growth: f64,
    /// Factor on the step size after a failed step.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "exclusiveMaximum" = 1, "x-procedures" = "implicit relaxation"))]
    pub cut: f64,
    /// A step with at most this many iterations is easy; with `adapt` = "target" the number that step sizes aim at.
    #[schemars(extend("x-procedures" = "implicit"))]
    pub target_iterations: usize,
    /// A step that has not converged after this many iterations is cut back.
    #[schemars(range(min = 1), extend("x-procedures" = "implicit"))]
    pub max_iterations: usize,
    /// How the step size follows the iterations that a step took.
    #[serde(rename = "adapt")]
    #[schemars(extend("x-procedures" = "implicit"))]
    pub rule: StepAdaptation,
    /// What a step prescribes: the load factor, or a measure of displacement with the load factor as an unknown.
    #[serde(rename = "control")]
    #[schemars(extend("x-procedures" = "implicit"))]
    pub path: PathControl,
    /// What happens where no step converges; `None`: the run ends.
    #[serde(flatten, with = "stabilisation_keys")]
    #[schemars(with = "StabilisationKeys")]
    pub stabilisation: Option<Stabilisation>,
}

/// Viscous stabilisation: from a state next to which there is no equilibrium to the next equilibrium. Only in implicit
/// stages that prescribe the load factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stabilisation {
    /// After n failed attempts at a step; in any case after one with the smallest step, and with 0 or `None` only then.
    pub after: Option<usize>,
    /// A body that has not reached equilibrium within this number of increments with supports and loads at rest does not count as
    /// stabilised.
    pub most_increments: usize,
    /// Viscosity of the first increment in terms of the first stiffness, above 0.
    pub viscosity: f64,
    /// Iterations after which the last iterate is committed and the step goes on from it, if the out-of-balance force hardly falls any more;
    /// with 0 or `None` never.
    pub commit_iterates_after: Option<usize>,
}

/// The keys of `[loading]` about viscous stabilisation.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct StabilisationKeys {
    /// Whether viscous stabilisation carries the body to the next equilibrium where no step converges. Counted as
    /// `fallbacks.steps_stabilised`; the energy taken is `energy.stabilisation`. Refused where `control` makes the load factor an
    /// unknown.
    #[schemars(extend("x-procedures" = "implicit"))]
    stabilise: bool,
    /// Failed attempts after which a step is stabilised before it has been cut back to the smallest size; 0: only where the smallest
    /// step has failed. A step in which supports move by more than 2 % of the smallest extent of the body is cut back before. Refused where `stabilise` is false.
    #[schemars(extend("x-default" = "1 where supports move and all loads are constant, else 0", "x-procedures" = "implicit"))]
    stabilise_after: Option<usize>,
    /// Increments with supports and loads at rest after which the body counts as having no equilibrium: it returns to
    /// the state before the step, which is cut back. So it does after 120 of them in a row that do not lower the out-of-balance force,
    /// unless the step is of the smallest size, and where it is strained by more than 10 % on average while all supports are at rest. Refused where
    /// `stabilise` is false.
    #[schemars(range(min = 1), extend("x-procedures" = "implicit"))]
    stabilise_increments: usize,
    /// Viscosity of the first increment over the first stiffness. Refused where `stabilise` is false.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "x-procedures" = "implicit"))]
    stabilise_viscosity: f64,
    /// Iterations after which the last iterate is committed and the step goes on from it (path-dependent iteration), if the out-of-balance
    /// force is not halved in two iterations, or an iteration leaves more than four fifths of it; 0: every iterate begins at the last accepted
    /// state. Counted as `fallbacks.steps_with_committed_iterates`. Refused where `stabilise` is false.
    #[schemars(extend(
        "x-default" = "where supports move and all loads are constant 3, or 5 with quasi-Newton updates or tangents that leave out that contacts slide; else 0",
        "x-procedures" = "implicit"
    ))]
    commit_iterates_after: Option<usize>,
}

impl Default for StabilisationKeys {
    fn default() -> Self {
        Self::from(Some(Stabilisation::default()))
    }
}

impl From<Option<Stabilisation>> for StabilisationKeys {
    fn from(settings: Option<Stabilisation>) -> Self {
        let Stabilisation { after, most_increments, viscosity, commit_iterates_after } = settings.unwrap_or_default();
        Self {
            stabilise: settings.is_some(),
            stabilise_after: after,
            stabilise_increments: most_increments,
            stabilise_viscosity: viscosity,
            commit_iterates_after,
        }
    }
}

mod stabilisation_keys {
    use super::{Stabilisation, StabilisationKeys};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(
        settings: &Option<Stabilisation>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        StabilisationKeys::from(*settings).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Stabilisation>, D::Error> {
        let keys = StabilisationKeys::deserialize(deserializer)?;
        Ok(keys.stabilise.then_some(Stabilisation {
            after: keys.stabilise_after,
            most_increments: keys.stabilise_increments,
            viscosity: keys.stabilise_viscosity,
            commit_iterates_after: keys.commit_iterates_after,
        }))
    }
}

impl Stabilisation {
    /// Of a stage that supports drive under constant loads, unless it says otherwise: the body has an equilibrium further on, and a body that
    /// softens as a whole takes more increments than a snap does. Chosen in docs/lab-book/strategies.md, with tangents that follow sliding contacts.
    pub const UNDER_MOVING_SUPPORTS: Self =
        Self { after: Some(1), most_increments: 300, viscosity: 0.1, commit_iterates_after: Some(3) };

    /// The same for a strategy. Iterations with tangents that leave out that contacts slide contract more slowly, also while the material is
    /// smooth: they may take more of them before an iterate is committed.
    pub fn under_moving_supports(strategy: &Strategy) -> Self {
        let commit_iterates_after = if strategy.follows_sliding_contacts() { 3 } else { 5 };
        Self { commit_iterates_after: Some(commit_iterates_after), ..Self::UNDER_MOVING_SUPPORTS }
    }
}

impl Default for Stabilisation {
    /// At the smallest step alone, and every iterate begins at the last accepted state.
    fn default() -> Self {
        Self { after: None, commit_iterates_after: None, ..Self::UNDER_MOVING_SUPPORTS }
    }
}

/// How the size of the next step follows from the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepAdaptation {
    /// Grows by `growth` after an easy step and stays otherwise.
    #[default]
    Easy,
    /// Is multiplied by the square root of `target_iterations` over the iterations taken, at most by `growth` and at least by
    /// `cut` [Crisfield 1981].
    Target,
}

impl StepControl {
    /// Size of the step after one of `size` that took `iterations`.
    pub fn next_size(&self, size: f64, iterations: usize) -> f64 {
        let factor = match self.rule {
            StepAdaptation::Easy if iterations <= self.target_iterations => self.growth,
            StepAdaptation::Easy => 1.0,
            StepAdaptation::Target => {
                let wanted = self.target_iterations.max(1) as f64 / iterations.max(1) as f64;
                wanted.sqrt().clamp(self.cut, self.growth)
            }
        };
        (size * factor).clamp(self.min, 1.0 / self.increments as f64)
    }
}

impl Default for StepControl {
    fn default() -> Self {
        Self {
            increments: 20,
            min: 1e-4,
            growth: 1.5,
            cut: 0.5,
            target_iterations: 6,
            max_iterations: 15,
            rule: StepAdaptation::Easy,
            path: PathControl::Load,
            stabilisation: Some(Stabilisation::default()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_the_iterations() {
        let easy = StepControl { increments: 10, ..StepControl::default() };
        assert_eq!([1, 6, 7].map(|iterations| easy.next_size(0.04, iterations)), [0.06, 0.06, 0.04]);
        let target = StepControl { rule: StepAdaptation::Target, target_iterations: 4, growth: 2.0, ..easy };
        assert_eq!([1, 4, 16, 100].map(|iterations| target.next_size(0.04, iterations)), [0.08, 0.04, 0.02, 0.02]);
        assert_eq!((target.next_size(0.09, 1), target.next_size(1.5e-4, 100)), (0.1, 1e-4));
    }
}
