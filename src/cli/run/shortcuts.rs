//! Every means by which a run saves work, with what it saved and its error: `economy` in `summary.json`.

use macro_solver::material::error_estimate::ReplicaFigures;
use macro_solver::observer::Statistics;
use macro_solver::output::{Shortcut, Summary};
use macro_solver::pool::{DefinitionStatistics, PoolStatistics};
use std::collections::BTreeMap;

/// What a scene allows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowed {
    /// Replies to targets that have not changed.
    pub(super) unchanged_targets: bool,
    /// Replies shared by equal trials.
    pub(super) duplicate_trials: bool,
    /// The committed state for an increment of exactly zero.
    pub(super) zero_increments: bool,
    /// Tolerance of the grain solver, relative to the mean contact force.
    pub(super) tolerance: f64,
    /// Trials of one RVE in SIMD lanes.
    pub(super) lanes: bool,
    /// Small increments by linear responses.
    pub(super) event_driven: bool,
    /// Steps that end where iterations make no more progress, above the tolerance, in some stage.
    pub(super) stagnated_steps: bool,
}

#[cfg(test)]
impl Allowed {
    /// Everything, with this tolerance of the grain solver.
    pub(super) const fn everything(tolerance: f64) -> Self {
        Self {
            unchanged_targets: true,
            duplicate_trials: true,
            zero_increments: true,
            tolerance,
            lanes: true,
            event_driven: true,
            stagnated_steps: true,
        }
    }
}

/// Fewest force evaluations of a trial that is relaxed: five increments of a ramp and ten steps of rest, less the one that an
/// evaluation of the state takes.
const FEWEST_EVALUATIONS: u64 = 14;

/// What each of them has saved, by name.
pub(super) fn shortcuts(
    statistics: &Statistics,
    pool: &PoolStatistics,
    replicas: &ReplicaFigures,
    allowed: Allowed,
) -> BTreeMap<String, Shortcut> {
    let flags = &statistics.flags;
    let evaluations = statistics.evaluations;
    let bound = |enabled: bool, error: f64| if enabled { error } else { 0.0 };
    let unchanged_targets = Shortcut {
        enabled: allowed.unchanged_targets,
        count: statistics.skipped,
        of: evaluations + statistics.skipped,
        force_evaluations_saved: statistics.skipped_force_evaluations,
        ..Shortcut::default()
    };
    let duplicate_trials = Shortcut {
        enabled: allowed.duplicate_trials,
        count: pool.duplicates_skipped,
        of: pool.evaluations,
        force_evaluations_saved: pool.duplicate_force_evaluations,
        ..Shortcut::default()
    };
    let still = flags.null_targets + statistics.still_points;
    let zero_increments = Shortcut {
        enabled: allowed.zero_increments,
        count: still,
        of: evaluations + statistics.still_points,
        force_evaluations_saved: FEWEST_EVALUATIONS * still,
        error: bound(allowed.zero_increments, allowed.tolerance),
        ..Shortcut::default()
    };
    let by_response = flags.elastic_increments + flags.event_increments;
    let event_driven = Shortcut {
        enabled: allowed.event_driven,
        count: by_response,
        of: evaluations,
        force_evaluations_saved: ((FEWEST_EVALUATIONS + 1) * by_response)
            .saturating_sub(statistics.event_driven_force_evaluations),
        error: bound(allowed.event_driven, allowed.tolerance),
        ..Shortcut::default()
    };
    let stagnated_steps = Shortcut {
        enabled: allowed.stagnated_steps,
        count: statistics.stagnated_steps,
        // The equilibrium that a run starts from is none of its steps, and may stagnate too.
        of: statistics.steps + 1,
        error: bound(statistics.stagnated_steps > 0, statistics.largest_stagnated_force_ratio),
        ..Shortcut::default()
    };
    let error_estimate = Shortcut {
        enabled: replicas.evaluations > 0,
        count: replicas.evaluations,
        of: evaluations,
        force_evaluations_spent: replicas.force_evaluations,
        ..Shortcut::default()
    };
    let all = [
        ("unchanged_targets", unchanged_targets),
        ("duplicate_trials", duplicate_trials),
        ("zero_increments", zero_increments),
        ("lanes", lanes(pool, allowed.lanes)),
        ("tangents_not_requested", tangents_not_requested(statistics, pool)),
        ("event_driven", event_driven),
        ("stagnated_steps", stagnated_steps),
        ("error_estimate", error_estimate),
    ];
    all.into_iter().map(|(name, shortcut)| (name.to_owned(), shortcut)).collect()
}

