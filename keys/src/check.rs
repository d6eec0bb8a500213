//! Checks values against what their keys may hold: one place for unknown keys, wrong types, unknown words and ranges.

use super::nearest::nearest;
use super::node::{Node, Value, type_name};
use super::serialize::to_node;
use super::shape::{Bounds, Key, Shape, Table, Word};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt;
use std::ops::Range;

/// What is wrong with a value, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The key; entries of lists are numbered from 0.
    pub path: Vec<String>,
    /// Bytes of the document that it concerns; empty for settings that were not read from one.
    pub span: Range<usize>,
    /// The problem, with the path of the key.
    pub problem: String,
    /// The remedy, where there is a likely one.
    pub hint: Option<String>,
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.problem)
    }
}

impl std::error::Error for Fault {}

/// Checks a table of a document. `at` is the path to the table, for messages.
///
/// # Errors
/// The first unknown or missing key, wrong type, unknown word, number out of range, or pair of keys that exclude each other.
pub fn check(node: &Node, table: &Table, at: &[&str]) -> Result<(), Fault> {
    Checker { path: at.iter().map(|&part| part.to_owned()).collect(), written: true }.table(node, table)
}

/// Checks settings that a program has filled in, against the ranges of their keys. `at` is the path of their table, for
/// messages.
///
/// # Errors
/// The first number that is out of range or not finite.
pub fn check_settings<T: Serialize + JsonSchema>(settings: &T, at: &[&str]) -> Result<(), Fault> {
    let path = at.iter().map(|&part| part.to_owned()).collect();
    match to_node(settings) {
        Ok(node) => Checker { path, written: false }.table(&node, &Table::of::<T>()),
        Err(error) => Err(Fault { path, span: 0..0, problem: error.to_string(), hint: None }),
    }
}

/// A walk through values and what they may be.
struct Checker {
    path: Vec<String>,
    /// Whether people wrote the values. Settings hold every key, and may hold more than keys.
    written: bool,
}

impl Checker {
    fn below<T>(&mut self, part: impl Into<String>, walk: impl FnOnce(&mut Self) -> T) -> T {
        self.path.push(part.into());
        let result = walk(self);
        self.path.pop();
        result
    }

    fn fault(&self, span: &Range<usize>, problem: String) -> Fault {
        Fault { path: self.path.clone(), span: span.clone(), problem, hint: None }
    }

    /// A fault of the value at the current path: the problem follows its name.
    fn refuse(&self, node: &Node, problem: &str) -> Result<(), Fault> {
        let name = if self.path.is_empty() { "the file".to_owned() } else { self.path.join(".") };
        Err(self.fault(&node.span, format!("{name} {problem}")))
    }

    fn mistyped(&self, node: &Node, expected: &str) -> Result<(), Fault> {
        let found = match &node.value {
            Value::Text(text) => format!("the text \"{text}\""),
            Value::Integer(number) => number.to_string(),
            Value::Number(number) => format!("{number:?}"),
            Value::Boolean(flag) => flag.to_string(),
            other => type_name(other).to_owned(),
        };
        self.refuse(node, &format!("must be {expected}, not {found}"))
    }

    fn value(&mut self, node: &Node, shape: &Shape) -> Result<(), Fault> {
        match (shape, &node.value) {
            (Shape::Anything, _) | (Shape::Boolean, Value::Boolean(_)) | (Shape::Text, Value::Text(_)) => Ok(()),
            (Shape::Integer(bounds), Value::Integer(number)) => {
                self.number(node, bounds, *number as f64, &number.to_string())
            }
            (Shape::Number(bounds), Value::Number(number)) => self.number(node, bounds, *number, &number.to_string()),
            (Shape::Number(bounds), Value::Integer(number)) => {
                self.number(node, bounds, *number as f64, &number.to_string())
            }
            (Shape::Words(words), Value::Text(text)) => self.word(node, words, text),
            (Shape::Table(table), Value::Table(_)) => self.table(node, table),
            (Shape::List { of, entries }, Value::List(values)) => self.list(node, of, entries, values),
            (Shape::Map(of), Value::Table(members)) => members
                .iter()
                .try_for_each(|(name, member)| self.below(name.as_str(), |checker| checker.value(&member.node, of))),
            (Shape::Either(shapes), _) => self.either(node, shapes),
            _ => self.mistyped(node, &expected(shape)),
        }
    }

