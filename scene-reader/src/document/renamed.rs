//! Keys and words that have had another name. Files, `--set` and scripts with the old names are read for one more version, with
//! a warning that says the new one.

use keys::{Member, Node, Value};
use std::ops::Range;

/// Old and new path of a key. Keys of a stage are renamed as those at the top are.
const KEYS: [(&str, &str); 9] = [
    ("loading.easy_iterations", "loading.target_iterations"),
    ("loading.stabilise_drag", "loading.stabilise_viscosity"),
    ("solver.renewal", "solver.tangent_update"),
    ("solver.renewal_contraction", "solver.tangent_update_contraction"),
    ("solver.renewal_uses", "solver.tangent_max_uses"),
    ("rve.operator.probe", "rve.operator.perturbation"),
    ("rve.operator.quasi_static_probe", "rve.operator.quasi_static_perturbation"),
    ("pool.slice", "pool.jobs_per_message"),
    ("pool.patience", "pool.worker_timeout"),
];

/// Path of a key, old and new word of its value.
const WORDS: [(&str, &str, &str); 1] = [("solver.formulation", "updated", "updated_lagrangian")];

/// An old name that was read as the new one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Renaming {
    /// Where the old name stands.
    pub(super) span: Range<usize>,
    /// What it is, for people.
    pub(super) message: String,
}

/// The present path of a key that may have an old name.
pub(crate) fn current(path: &[String]) -> Vec<String> {
    exchanged(path, |key| KEYS.iter().find(|(old, _)| *old == key).map(|(_, new)| *new))
}

/// A value of the key at `path`, with its present word.
pub(crate) fn current_word(path: &str, value: &toml::Value) -> toml::Value {
    let renamed = WORDS.iter().find(|(key, old, _)| path.ends_with(key) && value.as_str() == Some(old));
    renamed.map_or_else(|| value.clone(), |(_, _, new)| toml::Value::String((*new).to_owned()))
}

/// The present names of all keys that have had another one.
#[cfg(test)]
pub(crate) fn present_names() -> impl Iterator<Item = &'static str> {
    KEYS.iter().map(|(_, new)| *new)
}

/// The old path of a key, or its only one.
pub(super) fn former(path: &[String]) -> Vec<String> {
    exchanged(path, |key| KEYS.iter().find(|(_, new)| *new == key).map(|(old, _)| *old))
}

fn exchanged(path: &[String], other: impl Fn(&str) -> Option<&'static str>) -> Vec<String> {
    let in_stage = path.len() > 2 && path[0] == "stage" && path[1].parse::<usize>().is_ok();
    let (place, key) = path.split_at(if in_stage { 2 } else { 0 });
    match other(&key.join(".")) {
        Some(name) => place.iter().cloned().chain(name.split('.').map(str::to_owned)).collect(),
        None => path.to_vec(),
    }
}

/// The warning about an old name of a key.
pub(super) fn message(old: &str, new: &str) -> String {
    format!("`{old}` is now called `{new}`; the old name is read in this version only")
}

/// Gives every key and word of a document its present name. A key that has both names keeps both, which the check of unknown
/// keys then refuses.
pub(super) fn rename(root: &mut Node) -> Vec<Renaming> {
    let mut found = rename_in(root);
    if let Some(stages) = root.members_mut().and_then(|members| members.get_mut("stage"))
        && let Value::List(stages) = &mut stages.node.value
    {
        stages.iter_mut().for_each(|stage| found.extend(rename_in(stage)));
    }
    found
}

fn rename_in(table: &mut Node) -> Vec<Renaming> {
    let mut found = Vec::new();
    for (old, new) in KEYS {
        let (Some((place, old_name)), Some((_, new_name))) = (old.rsplit_once('.'), new.rsplit_once('.')) else {
            continue;
        };
        let Some(members) = below(table, place).and_then(Node::members_mut) else { continue };
        if members.contains_key(new_name) {
            continue;
        }
        if let Some(member) = members.remove(old_name) {
            found.push(Renaming { span: member.key.clone(), message: message(old, new) });
            members.insert(new_name.to_owned(), Member { ..member });
        }
    }
    for (key, old, new) in WORDS {
        if let Some(node) = below(table, key)
            && node.text() == Some(old)
        {
            node.value = Value::Text(new.to_owned());
            let message =
                format!("{key} = \"{old}\" is now called \"{new}\"; the old word is read in this version only");
            found.push(Renaming { span: node.span.clone(), message });
        }
    }
    found
}

fn below<'a>(table: &'a mut Node, path: &str) -> Option<&'a mut Node> {
    path.split('.').try_fold(table, |node, part| Some(&mut node.members_mut()?.get_mut(part)?.node))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(path: &str) -> Vec<String> {
        path.split('.').map(str::to_owned).collect()
    }

    #[test]
    fn paths_are_exchanged_at_the_top_and_in_stages() {
        assert_eq!(current(&parts("pool.slice")), parts("pool.jobs_per_message"));
        assert_eq!(current(&parts("stage.1.loading.easy_iterations")), parts("stage.1.loading.target_iterations"));
        assert_eq!(former(&parts("stage.1.loading.target_iterations")), parts("stage.1.loading.easy_iterations"));
        assert_eq!(current(&parts("loading.growth")), parts("loading.growth"));
    }

    #[test]
    fn documents_are_read_under_present_names_with_a_warning_each() {
        let text = "[loading]\neasy_iterations = 4\n[solver]\nformulation = 'updated'\n[[stage]]\nname = 'one'\n\
                    [stage.loading]\neasy_iterations = 5\n";
        let overrides = ["pool.slice=3".to_owned()];
        let document =
            crate::Document::from_text(std::path::Path::new("old.toml"), text.to_owned(), &overrides).unwrap();
        for path in [
            &["loading", "target_iterations"][..],
            &["stage", "0", "loading", "target_iterations"],
            &["pool", "jobs_per_message"],
        ] {
            assert!(document.is_written(path), "{path:?}");
        }
        let warnings = document.warnings().join("\n");
        for part in [
            "old.toml:2: `loading.easy_iterations` is now called `loading.target_iterations`",
            "old.toml:4: solver.formulation = \"updated\" is now called \"updated_lagrangian\"",
            "old.toml:8: `loading.easy_iterations`",
            "--set pool.slice=3: `pool.slice` is now called `pool.jobs_per_message`",
        ] {
            assert!(warnings.contains(part), "{part}: {warnings}");
        }
    }

    #[test]
    fn names_are_unique_on_either_side() {
        for (number, (old, new)) in KEYS.iter().enumerate() {
            assert!(KEYS.iter().skip(number + 1).all(|(other, _)| other != old));
            assert!(KEYS.iter().all(|(other, _)| other != new), "{new} was renamed twice");
        }
    }
}
