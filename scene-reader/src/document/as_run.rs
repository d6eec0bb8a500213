//! The text of a document with its overrides applied: what a run keeps in its folder.

use super::overrides::{is_large_whole_number, toml_value};
use super::renamed::former;
use super::{Document, sizes};
use crate::input_error::InputError;
use keys::Node;
use std::ops::Range;
use toml::de::DeTable;

impl Document {
    /// The document with overrides applied and `replacements` made (path to a key with dots, its new value), as TOML text.
    /// Comments and layout of the file are kept as long as every change concerns a key that the file has.
    ///
    /// # Errors
    /// The text cannot be written again, which only a change of a key that is not there can cause.
    pub fn as_run(&self, replacements: &[(&str, &str)]) -> Result<String, InputError> {
        let overrides = self.overrides.iter().map(|given| (given.path.clone(), given.value.clone()));
        let more = replacements
            .iter()
            .map(|(path, value)| (parts(path), toml::Value::String((*value).to_owned()).to_string()));
        let changes: Vec<(Vec<String>, String)> = overrides.chain(more).collect();
        let mut edits: Vec<(Range<usize>, &str)> = Vec::new();
        let root = DeTable::parse(&self.text).map_err(|error| self.toml_error(&error))?;
        let root = Node::from(&root);
        // What ran has one size, and names no others.
        if !sizes::names(&root).is_empty() {
            return self.rewritten(&changes);
        }
        for (path, value) in &changes {
            let written = [path.clone(), former(path)];
            match written.iter().find_map(|path| root.at(path.iter().map(String::as_str))) {
                Some(node) => {
                    edits.retain(|(other, _)| *other != node.span);
                    edits.push((node.span.clone(), value));
                }
                None => return self.rewritten(&changes),
            }
        }
        edits.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
        // Of a table and a key within it, each in its turn: no text can take the place of both.
        if edits.windows(2).any(|pair| pair[1].0.end > pair[0].0.start) {
            return self.rewritten(&changes);
        }
        let mut text = self.text.clone();
        for (span, value) in edits {
            text.replace_range(span, value);
        }
        // A table or list of tables under its own header has no text of its own that a value could take the place of.
        if text.parse().is_ok_and(|written: toml::Table| self.changed(&changes).is_ok_and(|table| table == written)) {
            return Ok(text);
        }
        self.rewritten(&changes)
    }

    /// The document written again, without comments: needed when a change adds a key, replaces a table, or the file has sizes.
    fn rewritten(&self, changes: &[(Vec<String>, String)]) -> Result<String, InputError> {
        toml::to_string(&self.changed(changes)?)
            .map_err(|error| self.error(format!("could not be written again: {error}")))
    }

    /// The document's values with changes made and without sizes.
    fn changed(&self, changes: &[(Vec<String>, String)]) -> Result<toml::Table, InputError> {
        let unwritable = |error: toml::de::Error| self.error(format!("could not be written again: {error}"));
        let mut table: toml::Table = self.text.parse().map_err(unwritable)?;
        table.remove(sizes::KEY);
        for (path, value) in changes {
            if is_large_whole_number(value) {
                return Err(self.error(format!("{} = {value} could not be written again", path.join("."))));
            }
            remove(&mut table, &former(path), path);
            insert(&mut table, path, toml_value(value));
        }
        Ok(table)
    }
}

/// The parts of a path with dots.
fn parts(path: &str) -> Vec<String> {
    path.split('.').map(str::to_owned).collect()
}

/// Takes away the value under the old name of a key, which is set under its new one.
fn remove(table: &mut toml::Table, old: &[String], new: &[String]) {
    if old == new {
        return;
    }
    let Some((last, above)) = old.split_last() else { return };
    let mut place = table;
    for part in above {
        match place.get_mut(part) {
            Some(toml::Value::Table(below)) => place = below,
            _ => return,
        }
    }
    place.remove(last);
}

/// Sets the value at `path`; tables on the way are made.
fn insert(table: &mut toml::Table, path: &[String], value: toml::Value) {
    let Some((key, rest)) = path.split_first() else { return };
    if rest.is_empty() {
        table.insert(key.clone(), value);
        return;
    }
    let below = table.entry(key.clone()).or_insert_with(|| toml::Value::Table(toml::Table::new()));
    insert_below(below, rest, value);
}

fn insert_below(place: &mut toml::Value, path: &[String], value: toml::Value) {
    match (place, path) {
        (place, []) => *place = value,
        (toml::Value::Table(table), path) => insert(table, path, value),
        (toml::Value::Array(entries), [index, rest @ ..]) => {
            if let Some(entry) = index.parse::<usize>().ok().and_then(|index| entries.get_mut(index)) {
                insert_below(entry, rest, value);
            }
        }
        _ => {}
    }
}
