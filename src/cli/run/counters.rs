//! What the counters of a run mean to the person who reads them: which of them ask for a look, and which only tell how the solver
//! found its way. `docs/reference/counters.md` holds the same as a table.

use std::collections::BTreeMap;

/// What a counter above 0 means for the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Concern {
    /// Something that is in the result may be less accurate than asked.
    LookAtThis,
    /// Only the way to the result: the accepted states meet the same tolerances.
    Harmless,
}

impl Concern {
    pub(crate) const ALL: [Self; 2] = [Self::LookAtThis, Self::Harmless];

    /// Its name in `summary.json`.
    pub(crate) fn keyword(self) -> &'static str {
        match self {
            Self::LookAtThis => "look_at_this",
            Self::Harmless => "harmless",
        }
    }
}

use Concern::{Harmless, LookAtThis};

/// Every counter of `fallbacks` in `summary.json`, and those beside it that count what went wrong.
pub(crate) const COUNTERS: [(&str, Concern); 31] = [
    ("not_equilibrated", LookAtThis),
    ("large_overlap", LookAtThis),
    ("no_contacts", LookAtThis),
    ("asymmetric_stresses", LookAtThis),
    ("steps_stabilised", LookAtThis),
    ("creep_increments", LookAtThis),
    ("continued_by_another_build", LookAtThis),
    ("checkpoints_failed", LookAtThis),
    ("evaluations_in_creep", Harmless),
    ("unfinished_trials", Harmless),
    ("damping_changed", Harmless),
    ("sub_steps_of_points", Harmless),
    ("tangent_fallback", Harmless),
    ("tangent_regularised", Harmless),
    ("tangent_floored", Harmless),
    ("secant_refused", Harmless),
    ("iterates_turned_down", Harmless),
    ("evaluations_turned_down", Harmless),
    ("equations_solved_directly", Harmless),
    ("tangents_by_difference", Harmless),
    ("difference_evaluations", Harmless),
    ("replayed_trials", Harmless),
    ("workers_left", Harmless),
    ("workers_recycled", Harmless),
    ("workers_lost", Harmless),
    ("workers_hung", Harmless),
    ("workers_faulty", Harmless),
    ("messages_refused", Harmless),
    ("cutbacks", Harmless),
    ("worker_restarts", Harmless),
    ("reissued_jobs", Harmless),
];

/// What a counter means for the result; an unknown one asks for a look.
pub(crate) fn concern(counter: &str) -> Concern {
    COUNTERS.iter().find(|(name, _)| *name == counter).map_or(LookAtThis, |(_, concern)| *concern)
}

/// The counters above 0 by group, as they stand in `summary.json`; every group is there.
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
        let documented = documented();
        for (name, concern) in COUNTERS {
            let row = documented.iter().find(|(found, _)| found == name);
            let group = row.map(|(_, group)| group.replace(' ', "_"));
            assert_eq!(group.as_deref(), Some(concern.keyword()), "`{name}` in docs/reference/counters.md");
        }
        let stale: Vec<_> =
            documented.iter().filter(|(name, _)| !COUNTERS.iter().any(|(known, _)| known == name)).collect();
        assert!(stale.iter().all(|(_, group)| group == "saved"), "counters that do not exist: {stale:?}");
        assert_eq!(stale.len(), super::super::closing::SKIPPED.len());
    }

    #[test]
    fn counters_are_grouped_and_zeros_left_out() {
        let groups = grouped([("tangent_floored", 7), ("not_equilibrated", 0), ("large_overlap", 1)].into_iter());
        assert_eq!(groups["harmless"], BTreeMap::from([("tangent_floored".to_owned(), 7)]));
        assert_eq!(groups["look_at_this"], BTreeMap::from([("large_overlap".to_owned(), 1)]));
        assert_eq!(concern("a new one"), LookAtThis);
    }
}
