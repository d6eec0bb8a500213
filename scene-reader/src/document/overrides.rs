//! `--set key.path=VALUE`: parsing, and where the value goes.

use super::renamed;
use crate::input_error::InputError;
use keys::{Member, Node, Value, type_name};
use thiserror::Error;

/// One `--set key.path=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Override {
    /// Where it comes from and what it says, for people: `--set KEY=VALUE`.
    pub(super) text: String,
    /// Path to the key; a number selects an entry of an array, from 0.
    pub(super) path: Vec<String>,
    /// The value as TOML text.
    pub(super) value: String,
    /// `v=VALUE` after as many blanks as the file and the earlier overrides are long.
    pub(super) padded: String,
}

impl Override {
    /// Parses an argument of `source` (`--set`, or a size of the file) that follows sources of `length` bytes. A warning comes along if the key has another name today.
    ///
    /// # Errors
    /// There is no `=`, or no usable path.
    pub(super) fn parse(source: &str, given: &str, length: usize) -> Result<(Self, Option<String>), InputError> {
        let place = format!("{source} {given}");
        let Some((written, value)) = given.split_once('=') else {
            return Err(InputError::at(&place, "there is no '='").hint("write --set key.path=VALUE"));
        };
        let written: Vec<String> = written.trim().split('.').map(|part| part.trim().to_owned()).collect();
        if written.iter().any(String::is_empty) || value.contains('\n') {
            return Err(InputError::at(&place, "the key path is not usable").hint("write --set key.path=VALUE"));
        }
        let path = renamed::current(&written);
        let warning = (path != written).then(|| renamed::message(&written.join("."), &path.join(".")));
        let value = value.trim();
        // Seeds may be as large as this, where a TOML value ends at half of it.
        let value = if is_large_whole_number(value) { value.to_owned() } else { toml_value(value).to_string() };
        let padded = format!("{}v={value}", " ".repeat(length + 1));
        Ok((Self { text: place, path, value, padded }, warning))
    }
}

/// Why a value cannot be set at a path.
#[derive(Debug, Error)]
pub(super) enum InsertError {
    #[error("`{name}` is a list of {count} entries, and '{key}' is none of them")]
    NoEntry { name: String, count: usize, key: String },
    #[error("`{name}` is {found}, which has no keys")]
    NoKeys { name: String, found: &'static str },
}

/// Sets the value at `path`; tables on the way are made, entries of lists have to exist.
///
/// # Errors
/// [`InsertError`]: there is no such entry, or a value on the way has no keys.
pub(super) fn insert(node: &mut Node, name: &str, path: &[String], value: Node) -> Result<(), InsertError> {
    let Some((key, rest)) = path.split_first() else {
        *node = value;
        return Ok(());
    };
    let span = value.span.clone();
    match &mut node.value {
        Value::Table(members) => {
            let empty = || Member { key: span.clone(), node: Node { span: span.clone(), ..Node::table() } };
            let member = members.entry(key.clone()).or_insert_with(empty);
            if rest.is_empty() {
                member.key = span;
            }
            insert(&mut member.node, key, rest, value)
        }
        Value::List(entries) => {
            let count = entries.len();
            match key.parse::<usize>().ok().and_then(|index| entries.get_mut(index)) {
                Some(entry) => insert(entry, name, rest, value),
                None => Err(InsertError::NoEntry { name: name.to_owned(), count, key: key.clone() }),
            }
        }
        other => Err(InsertError::NoKeys { name: name.to_owned(), found: type_name(other) }),
    }
}

/// Whether a text is a whole number of 64 bits that is too large for a TOML value.
pub(super) fn is_large_whole_number(text: &str) -> bool {
    text.parse::<u64>().is_ok_and(|number| i64::try_from(number).is_err())
}

/// A command-line value: TOML if it is, else a string.
pub(super) fn toml_value(text: &str) -> toml::Value {
    match format!("v = {text}").parse::<toml::Table>() {
        Ok(mut table) if table.len() == 1 => table.remove("v").unwrap_or(toml::Value::String(text.to_owned())),
        _ => toml::Value::String(text.to_owned()),
    }
}