    fn number(&self, node: &Node, bounds: &Bounds, number: f64, text: &str) -> Result<(), Fault> {
        if !number.is_finite() {
            return self.refuse(node, &format!("must be a finite number, not {text}"));
        }
        if bounds.contain(number) {
            Ok(())
        } else {
            self.refuse(node, &format!("must be {}, not {text}", bounds.words()))
        }
    }

    fn word(&self, node: &Node, words: &[Word], text: &str) -> Result<(), Fault> {
        if words.iter().any(|word| word.word == text) {
            return Ok(());
        }
        let names: Vec<String> = words.iter().map(|word| format!("\"{}\"", word.word)).collect();
        let problem = format!("{} = \"{text}\" is unknown", self.path.join("."));
        let mut fault = self.fault(&node.span, problem);
        let meant = nearest(text, words.iter().map(|word| word.word.as_str()));
        let meant = meant.map_or_else(String::new, |word| format!("did you mean \"{word}\"? "));
        fault.hint = Some(format!("{meant}one of {}", names.join(", ")));
        Err(fault)
    }

    fn list(&mut self, node: &Node, of: &Shape, entries: &Bounds, values: &[Node]) -> Result<(), Fault> {
        if !entries.contain(values.len() as f64) {
            let wanted = if entries.least == entries.most {
                entries.least.unwrap_or(0.0).to_string()
            } else {
                entries.words()
            };
            return self.refuse(node, &format!("must have {wanted} entries, not {}", values.len()));
        }
        let mut values = values.iter().enumerate();
        values.try_for_each(|(number, value)| self.below(number.to_string(), |checker| checker.value(value, of)))
    }

    fn table(&mut self, node: &Node, table: &Table) -> Result<(), Fault> {
        let Some(members) = node.members() else { return self.mistyped(node, "a table") };
        if self.written {
            for (name, member) in members {
                if table.key(name).is_none() {
                    return Err(self.unknown(name, &member.key, table));
                }
            }
        }
        let given = |key: &Key| node.get(&key.name).filter(|value| value.value != Value::Nothing);
        let missing = table.keys.iter().filter(|key| self.written && key.required && given(key).is_none());
        let missing: Vec<String> = missing.map(|key| format!("`{}`", key.name)).collect();
        if !missing.is_empty() {
            let many = if missing.len() == 1 { "" } else { "s" };
            return Err(self.fault(&node.span, format!("missing key{many} {}", missing.join(", "))));
        }
        table.keys.iter().try_for_each(|key| given(key).map_or(Ok(()), |value| self.key(value, key, node)))
    }

    fn key(&mut self, value: &Node, key: &Key, table: &Node) -> Result<(), Fault> {
        if let Some(other) = &key.instead_of
            && self.written
            && table.get(other).is_some()
        {
            let mut fault = self.fault(&value.span, format!("`{}` and `{other}` exclude each other", key.name));
            fault.path.push(key.name.clone());
            fault.hint = Some("leave one of them out".to_owned());
            return Err(fault);
        }
        self.below(key.name.as_str(), |checker| {
            checker.value(value, &key.shape)?;
            checker.inverse(value, key, table)
        })
    }

    /// A limit set by another key of the table. Where that is not written, the check of the settings finds it.
    fn inverse(&self, value: &Node, key: &Key, table: &Node) -> Result<(), Fault> {
        let Some(other) = &key.most_inverse_of else { return Ok(()) };
        match (value.number(), table.get(other).and_then(Node::number)) {
            (Some(own), Some(limiting)) if own > 1.0 / limiting => {
                self.refuse(value, &format!("must be at most 1 / {other}, not {own}"))
            }
            (Some(_), Some(_)) | (None, _) | (_, None) => Ok(()),
        }
    }

    fn unknown(&self, name: &str, span: &Range<usize>, table: &Table) -> Fault {
        let place = if self.path.is_empty() { String::new() } else { format!(" in {}", self.path.join(".")) };
        let mut fault = self.fault(span, format!("unknown key `{name}`{place}"));
        let names = || table.keys.iter().map(|key| key.name.as_str());
        fault.hint = Some(match nearest(name, names()) {
            Some(meant) => format!("did you mean `{meant}`?"),
            None => format!("its keys are {}", names().collect::<Vec<_>>().join(", ")),
        });
        fault
    }

