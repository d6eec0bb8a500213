//! The shortcuts of a run, and how each is switched off.

use super::draw::{Loading, Scene};
use rve_server::definition::Accuracy;

/// What a shortcut may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// No digit.
    Exact,
    /// No more than the tolerances of the scene leave open.
    WithinTolerance,
}

impl Effect {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Exact => "none",
            Self::WithinTolerance => "within tolerance",
        }
    }
}

/// A shortcut, or several at once.
pub(super) struct Lever {
    /// Name in tables and of folders.
    pub(super) name: &'static str,
    /// Entries of `economy` in the summary that count how often it was taken.
    pub(super) keys: &'static [&'static str],
    /// What switches it off; for the solver that a run has not by default, what switches it on.
    pub(super) settings: &'static [&'static str],
    pub(super) effect: Effect,
    /// Whether the settings switch it on.
    pub(super) is_taken_without: bool,
    /// Whether what it may change is known only where packings are at rest under the contact law at the start.
    pub(super) needs_rest: bool,
    /// Scenes in which it has a meaning.
    pub(super) serves: fn(&Scene) -> bool,
}

const fn exact(name: &'static str, keys: &'static [&'static str], settings: &'static [&'static str]) -> Lever {
    Lever {
        name,
        keys,
        settings,
        effect: Effect::Exact,
        is_taken_without: false,
        needs_rest: false,
        serves: |_| true,
    }
}

/// All of them.
pub(super) const LEVERS: [Lever; 8] = [
    exact("unchanged_targets", &["unchanged_targets"], &["economy.unchanged_targets=false"]),
    exact("duplicate_trials", &["duplicate_trials"], &["economy.duplicate_trials=false"]),
    exact("lanes", &["lanes"], &["pool.lanes=false"]),
    Lever {
        serves: |scene| scene.options.error.is_none(),
        ..exact("error_estimate", &["error_estimate"], &["error_estimate.enabled=false"])
    },
    exact(
        "all_exact_ones",
        &["unchanged_targets", "duplicate_trials", "lanes"],
        &["economy.unchanged_targets=false", "economy.duplicate_trials=false", "pool.lanes=false"],
    ),
    Lever {
        effect: Effect::WithinTolerance,
        // Points that nothing moves keep the stress of the packing, in which its grains are not at rest.
        needs_rest: true,
        ..exact("zero_increments", &["zero_increments"], &["economy.zero_increments=false"])
    },
    Lever {
        effect: Effect::WithinTolerance,
        serves: |scene| scene.loading != Loading::Wave,
        ..exact("tangents_not_requested", &["tangents_not_requested"], &["solver.tangent_update=\"always\""])
    },
    Lever {
        effect: Effect::WithinTolerance,
        is_taken_without: true,
        serves: |scene| {
            scene.is_linear && scene.options.error.is_none() && scene.options.accuracy == Accuracy::Default
        },
        ..exact("event_driven", &["event_driven"], &["rve.solver=\"event_driven\""])
    },
];
