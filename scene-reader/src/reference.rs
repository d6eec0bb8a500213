//! The keys of all kinds of input files: explained, listed, as Markdown and as JSON schema.

use crate::document::{Kind, SizesTable};
use crate::tables::{SceneFile, StudyFile};
use keys::{Key, Table};
use rve_server::preparation::PackingRecipe;
use rve_server::programs::rve_test::ElementTest;
use rve_server::programs::specimen::SpecimenTest;
use schemars::schema_for;

impl Kind {
    /// The keys of files of this kind.
    pub fn table(self) -> Table {
        let mut table = match self {
            Self::Scene => Table::of::<SceneFile>(),
            Self::ElementTest => Table::of::<ElementTest>(),
            Self::Recipe => return Table::of::<PackingRecipe>(),
            Self::Specimen => Table::of::<SpecimenTest>(),
            Self::Study => Table::of::<StudyFile>(),
        };
        table.keys.extend(Table::of::<SizesTable>().keys);
        table
    }

    /// The JSON schema of files of this kind, for editors.
    pub fn schema(self) -> schemars::Schema {
        let mut schema = match self {
            Self::Scene => schema_for!(SceneFile),
            Self::ElementTest => schema_for!(ElementTest),
            Self::Recipe => return schema_for!(PackingRecipe),
            Self::Specimen => schema_for!(SpecimenTest),
            Self::Study => schema_for!(StudyFile),
        };
        let sizes = schema_for!(SizesTable);
        let declared = sizes.get("properties").and_then(|properties| properties.get("sizes")).cloned();
        let properties = schema.get_mut("properties").and_then(|properties| properties.as_object_mut());
        if let (Some(declared), Some(properties)) = (declared, properties) {
            properties.insert("sizes".to_owned(), declared);
        }
        schema
    }

    /// File below `docs/reference` that lists the keys of this kind.
    pub fn reference_file(self) -> String {
        format!("keys-{}.md", self.keyword())
    }

    /// The reference of all keys of this kind, in Markdown.
    pub fn reference(self) -> String {
        let table = self.table();
        let (name, command) = (self.name(), self.command());
        let title = name.trim_start_matches("a ").trim_start_matches("an ");
        format!(
            "# Keys of {name}\n\n{}\n\nRead by `grainspan {command}`; `grainspan explain KEY` shows one key. Units are SI. This file is \
             generated from the sources: `grainspan explain --markdown {}` prints it.\n\n## Keys at the top of the {title}\n\n{}",
            table.doc,
            self.keyword(),
            keys::markdown(&table)
        )
    }
}

/// What is known of a key, or of the keys with this name: one text each. Empty if no kind of file has it.
pub fn explained(kinds: &[Kind], query: &str) -> Vec<String> {
    let mut texts: Vec<String> = Vec::new();
    for &kind in kinds {
        let table = kind.table();
        for (path, entry) in keys::find(&table, query) {
            let text = keys::explain(&path, entry.key);
            // Tables that several kinds of files share are explained once.
            let known = |other: &String| {
                other
                    .split_once('\n')
                    .is_some_and(|(_, rest)| Some(rest) == text.split_once('\n').map(|(_, rest)| rest))
            };
            if !texts.iter().any(known) {
                let place = if kind == Kind::Scene { String::new() } else { format!("{}: ", kind.name()) };
                texts.push(format!("{place}{text}"));
            }
        }
    }
    texts
}

/// Keys that mention something without being called so, a line each: path and first sentence. Empty if no key does.
pub fn mentioned(kinds: &[Kind], query: &str) -> Vec<String> {
    let mut known: Vec<(String, String)> = Vec::new();
    let mut lines = Vec::new();
    for &kind in kinds {
        let place = if kind == Kind::Scene { String::new() } else { format!("{}: ", kind.name()) };
        for found in keys::mentions(&kind.table(), query) {
            // Tables that several kinds of files share are listed once.
            if !known.contains(&found) {
                lines.push(format!("{place}{}  {}", found.0, found.1));
                known.push(found);
            }
        }
    }
    lines
}

/// All tables of a kind of files and the keys at its top, a line each.
pub fn overview(kind: Kind) -> String {
    let table = kind.table();
    format!("{}\n{}", table.doc, keys::summary(&table, ""))
}