    /// One of several shapes: the one that the value means, found from its type, its tag or its only key.
    fn either(&mut self, node: &Node, shapes: &[Shape]) -> Result<(), Fault> {
        let tables: Vec<&Table> = shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Table(table) => Some(table),
                _ => None,
            })
            .collect();
        match &node.value {
            Value::Table(_) if !tables.is_empty() => self.one_of(node, &tables),
            Value::Text(text) => {
                let words = shapes.iter().find_map(|shape| match shape {
                    Shape::Words(words) => Some(words),
                    _ => None,
                });
                match words {
                    _ if shapes.contains(&Shape::Text) => Ok(()),
                    Some(words) => self.word(node, words, text).map_err(|fault| with_tables(fault, &tables)),
                    None => self.mistyped(node, &either_expected(shapes)),
                }
            }
            _ => {
                let mut last = self.mistyped(node, &either_expected(shapes));
                for shape in shapes {
                    match self.value(node, shape) {
                        Ok(()) => return Ok(()),
                        Err(fault) if fault.path.len() > self.path.len() => last = Err(fault),
                        Err(_) => {}
                    }
                }
                last
            }
        }
    }

    fn one_of(&mut self, node: &Node, tables: &[&Table]) -> Result<(), Fault> {
        if let [only] = tables {
            return self.table(node, only);
        }
        if let Some(tag) = tag(tables) {
            let words: Vec<Word> = tables.iter().filter_map(|table| tag_word(table, tag)).cloned().collect();
            return match node.get(tag).map(|value| (value, value.text())) {
                None => Err(self.fault(&node.span, format!("missing key `{tag}`"))),
                Some((value, None)) => {
                    self.below(tag, |checker| checker.mistyped(value, &expected(&Shape::Words(words))))
                }
                Some((value, Some(text))) => {
                    let chosen = |table: &&&Table| tag_word(table, tag).is_some_and(|word| word.word == text);
                    match tables.iter().find(chosen) {
                        Some(table) => self.table(node, table),
                        None => self.below(tag, |checker| checker.word(value, &words, text)),
                    }
                }
            };
        }
        let has_key = |table: &&&Table| table.keys.iter().any(|key| node.get(&key.name).is_some());
        match tables.iter().find(has_key) {
            Some(table) => self.table(node, table),
            None => {
                let names: Vec<&str> =
                    tables.iter().flat_map(|table| table.keys.iter().map(|key| key.name.as_str())).collect();
                self.refuse(node, &format!("must have one of the keys {}", names.join(", ")))
            }
        }
    }
}

/// An unknown word where a table could stand as well: the hint names it too.
fn with_tables(mut fault: Fault, tables: &[&Table]) -> Fault {
    let forms = tables.iter().map(|table| expected_table(table)).collect::<Vec<_>>().join(", or ");
    if let (Some(hint), false) = (&mut fault.hint, forms.is_empty()) {
        *hint = format!("{hint}, or {forms}");
    }
    fault
}

/// The key by whose word the tables are told apart, if there is one.
fn tag<'a>(tables: &[&'a Table]) -> Option<&'a str> {
    let first = tables.first()?;
    let is_tag = |name: &str| tables.iter().all(|table| tag_word(table, name).is_some());
    first.keys.iter().map(|key| key.name.as_str()).find(|name| is_tag(name))
}

fn tag_word<'a>(table: &'a Table, name: &str) -> Option<&'a Word> {
    match &table.key(name)?.shape {
        Shape::Words(words) => match &words[..] {
            [only] => Some(only),
            _ => None,
        },
        _ => None,
    }
}

fn expected(shape: &Shape) -> String {
    match shape {
        Shape::Boolean => "true or false".to_owned(),
        Shape::Integer(bounds) => with_bounds("a whole number", bounds),
        Shape::Number(bounds) => with_bounds("a number", bounds),
        Shape::Text => "a text in quotes".to_owned(),
        Shape::Words(words) => {
            let names: Vec<String> = words.iter().map(|word| format!("\"{}\"", word.word)).collect();
            format!("one of {}", names.join(", "))
        }
        Shape::Either(shapes) => either_expected(shapes),
        Shape::List { .. } => "a list".to_owned(),
        Shape::Table(table) => expected_table(table),
        Shape::Map(_) => "a table".to_owned(),
        Shape::Anything => "any value".to_owned(),
    }
}

fn expected_table(table: &Table) -> String {
    match table.keys.first() {
        Some(key) => format!("a table such as {{ {} = ... }}", key.name),
        None => "a table".to_owned(),
    }
}

fn either_expected(shapes: &[Shape]) -> String {
    shapes.iter().map(expected).collect::<Vec<_>>().join(", or ")
}

fn with_bounds(kind: &str, bounds: &Bounds) -> String {
    match bounds.words() {
        words if words.is_empty() => kind.to_owned(),
        words => format!("{kind} {words}"),
    }
}
