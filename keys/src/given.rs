//! The keys of a table that are written: they replace those of settings that hold otherwise.

use super::check::Fault;
use super::deserialize::deserialize;
use super::node::{Member, Node, Value};
use super::serialize::to_node;
use super::shape::{Shape, Table};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde::{Serialize, de};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// The written keys of the table `T`, which may be any of them. Whoever reads the document checks them against `T`.
pub struct Given<T> {
    node: Node,
    keys: PhantomData<fn() -> T>,
}

impl<T> Clone for Given<T> {
    fn clone(&self) -> Self {
        Self { node: self.node.clone(), keys: PhantomData }
    }
}

impl<T> fmt::Debug for Given<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_tuple("Given").field(&self.node).finish()
    }
}

impl<T> Default for Given<T> {
    fn default() -> Self {
        Self { node: Node::table(), keys: PhantomData }
    }
}

impl<T> Given<T> {
    /// Whether a key is written.
    pub fn has(&self, key: &str) -> bool {
        self.node.get(key).is_some()
    }

    /// The names of the keys that are written.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.node.members().into_iter().flat_map(BTreeMap::keys).map(String::as_str)
    }

    /// The value of a key, if it is written.
    ///
    /// # Errors
    /// It is no `V`.
    pub fn get<V: DeserializeOwned>(&self, key: &str) -> Result<Option<V>, Fault> {
        self.node.get(key).map(deserialize).transpose()
    }
}

impl<T: JsonSchema> Given<T> {
    /// `settings` with the written keys in place of their own. Keys that `settings` does not have are left out of it: several
    /// structs can share a table.
    ///
    /// # Errors
    /// A value that does not fit, which a check of the document excludes.
    pub fn over<S: Serialize + DeserializeOwned>(&self, settings: &S) -> Result<S, Fault> {
        merged(settings, &self.node, &Table::of::<T>())
    }
}

/// `settings` with the keys of `given`, a value of `table`, in place of their own.
///
/// # Errors
/// A value that does not fit, which a check of the document excludes.
pub fn merged<S: Serialize + DeserializeOwned>(settings: &S, given: &Node, table: &Table) -> Result<S, Fault> {
    let unwritable =
        |error: &dyn fmt::Display| Fault { path: Vec::new(), span: 0..0, problem: error.to_string(), hint: None };
    let mut node = to_node(settings).map_err(|error| unwritable(&error))?;
    merge(&mut node, given, table);
    deserialize(&node)
}

fn merge(node: &mut Node, given: &Node, table: &Table) {
    for (name, member) in given.members().into_iter().flatten() {
        let key = table.key(name);
        if let (Some(other), Some(members)) = (key.and_then(|key| key.instead_of.as_ref()), node.members_mut()) {
            members.remove(other);
        }
        // Tables of words with a value, such as a control of the load, are replaced as a whole.
        let inner = key.and_then(|key| if let Shape::Table(inner) = &key.shape { Some(inner) } else { None });
        let below = node.members_mut().and_then(|members| members.get_mut(name)).map(|member| &mut member.node);
        match (inner, below) {
            (Some(inner), Some(below)) if below.members().is_some() => {
                for key in &inner.keys {
                    if let (Some(flag), None) = (key.when_written, member.node.get(&key.name)) {
                        below.set(&key.name, Node::new(Value::Boolean(flag)));
                    }
                }
                merge(below, &member.node, inner);
            }
            _ => node.set(name, member.node.clone()),
        }
    }
}

impl<T: JsonSchema> JsonSchema for Given<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

impl<'de, T> Deserialize<'de> for Given<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self { node: Node::deserialize(deserializer)?, keys: PhantomData })
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_bool<E: Error>(self, flag: bool) -> Result<Node, E> {
        Ok(Node::new(Value::Boolean(flag)))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Node, E> {
        Ok(Node::new(Value::Integer(number.into())))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Node, E> {
        Ok(Node::new(Value::Integer(number.into())))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Node, E> {
        Ok(Node::new(Value::Number(number)))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Node, E> {
        Ok(Node::new(Value::Text(text.to_owned())))
    }

    fn visit_none<E: Error>(self) -> Result<Node, E> {
        Ok(Node::new(Value::Nothing))
    }

    fn visit_unit<E: Error>(self) -> Result<Node, E> {
        Ok(Node::new(Value::Nothing))
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Node, D::Error> {
        de::Deserialize::deserialize(deserializer)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Node, A::Error> {
        let mut list = Vec::new();
        while let Some(entry) = entries.next_element()? {
            list.push(entry);
        }
        Ok(Node::new(Value::List(list)))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Node, A::Error> {
        let mut table = BTreeMap::new();
        while let Some((key, node)) = entries.next_entry::<String, Node>()? {
            table.insert(key, Member { key: 0..0, node });
        }
        Ok(Node::new(Value::Table(table)))
    }
}
