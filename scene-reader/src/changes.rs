//! Which keys differ between two scenes as run: what must not change when a run is continued.

use super::document::renamed::{current, current_word};
use std::collections::{BTreeMap, BTreeSet};

/// Keys, and tables of keys, that influence no result.
const HARMLESS: [&str; 6] = ["checkpoint", "pool", "name", "output.plot", "output.plot_x", "output.plot_y"];

/// Keys within those tables that do influence results.
const OF_RESULTS: [&str; 4] = ["pool.difference_reuses", "pool.difference_strain", "pool.engine", "pool.points"];

/// One sentence per key that differs and matters. Texts that are not TOML have no keys.
pub fn changes(before: &str, now: &str) -> Vec<String> {
    let (before, now) = (leaves(before), leaves(now));
    let paths: BTreeSet<&String> = before.keys().chain(now.keys()).collect();
    paths
        .into_iter()
        .filter(|path| !is_harmless(path))
        .filter_map(|path| match (before.get(path), now.get(path)) {
            (Some(before), Some(now)) if before == now => None,
            (Some(before), Some(now)) => Some(format!("{path} was {before} and is {now}")),
            (Some(before), None) => Some(format!("{path} was {before} and is missing")),
            (None, now) => Some(format!("{path} was missing and is {}", now.map_or("", String::as_str))),
        })
        .collect()
}

fn is_harmless(path: &str) -> bool {
    is_among(path, &HARMLESS) && !is_among(path, &OF_RESULTS)
}

/// Whether a path is one of the keys, or lies in a table of theirs.
fn is_among(path: &str, keys: &[&str]) -> bool {
    keys.iter().any(|key| path.strip_prefix(key).is_some_and(|rest| rest.is_empty() || rest.starts_with('.')))
}

/// Every value that is not a table, with the path to it; entries of lists are numbered from 0, as in `--set`.
fn leaves(text: &str) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    if let Ok(table) = text.parse::<toml::Table>() {
        collect("", &toml::Value::Table(table), &mut found);
    }
    found
}

fn collect(path: &str, value: &toml::Value, found: &mut BTreeMap<String, String>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        toml::Value::Table(table) => table.iter().for_each(|(key, value)| collect(&below(key), value, found)),
        toml::Value::Array(entries) if entries.iter().any(toml::Value::is_table) => {
            entries.iter().enumerate().for_each(|(number, value)| collect(&below(&number.to_string()), value, found));
        }
        value => {
            // A run that was begun under old names may be continued under the present ones.
            let parts: Vec<String> = path.split('.').map(str::to_owned).collect();
            found.insert(current(&parts).join("."), current_word(path, value).to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_keys_that_matter_are_named_with_both_values() {
        let before = "name = 'a'\n[mesh]\nsize = [1.0, 2.0]\n[[boundary]]\nset = 'top'\n[pool]\nslice = 1\n[output]\nplot = true\ngrains = [0]";
        let now = "name = 'b'\n# a remark\n[mesh]\nsize = [1.0, 2.5]\n[[boundary]]\nset = 'top'\nplaten = 'rough'\n[output]\nplot = false";
        let found = changes(before, now);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found[0].starts_with("boundary.0.platen was missing"), "{found:?}");
        assert!(found[1].contains("mesh.size was [1.0, 2.0] and is [1.0, 2.5]"), "{found:?}");
        assert!(found[2].contains("output.grains was [0] and is missing"), "{found:?}");
        assert!(changes(before, before).is_empty());
        assert!(changes("a = 1", "checkpoint = 2\na = 1").is_empty());
        assert!(!changes("a = 1", "checkpoints = 2\na = 1").is_empty());
        let (old, new) = ("[pool]\nslice = 1\ndifference_strain = 1e-4", "[pool]\ndifference_strain = 1e-3");
        assert_eq!(changes(old, new), ["pool.difference_strain was 0.0001 and is 0.001"]);
        assert_eq!(changes("[pool.points]\nyade = [1]", "[pool.points]\nyade = [2]").len(), 1);
        assert_eq!(changes("", "[pool]\nengine = 'yade'").len(), 1);
        let (old, new) = ("[loading]\neasy_iterations = 4", "[loading]\ntarget_iterations = 4");
        assert!(changes(old, new).is_empty());
        let (old, new) = ("[solver]\nformulation = 'updated'", "[solver]\nformulation = 'updated_lagrangian'");
        assert!(changes(old, new).is_empty());
    }
}
