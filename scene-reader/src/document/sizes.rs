//! `[sizes.NAME]`: named sets of overrides in an input file, chosen with `--size NAME`.

use super::Document;
use crate::input_error::InputError;
use keys::{Node, Value};
use schemars::JsonSchema;
use std::collections::BTreeMap;

/// The key at the top of a file.
pub(super) const KEY: &str = "sizes";

/// The key `sizes`, which scenes, element tests and specimens share.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "it declares the key; the values are read as overrides")]
pub(crate) struct SizesTable {
    /// Named sizes of the same problem: for each name a table of keys, written as for `--set` (`"mesh.elements" = [2, 4]`) or as in the
    /// file (`mesh.elements = [2, 4]`), and their values. `--size NAME` applies them; without it the file holds as it stands. Keys of a
    /// table that a size does not name keep their values; a list takes the place of the whole list.
    sizes: Option<BTreeMap<String, BTreeMap<String, serde_json::Value>>>,
}

/// Names of the sizes of a parsed file.
pub(super) fn names(root: &Node) -> Vec<String> {
    match root.get(KEY).map(|node| &node.value) {
        Some(Value::Table(sizes)) => sizes.keys().cloned().collect(),
        _ => Vec::new(),
    }
}

/// Takes the sizes out of the document, and returns the overrides of the chosen one, each with what it is called in messages.
///
/// # Errors
/// Sizes that are no tables, or a size that the file does not have.
pub(super) fn overrides(
    document: &Document,
    root: &mut Node,
    size: Option<&str>,
) -> Result<Vec<(String, String)>, InputError> {
    let known = names(root);
    let taken = match &mut root.value {
        Value::Table(members) => members.remove(KEY).map(|member| member.node),
        _ => None,
    };
    if let Some(sizes) = &taken {
        let Value::Table(tables) = &sizes.value else {
            return Err(document.error_at(sizes.span.clone(), "`sizes` is not a table").hint("write [sizes.small]"));
        };
        for (name, member) in tables {
            if !matches!(member.node.value, Value::Table(_)) {
                let problem = format!("`sizes.{name}` is not a table of keys and values");
                return Err(document
                    .error_at(member.node.span.clone(), problem)
                    .hint(format!("write [sizes.{name}]")));
            }
        }
    }
    let Some(wanted) = size else { return Ok(Vec::new()) };
    if !known.iter().any(|name| name == wanted) {
        let hint = match known.as_slice() {
            [] => "it has none: leave --size out".to_owned(),
            names => format!("it has: {}; without --size it holds as it stands", names.join(", ")),
        };
        return Err(document.error(format!("the file has no size '{wanted}'")).hint(hint));
    }
    values(document, wanted)
}

/// The keys and values of a size as arguments of `--set`.
fn values(document: &Document, size: &str) -> Result<Vec<(String, String)>, InputError> {
    let unreadable = |error: toml::de::Error| document.toml_error(&error);
    let table: toml::Table = document.text.parse().map_err(unreadable)?;
    let chosen = table.get(KEY).and_then(|sizes| sizes.get(size)).and_then(toml::Value::as_table);
    let mut found = Vec::new();
    chosen.into_iter().for_each(|table| collect("", table, &mut found));
    Ok(found.into_iter().map(|given| (format!("sizes.{size}:"), given)).collect())
}

/// Adds the keys of a table below `path`, as arguments of `--set`. Tables within it are followed: as the value of an override one would take
/// the place of the table in the file, with all keys that it does not name.
fn collect(path: &str, table: &toml::Table, found: &mut Vec<String>) {
    for (key, value) in table {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match value {
            toml::Value::Table(within) => collect(&path, within, found),
            value => found.push(format!("{path}={value}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const TEXT: &str =
        "length = 2.0\n[[list]]\nset = \"left\"\n[sizes.small]\nlength = 1\n\"list.0.set\" = \"right\"\n";

    fn document(text: &str, size: Option<&str>, given: &[&str]) -> Result<Document, String> {
        let given: Vec<String> = given.iter().map(|&text| text.to_owned()).collect();
        Document::in_size(Path::new("sample.toml"), text.to_owned(), size, &given).map_err(|error| error.to_string())
    }

    fn as_run(size: Option<&str>, given: &[&str]) -> String {
        document(TEXT, size, given).unwrap().as_run(&[]).unwrap()
    }

    #[test]
    fn a_size_is_a_set_of_overrides_that_the_command_line_overrides() {
        assert_eq!(document(TEXT, None, &[]).unwrap().sizes(), ["small"]);
        let small = as_run(Some("small"), &[]);
        assert!(small.contains("length = 1\n") && small.contains("right") && !small.contains("sizes"), "{small}");
        assert!(as_run(None, &[]).contains("length = 2.0\n"));
        assert!(as_run(Some("small"), &["length=7"]).contains("length = 7\n"));
    }

    #[test]
    fn tables_of_a_size_change_the_keys_that_they_name_and_no_others() {
        let file = "[rve]\ntolerance = 1e-5\nkeep = 3\n[[list]]\nset = \"left\"\nkeep = 4\n";
        for size in [
            "[sizes.small]\nrve.tolerance = 1e-6\nlist.0.set = \"right\"\n",
            "[sizes.small]\nrve = { tolerance = 1e-6 }\n\"list.0\" = { set = \"right\" }\n",
            "[sizes.small.rve]\ntolerance = 1e-6\n[sizes.small.list.0]\nset = \"right\"\n",
        ] {
            let run = document(&format!("{file}{size}"), Some("small"), &[]).unwrap().as_run(&[]).unwrap();
            let run: toml::Table = run.parse().unwrap();
            let expected: toml::Table = file.replace("1e-5", "1e-6").replace("left", "right").parse().unwrap();
            assert_eq!(run, expected, "{size}");
        }
    }

    #[test]
    fn sizes_that_are_not_there_or_do_not_fit_are_refused_with_their_place() {
        let unknown = document(TEXT, Some("large"), &[]).unwrap_err();
        assert!(unknown.contains("no size 'large'") && unknown.contains("it has: small"), "{unknown}");
        let misplaced = document(&TEXT.replace("list.0", "list.4"), Some("small"), &[]).unwrap_err();
        assert!(misplaced.starts_with("sizes.small: list.4.set"), "{misplaced}");
        let flat = document("sizes = 3\n", None, &[]).unwrap_err();
        assert!(flat.contains("`sizes` is not a table"), "{flat}");
    }
}
