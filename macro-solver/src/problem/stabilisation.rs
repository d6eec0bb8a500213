//! What a stage does where no step converges: viscous stabilisation and committed iterates.

use super::strategy::Strategy;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
pub(super) struct StabilisationKeys {
    /// Whether viscous stabilisation carries the body to the next equilibrium where no step converges. Counted as
    /// `fallbacks.steps_stabilised`; the energy taken is `energy.stabilisation`. Refused where `control` makes the load factor an
    /// unknown.
    #[schemars(extend("x-procedures" = "implicit"))]
    stabilise: bool,
    /// Failed attempts after which a step is stabilised before it has been cut back to the smallest size; 0: only where the smallest
    /// step has failed. A step in which supports move by more than 2 % of the smallest extent of the body is cut back before. Refused where `stabilise` is false.
    #[schemars(extend("x-procedures" = "implicit"))]
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

pub(super) mod stabilisation_keys {
    use super::{Stabilisation, StabilisationKeys};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::problem) fn serialize<S: Serializer>(
        settings: &Option<Stabilisation>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        StabilisationKeys::from(*settings).serialize(serializer)
    }

    pub(in crate::problem) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Stabilisation>, D::Error> {
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
    /// Of other stages: after the first failed attempt as well, because bodies that settle under their loads would be cut back again and again; one
    /// that cannot bear its load is cut back to the load that it bears. Every iterate begins at the last accepted state. Chosen in
    /// docs/lab-book/strategies.md.
    fn default() -> Self {
        Self { commit_iterates_after: None, ..Self::UNDER_MOVING_SUPPORTS }
    }
}