/// The key of any kind of file whose name is most like `query`.
pub fn nearest_key(query: &str) -> Option<String> {
    let paths: Vec<String> = Kind::ALL
        .iter()
        .flat_map(|kind| keys::paths(&kind.table()))
        .map(|(path, _)| without_numbers(&path))
        .collect();
    let last = query.rsplit('.').next().unwrap_or(query);
    let by_name = || paths.iter().map(|path| path.rsplit('.').next().unwrap_or(path));
    let name =
        keys::nearest(query, paths.iter().map(String::as_str)).or_else(|| keys::nearest(last, by_name()))?.to_owned();
    Some(name)
}

/// Keys of a kind of files that begin with `start`, as `--set` takes them; with `=` and the possible words behind a whole key.
pub fn completions(kind: Kind, start: &str) -> Vec<(String, String)> {
    let table = kind.table();
    if let Some((path, _)) = start.split_once('=') {
        let found = keys::find(&table, path);
        let words = found.first().map(|(_, entry)| words_of(entry.key)).unwrap_or_default();
        return words.into_iter().map(|(word, doc)| (format!("{path}={word}"), doc)).collect();
    }

    keys::paths(&table)
        .into_iter()
        .filter(|(path, _)| path.starts_with(start))
        .map(|(path, doc)| (format!("{path}="), doc))
        .collect()
}

fn words_of(key: &Key) -> Vec<(String, String)> {
    fn collect(shape: &keys::Shape, found: &mut Vec<(String, String)>) {
        match shape {
            keys::Shape::Words(words) => {
                found.extend(words.iter().map(|word| (word.word.clone(), word.doc.clone())));
            }
            keys::Shape::Boolean => found.extend(["true", "false"].map(|word| (word.to_owned(), String::new()))),
            keys::Shape::Either(shapes) => shapes.iter().for_each(|shape| collect(shape, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    collect(&key.shape, &mut found);
    found
}

fn without_numbers(path: &str) -> String {
    path.split('.').filter(|part| part.parse::<usize>().is_err()).collect::<Vec<_>>().join(".")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The tables of the reference are generated: with `WRITE_REFERENCE=1` this test writes them.
    #[test]
    fn the_reference_is_what_the_sources_say() {
        for kind in Kind::ALL {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference").join(kind.reference_file());
            if std::env::var_os("WRITE_REFERENCE").is_some() {
                std::fs::write(&path, kind.reference()).unwrap();
            }
            let written = std::fs::read_to_string(&path).unwrap_or_default();
            assert!(
                written == kind.reference(),
                "{} is not up to date: write it with `grainspan explain --markdown {}`",
                path.display(),
                kind.keyword()
            );
        }
    }

    #[test]
    fn every_key_has_documentation_and_every_number_a_unit() {
        for kind in Kind::ALL {
            let lacking = keys::undocumented(&kind.table());
            assert!(lacking.is_empty(), "keys of {}: {lacking:?}", kind.name());
        }
    }

    #[test]
    fn keys_are_explained_and_completed() {
        let text = explained(&Kind::ALL, "loading.growth").concat();
        assert!(
            text.contains("Factor on the step size") && text.contains("1.5") && text.contains("at least 1"),
            "{text}"
        );
        assert!(explained(&Kind::ALL, "no_such_key").is_empty());
        assert!(mentioned(&Kind::ALL, "no such thing").is_empty() && mentioned(&Kind::ALL, " ").is_empty());
        // No key is called so, but several mention it; once each, however many files have them.
        assert!(explained(&Kind::ALL, "hourglass modes").is_empty());
        let found = mentioned(&Kind::ALL, "Hourglass mode");
        assert!(!found.is_empty() && found.iter().all(|line| line.contains("hourglass")), "{found:?}");
        let mut single = found.clone();
        single.dedup();
        assert_eq!(single, found);
        assert_eq!(nearest_key("loading.grwoth").as_deref(), Some("loading.growth"));
        let names: Vec<String> = completions(Kind::Scene, "loading.gr").into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["loading.growth="]);
        let words: Vec<String> = completions(Kind::Scene, "pool.wait=").into_iter().map(|(word, _)| word).collect();
        assert_eq!(words, ["pool.wait=block", "pool.wait=hybrid", "pool.wait=spin"]);
        let stage: Vec<(String, String)> = completions(Kind::Scene, "stage.0.loading.max");
        assert_eq!(stage.len(), 1);
    }

    #[test]
    fn present_names_of_renamed_keys_exist() {
        let table = Kind::Scene.table();
        for key in crate::document::renamed::present_names() {
            assert_eq!(keys::find(&table, key).len(), 1, "{key}");
        }
    }
}