/// Trials solved side by side: the time of a force evaluation is compared with that of trials of equal cells solved one by one, where there
/// were any.
fn lanes(pool: &PoolStatistics, enabled: bool) -> Shortcut {
    let cells = &pool.by_definition;
    let together: u64 = cells.iter().map(|cells| cells.side_by_side.trials).sum();
    let alone: u64 = cells.iter().map(|cells| cells.one_by_one.trials).sum();
    let in_messages: u64 = cells.iter().map(|cells| cells.side_by_side.in_messages).sum();
    Shortcut {
        enabled,
        count: together,
        of: together + alone,
        seconds_saved: sum_of_known(cells.iter().map(DefinitionStatistics::seconds_saved_side_by_side)),
        trials_per_message: (together > 0).then(|| in_messages as f64 / together as f64),
        ..Shortcut::default()
    }
}

/// The sum of what is known; `None` if nothing is.
fn sum_of_known(parts: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    parts.flatten().reduce(|sum, part| sum + part)
}

/// Evaluations without a tangent operator: each saves the mean time of an operator of its cell, on average over the trials without one. The
/// trials of second solutions, which never have one, are among these, not among the evaluations.
fn tangents_not_requested(statistics: &Statistics, pool: &PoolStatistics) -> Shortcut {
    let count = statistics.evaluations.saturating_sub(statistics.tangents);
    let timed =
        pool.by_definition.iter().filter_map(|cells| Some((cells.seconds_per_tangent()?, cells.without_tangent)));
    let (seconds, trials) = timed
        .fold((0.0, 0), |(seconds, trials), (each, without)| (seconds + each * without as f64, trials + without));
    Shortcut {
        enabled: true,
        count,
        of: statistics.evaluations,
        seconds_saved: (trials > 0).then(|| seconds / trials as f64 * count as f64),
        ..Shortcut::default()
    }
}

/// One line for each of them that was taken, and that the lines of skipped evaluations and of the accuracy do not name.
pub(super) fn lines(summary: &Summary) -> Vec<(&'static str, String)> {
    let words: [(&str, &str, &str); 4] = [
        ("lanes", "side by side", "trials"),
        ("tangents_not_requested", "no tangent", "evaluations without one"),
        ("event_driven", "linear response", "evaluations"),
        ("stagnated_steps", "stagnation", "steps ended above a tolerance"),
    ];
    let taken = words.into_iter().filter_map(|(name, label, what)| {
        let shortcut = summary.economy.get(name).filter(|shortcut| shortcut.count > 0)?;
        Some((label, in_words(shortcut, what)))
    });
    taken.collect()
}

