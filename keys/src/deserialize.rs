//! From the values of a document to Rust types, by one deserialiser for all kinds of input files.

use super::check::Fault;
use super::located::LOCATED;
use super::node::{Member, Node, Value, type_name};
use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer, MapAccess, SeqAccess,
    Unexpected, VariantAccess, Visitor,
};
use serde::forward_to_deserialize_any;
use std::collections::btree_map;
use std::fmt;
use std::ops::Range;

/// Reads a value into `T`.
///
/// # Errors
/// What does not fit, with its place. A document that [`crate::check`] accepts for the table of `T` fits, but for checks that
/// `T` makes itself.
pub fn deserialize<T: DeserializeOwned>(node: &Node) -> Result<T, Fault> {
    T::deserialize(node).map_err(|misfit| Fault {
        path: Vec::new(),
        span: misfit.span.unwrap_or_else(|| node.span.clone()),
        problem: misfit.message,
        hint: None,
    })
}

/// Why a value cannot become what is asked for, and where.
#[derive(Debug)]
pub struct Misfit {
    span: Option<Range<usize>>,
    message: String,
}

impl Misfit {
    fn at(mut self, span: &Range<usize>) -> Self {
        self.span.get_or_insert_with(|| span.clone());
        self
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl std::error::Error for Misfit {}

impl Error for Misfit {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { span: None, message: message.to_string() }
    }
}

impl<'de> Deserializer<'de> for &'de Node {
    type Error = Misfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let read = match &self.value {
            Value::Nothing => visitor.visit_none(),
            Value::Boolean(flag) => visitor.visit_bool(*flag),
            Value::Integer(number) => match (i64::try_from(*number), u64::try_from(*number)) {
                (Ok(number), _) => visitor.visit_i64(number),
                (_, Ok(number)) => visitor.visit_u64(number),
                _ => Err(Misfit::invalid_value(Unexpected::Other("a number of too many digits"), &visitor)),
            },
            Value::Number(number) => visitor.visit_f64(*number),
            Value::Text(text) | Value::Date(text) => visitor.visit_borrowed_str(text),
            Value::List(entries) => visitor.visit_seq(Entries(entries.iter())),
            Value::Table(members) => visitor.visit_map(Members { rest: members.iter(), value: None }),
        };
        read.map_err(|misfit| misfit.at(&self.span))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        match self.value {
            Value::Nothing => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Misfit> {
        match name {
            LOCATED => visitor.visit_seq(Place { node: self, given: 0 }),
            _ => visitor.visit_newtype_struct(self),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        let read = match &self.value {
            Value::Text(word) => visitor.visit_enum(IntoDeserializer::<Misfit>::into_deserializer(word.as_str())),
            Value::Table(members) => match members.iter().next() {
                Some((word, member)) if members.len() == 1 => {
                    visitor.visit_enum(Variant { word, node: &member.node })
                }
                _ => Err(Misfit::custom("expected a word, or a table with exactly one key")),
            },
            other => Err(Misfit::custom(format!("expected a word, not {}", type_name(other)))),
        };
        read.map_err(|misfit| misfit.at(&self.span))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

/// Entries of a list.
struct Entries<'de>(std::slice::Iter<'de, Node>);

impl<'de> SeqAccess<'de> for Entries<'de> {
    type Error = Misfit;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Misfit> {
        let Some(node) = self.0.next() else { return Ok(None) };
        seed.deserialize(node).map(Some).map_err(|misfit| misfit.at(&node.span))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

/// Keys of a table.
struct Members<'de> {
    rest: btree_map::Iter<'de, String, Member>,
    value: Option<&'de Node>,
}

impl<'de> MapAccess<'de> for Members<'de> {
    type Error = Misfit;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Misfit> {
        let Some((key, member)) = self.rest.next() else { return Ok(None) };
        self.value = Some(&member.node);
        let key: StrDeserializer<'_, Misfit> = key.as_str().into_deserializer();
        seed.deserialize(key).map(Some).map_err(|misfit| misfit.at(&member.key))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Misfit> {
        let node = self.value.take().ok_or_else(|| Misfit::custom("a value without its key"))?;
        seed.deserialize(node).map_err(|misfit| misfit.at(&node.span))
    }
}

/// Start, end and value of a [`crate::Located`].
struct Place<'de> {
    node: &'de Node,
    given: usize,
}

impl<'de> SeqAccess<'de> for Place<'de> {
    type Error = Misfit;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Misfit> {
        self.given += 1;
        match self.given {
            1 => seed.deserialize(self.node.span.start.into_deserializer()).map(Some),
            2 => seed.deserialize(self.node.span.end.into_deserializer()).map(Some),
            3 => seed.deserialize(self.node).map(Some),
            _ => Ok(None),
        }
    }
}

/// A word with a value of its own: `{ word = value }`.
struct Variant<'de> {
    word: &'de str,
    node: &'de Node,
}

impl<'de> EnumAccess<'de> for Variant<'de> {
    type Error = Misfit;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self), Misfit> {
        let word: StrDeserializer<'_, Misfit> = self.word.into_deserializer();
        Ok((seed.deserialize(word)?, self))
    }
}

impl<'de> VariantAccess<'de> for Variant<'de> {
    type Error = Misfit;

    fn unit_variant(self) -> Result<(), Misfit> {
        Err(Misfit::custom(format!("`{}` takes no value", self.word)).at(&self.node.span))
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Misfit> {
        seed.deserialize(self.node)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _length: usize, visitor: V) -> Result<V::Value, Misfit> {
        self.node.deserialize_any(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        self.node.deserialize_any(visitor)
    }
}
