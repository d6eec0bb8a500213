//! The counters of a run: their names, the group that tells what they mean for the result, and how they read. The table of
//! `docs/reference/counters.md` explains each; a test compares both.

use std::collections::BTreeMap;

/// What a counter above 0 means for the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Concern {
    /// The result may be less accurate than requested.
    LookAtThis,
    /// The path to the result only: the accepted states meet the same tolerances.
    Harmless,
}

protocol::keywords! {
    pub(crate) Concern {
        LookAtThis => "look_at_this",
        Harmless => "harmless",
    }
}

use Concern::{Harmless, LookAtThis};

/// One counter of the fallbacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counter {
    /// Name in `summary.json`.
    pub(crate) name: &'static str,
    /// What it means for the result.
    pub(crate) concern: Concern,
    /// What is counted, in words; `*` stands for the plural's `s`.
    label: &'static str,
}

const fn counter(name: &'static str, concern: Concern, label: &'static str) -> Counter {
    Counter { name, concern, label }
}

/// Every counter of `fallbacks` in `summary.json`, and the counters at its top level that belong to them.
pub(crate) const COUNTERS: [Counter; 50] = [
    counter("not_equilibrated", LookAtThis, "trial* not equilibrated"),
    counter("large_overlap", LookAtThis, "trial* with overlap above 10 % of a diameter"),
    counter("no_load_bearing_contacts", LookAtThis, "trial* without load-bearing contacts"),
    counter("packings_far_from_rest", LookAtThis, "packing* far from rest under the contact law"),
    counter("packing_forces_changed", LookAtThis, "contact force* of packings dropped or cut"),
    counter("asymmetric_stresses", LookAtThis, "asymmetric stress tensor*"),
    counter("stagnated_steps", LookAtThis, "stagnated step*"),
    counter("steps_with_noisy_corrections", LookAtThis, "step* with noisy corrections"),
    counter("steps_stabilised", LookAtThis, "stabilised step*"),
    counter("steps_with_committed_iterates", LookAtThis, "step* with committed iterates"),
    counter("stabilisation_increments", LookAtThis, "stabilisation increment*"),
    counter("continued_by_another_build", LookAtThis, "continuation* by another build"),
    counter("checkpoints_failed", LookAtThis, "failed checkpoint*"),
    counter("error_above_wanted", LookAtThis, "step* with an estimated error above rve.error, or 5 % without it"),
    counter("replicas_lost", LookAtThis, "replica* given up"),
    counter("stabilisation_evaluations", Harmless, "evaluation* in stabilisation"),
    counter("committed_iterates", Harmless, "committed iterate*"),
    counter("stabilisations_taken_back", Harmless, "stabilisation* taken back"),
    counter("unfinished_trials", Harmless, "unfinished trial*"),
    counter("damping_changed", Harmless, "trial* with changed damping"),
    counter("handed_over", Harmless, "trial* handed over to relaxation"),
    counter("sub_steps_of_points", Harmless, "sub-step* of points"),
    counter("tangent_fallback", Harmless, "singular tangent* replaced"),
    counter("tangent_regularised", Harmless, "regularised tangent*"),
    counter("tangent_floored", Harmless, "tangent* with eigenvalue floor"),
    counter("secant_refused", Harmless, "rejected secant correction*"),
    counter("rejected_iterates", Harmless, "rejected iterate*"),
    counter("rejected_evaluations", Harmless, "evaluation* of rejected iterates"),
    counter("frozen_network_iterates", Harmless, "iterate* with frozen-network tangents in place of slip"),
    counter("equations_solved_directly", Harmless, "direct solve* in place of iterative ones"),
    counter("tangents_by_difference", Harmless, "tangent* by finite differences"),
    counter("difference_evaluations", Harmless, "evaluation* for finite differences"),
    counter("differences_refused", Harmless, "refused finite difference*"),
    counter("replayed_trials", Harmless, "replayed trial*"),
    counter("workers_left", Harmless, "worker* left"),
    counter("workers_recycled", Harmless, "worker* recycled"),
    counter("workers_lost", Harmless, "worker* lost"),
    counter("workers_cut_off", Harmless, "worker* cut off with a host"),
    counter("workers_hung", Harmless, "worker* hung"),
    counter("workers_faulty", Harmless, "worker* faulty"),
    counter("messages_refused", Harmless, "refused message*"),
    counter("late_replies", Harmless, "late answer*"),
    counter("unknown_replies", Harmless, "answer* to no job"),
    counter("agents_lost", Harmless, "agent* lost"),
    counter("agents_faulty", Harmless, "agent* faulty"),
    counter("agents_refused", Harmless, "agent* refused"),
    counter("strangers_refused", Harmless, "stranger* refused"),
    counter("cutbacks", Harmless, "failed attempt*"),
    counter("worker_restarts", Harmless, "worker restart*"),
    counter("reissued_jobs", Harmless, "reissued job*"),
];

/// Every counter of `skipped` in `summary.json`, with its label.
pub(crate) const SKIPPED: [(&str, &str); 6] = [
    ("unchanged_targets", "unchanged target*"),
    ("duplicate_trials", "duplicate trial*"),
    ("zero_increments", "zero increment*"),
    ("elastic_increments", "increment* by a stored response"),
    ("event_increments", "increment* by new responses"),
    ("idle_steps", "idle step*"),
];