fn in_words(shortcut: &Shortcut, what: &str) -> String {
    let mut parts = vec![format!("{} of {} {what}", shortcut.count, shortcut.of)];
    if let Some(trials) = shortcut.trials_per_message {
        parts.push(format!("{trials:.1} to a message"));
    }
    if let Some(seconds) = shortcut.seconds_saved {
        let word = if seconds < 0.0 { "lost" } else { "saved" };
        parts.push(format!("about {:.2} s of workers {word}", seconds.abs()));
    }
    if shortcut.force_evaluations_saved > 0 {
        parts.push(format!("at least {} force evaluations saved", shortcut.force_evaluations_saved));
    }
    if shortcut.error > 0.0 {
        parts.push(format!("error up to {:.0e}", shortcut.error));
    }
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use macro_solver::pool::SolvedTrials;

    #[test]
    fn lanes_save_the_time_that_the_same_evaluations_take_alone() {
        let cells = DefinitionStatistics {
            side_by_side: SolvedTrials { trials: 16, force_evaluations: 1000, seconds: 1.0, in_messages: 128 },
            one_by_one: SolvedTrials { trials: 2, force_evaluations: 100, seconds: 0.2, in_messages: 2 },
            ..DefinitionStatistics::default()
        };
        let pool = PoolStatistics { by_definition: vec![cells], ..PoolStatistics::default() };
        let lanes = lanes(&pool, true);
        assert_eq!((lanes.count, lanes.of, lanes.trials_per_message), (16, 18, Some(8.0)));
        assert!((lanes.seconds_saved.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(in_words(&lanes, "trials"), "16 of 18 trials, 8.0 to a message, about 1.00 s of workers saved");
    }

    /// Only small cells were solved one by one: their time says nothing about the large ones.
    #[test]
    fn cells_are_compared_with_cells_of_the_same_kind() {
        let solved = |trials, force_evaluations, seconds| SolvedTrials {
            trials,
            force_evaluations,
            seconds,
            in_messages: trials,
        };
        let small = DefinitionStatistics {
            side_by_side: solved(10, 1000, 1.0),
            one_by_one: solved(1, 100, 0.3),
            tangents: 10,
            without_tangent: 1,
            tangent_s: 0.5,
        };
        let large = DefinitionStatistics {
            side_by_side: solved(10, 1000, 50.0),
            tangents: 1,
            without_tangent: 9,
            tangent_s: 4.0,
            ..DefinitionStatistics::default()
        };
        let pool = PoolStatistics { by_definition: vec![small, large], ..PoolStatistics::default() };
        let shortcut = lanes(&pool, true);
        assert_eq!((shortcut.count, shortcut.of), (20, 21));
        assert!((shortcut.seconds_saved.unwrap() - 2.0).abs() < 1e-12, "{:?}", shortcut.seconds_saved);
        let statistics = Statistics { evaluations: 21, tangents: 11, ..Statistics::default() };
        let tangents = tangents_not_requested(&statistics, &pool);
        // Ten evaluations: one of the small cells at 0.05 s, nine of the large ones at 4 s.
        assert!((tangents.seconds_saved.unwrap() - 36.05).abs() < 1e-12, "{:?}", tangents.seconds_saved);
    }

    #[test]
    fn nothing_is_claimed_without_a_time_to_compare_with() {
        let cells = DefinitionStatistics {
            side_by_side: SolvedTrials { trials: 8, force_evaluations: 800, seconds: 1.0, in_messages: 64 },
            without_tangent: 8,
            ..DefinitionStatistics::default()
        };
        let pool = PoolStatistics { by_definition: vec![cells], ..PoolStatistics::default() };
        assert_eq!(lanes(&pool, true).seconds_saved, None);
        let statistics = Statistics { evaluations: 10, ..Statistics::default() };
        assert_eq!(tangents_not_requested(&statistics, &pool).seconds_saved, None);
    }

    #[test]
    fn small_increments_by_responses_save_what_a_relaxation_takes_at_least() {
        let mut statistics =
            Statistics { evaluations: 10, event_driven_force_evaluations: 12, ..Statistics::default() };
        (statistics.flags.elastic_increments, statistics.flags.event_increments) = (4, 2);
        let all =
            shortcuts(&statistics, &PoolStatistics::default(), &ReplicaFigures::default(), Allowed::everything(1e-3));
        let shortcut = all["event_driven"];
        assert_eq!(
            (shortcut.count, shortcut.of, shortcut.force_evaluations_saved, shortcut.error),
            (6, 10, 78, 1e-3)
        );
        assert!(all.values().all(|shortcut| shortcut.count <= shortcut.of));
    }
}
