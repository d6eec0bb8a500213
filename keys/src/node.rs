//! Values of a parsed document, which know where they stand in its text.

use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// What it is.
    pub value: Value,
    /// Bytes of the text; empty where it was not read from a text.
    pub span: Range<usize>,
}

/// A value of a document.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// No value: an optional setting that is not given. Documents hold none.
    Nothing,
    /// `true` or `false`.
    Boolean(bool),
    /// A whole number.
    Integer(i128),
    /// A number with a fraction or exponent.
    Number(f64),
    /// A text in quotes.
    Text(String),
    /// A date or time, which no key takes.
    Date(String),
    /// Values in brackets, or the entries of a `[[list]]`.
    List(Vec<Node>),
    /// Keys and their values.
    Table(BTreeMap<String, Member>),
}

/// A key of a table with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Where the key itself stands.
    pub key: Range<usize>,
    /// Its value.
    pub node: Node,
}

impl Node {
    /// A value that stands nowhere.
    pub fn new(value: Value) -> Self {
        Self { value, span: 0..0 }
    }

    /// A table without keys.
    pub fn table() -> Self {
        Self::new(Value::Table(BTreeMap::new()))
    }

    /// The keys, if it is a table.
    pub fn members(&self) -> Option<&BTreeMap<String, Member>> {
        match &self.value {
            Value::Table(members) => Some(members),
            _ => None,
        }
    }

    /// The keys, if it is a table.
    pub fn members_mut(&mut self) -> Option<&mut BTreeMap<String, Member>> {
        match &mut self.value {
            Value::Table(members) => Some(members),
            _ => None,
        }
    }

    /// The value of a key, if it is a table that has it.
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.members()?.get(key).map(|member| &member.node)
    }

    /// The value at a path of keys; numbers select entries of lists, from 0.
    pub fn at<'a>(&self, path: impl IntoIterator<Item = &'a str>) -> Option<&Node> {
        path.into_iter().try_fold(self, |node, part| match &node.value {
            Value::Table(members) => members.get(part).map(|member| &member.node),
            Value::List(entries) => entries.get(part.parse::<usize>().ok()?),
            _ => None,
        })
    }

    /// Sets the value of a key of a table; nothing else has keys.
    pub fn set(&mut self, key: &str, node: Node) {
        if let Value::Table(members) = &mut self.value {
            members.insert(key.to_owned(), Member { key: node.span.clone(), node });
        }
    }

    /// The number, if it is one, whole or not.
    pub fn number(&self) -> Option<f64> {
        match self.value {
            Value::Integer(number) => Some(number as f64),
            Value::Number(number) => Some(number),
            Value::Nothing
            | Value::Boolean(_)
            | Value::Text(_)
            | Value::Date(_)
            | Value::List(_)
            | Value::Table(_) => None,
        }
    }

    /// The text, if it is one.
    pub fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }
}

/// What people call the kind of a value.
pub fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Nothing => "nothing",
        Value::Boolean(_) => "a boolean",
        Value::Integer(_) => "a whole number",
        Value::Number(_) => "a number",
        Value::Text(_) => "a text",
        Value::Date(_) => "a date",
        Value::List(_) => "a list",
        Value::Table(_) => "a table",
    }
}

impl From<&Spanned<DeTable<'_>>> for Node {
    fn from(table: &Spanned<DeTable<'_>>) -> Self {
        Self { value: table_value(table.get_ref()), span: table.span() }
    }
}

impl From<&Spanned<DeValue<'_>>> for Node {
    fn from(value: &Spanned<DeValue<'_>>) -> Self {
        let span = value.span();
        let value = match value.get_ref() {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Integer(number) => {
                let digits = number.as_str().replace('_', "");
                match i128::from_str_radix(digits.trim_start_matches('+'), number.radix()) {
                    Ok(number) => Value::Integer(number),
                    // More digits than any key takes: the range says what is wrong.
                    Err(_) => Value::Number(f64::MAX),
                }
            }
            DeValue::Float(number) => Value::Number(number.as_str().replace('_', "").parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(flag) => Value::Boolean(*flag),
            DeValue::Datetime(date) => Value::Date(date.to_string()),
            DeValue::Array(entries) => Value::List(placed(entries.iter().map(Self::from).collect())),
            DeValue::Table(table) => table_value(table),
        };
        Self { value, span }
    }
}

/// Entries of a list. The parser gives all tables of one name (`[[stage]]`) the place of the first one: each stands where its first key does.
fn placed(mut entries: Vec<Node>) -> Vec<Node> {
    let first = entries.first().map(|entry| entry.span.clone());
    for entry in entries.iter_mut().skip(1).filter(|entry| Some(&entry.span) == first.as_ref()) {
        if let Value::Table(members) = &entry.value {
            let keys = members.values().map(|member| member.key.clone());
            entry.span = keys.min_by_key(|key| key.start).unwrap_or(entry.span.clone());
        }
    }
    entries
}

fn table_value(table: &DeTable<'_>) -> Value {
    let member = |(key, value): (&Spanned<std::borrow::Cow<'_, str>>, &Spanned<DeValue<'_>>)| {
        (key.get_ref().to_string(), Member { key: key.span(), node: Node::from(value) })
    };
    Value::Table(table.iter().map(member).collect())
}