/// Former names of counters, which `summary.json` still holds next to the new ones: table, former name, name.
pub(super) const DEPRECATED_NAMES: [(&str, &str, &str); 7] = [
    ("fallbacks", "no_contacts", "no_load_bearing_contacts"),
    ("fallbacks", "creep_increments", "stabilisation_increments"),
    ("fallbacks", "evaluations_in_creep", "stabilisation_evaluations"),
    ("fallbacks", "iterates_turned_down", "rejected_iterates"),
    ("fallbacks", "evaluations_turned_down", "rejected_evaluations"),
    ("skipped", "equal_questions", "duplicate_trials"),
    ("skipped", "null_targets", "zero_increments"),
];

/// Adds the former names of the counters of `table` with the counts of the new ones.
pub(super) fn add_deprecated(table: &str, counts: &mut BTreeMap<String, u64>) {
    for (_, former, name) in DEPRECATED_NAMES.into_iter().filter(|(of, ..)| *of == table) {
        if let Some(&count) = counts.get(name) {
            counts.insert(former.to_owned(), count);
        }
    }
}

/// What a counter means for the result; unknown ones count as warnings.
pub(crate) fn concern(name: &str) -> Concern {
    COUNTERS.iter().find(|counter| counter.name == name).map_or(LookAtThis, |counter| counter.concern)
}

/// A count in words: `2 failed attempts`. Counters that are not known read like their names.
pub(crate) fn in_words(name: &str, count: u64) -> String {
    let label = COUNTERS.iter().find(|counter| counter.name == name).map(|counter| counter.label);
    let label = label.or_else(|| SKIPPED.iter().find(|(known, _)| *known == name).map(|(_, label)| *label));
    match label {
        Some(label) => format!("{count} {}", label.replace('*', if count == 1 { "" } else { "s" })),
        None => format!("{} {count}", name.replace('_', " ")),
    }
}

/// The counters above 0 by group, as they stand in `summary.json`; every group is present.
pub(super) fn grouped<'a>(counts: impl Iterator<Item = (&'a str, u64)>) -> BTreeMap<String, BTreeMap<String, u64>> {
    let mut groups: BTreeMap<String, BTreeMap<String, u64>> =
        Concern::ALL.into_iter().map(|group| (group.keyword().to_owned(), BTreeMap::new())).collect();
    for (name, count) in counts.filter(|(_, count)| *count > 0) {
        groups.entry(concern(name).keyword().to_owned()).or_default().insert(name.to_owned(), count);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of the table in the documentation: name and group.
    fn documented() -> Vec<(String, String)> {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/counters.md");
        let text = std::fs::read_to_string(path).unwrap();
        let part = text.split("## What the counters mean").nth(1).expect("the section exists");
        let part = part.split("\n## ").next().unwrap();
        let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
        let rows = part.lines().filter(|line| line.starts_with("| `")).map(cells);
        rows.map(|row| (row[1].trim_matches('`').to_owned(), row[2].clone())).collect()
    }

    #[test]
    fn every_counter_is_explained_in_the_documentation_with_its_group() {
        let mut documented = documented();
        let known = COUNTERS.iter().map(|counter| (counter.name, counter.concern.keyword().replace('_', " ")));
        let skipped = SKIPPED.iter().map(|(name, _)| (*name, "skipped".to_owned()));
        let mut expected: Vec<(String, String)> =
            known.chain(skipped).map(|(name, group)| (name.to_owned(), group)).collect();
        documented.sort();
        expected.sort();
        assert_eq!(documented, expected);
    }

    #[test]
    fn counters_are_grouped_and_zeros_left_out() {
        let groups = grouped([("tangent_floored", 7), ("not_equilibrated", 0), ("large_overlap", 1)].into_iter());
        assert_eq!(groups["harmless"], BTreeMap::from([("tangent_floored".to_owned(), 7)]));
        assert_eq!(groups["look_at_this"], BTreeMap::from([("large_overlap".to_owned(), 1)]));
        assert_eq!(concern("a new one"), LookAtThis);
    }

    #[test]
    fn counts_read_as_words() {
        assert_eq!(in_words("tangent_floored", 3531), "3531 tangents with eigenvalue floor");
        assert_eq!(in_words("cutbacks", 1), "1 failed attempt");
        assert_eq!(in_words("zero_increments", 128), "128 zero increments");
        assert_eq!(in_words("a_new_one", 2), "a new one 2");
    }

    #[test]
    fn former_names_keep_the_counts_of_the_new_ones() {
        let mut counts = BTreeMap::from([("duplicate_trials".to_owned(), 3), ("unchanged_targets".to_owned(), 1)]);
        add_deprecated("skipped", &mut counts);
        assert_eq!(counts.get("equal_questions"), Some(&3));
        assert_eq!(counts.len(), 3);
        assert!(DEPRECATED_NAMES.iter().all(|(_, former, _)| COUNTERS.iter().all(|counter| counter.name != *former)));
    }
}
