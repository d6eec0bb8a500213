//! From settings in Rust to the values that a document would hold for them. Numbers keep all bits, also those that are not
//! finite, which JSON would lose.

use super::node::{Member, Node, Value};
use serde::ser::{
    Error, Serialize, SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant, SerializeTuple,
    SerializeTupleStruct, SerializeTupleVariant, Serializer,
};
use std::collections::BTreeMap;
use std::fmt;

/// The value of settings as a document would write it; it stands nowhere.
///
/// # Errors
/// The settings hold something that no document can, such as a map whose keys are not texts.
pub fn to_node<T: Serialize + ?Sized>(settings: &T) -> Result<Node, Unwritable> {
    settings.serialize(ToNode)
}

/// What no document can hold.
#[derive(Debug)]
pub struct Unwritable(String);

impl fmt::Display for Unwritable {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for Unwritable {}

impl Error for Unwritable {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

struct ToNode;

fn plain(value: Value) -> Result<Node, Unwritable> {
    Ok(Node::new(value))
}

impl Serializer for ToNode {
    type Ok = Node;
    type Error = Unwritable;
    type SerializeSeq = List;
    type SerializeTuple = List;
    type SerializeTupleStruct = List;
    type SerializeTupleVariant = List;
    type SerializeMap = Members;
    type SerializeStruct = Members;
    type SerializeStructVariant = Members;

    fn serialize_bool(self, flag: bool) -> Result<Node, Unwritable> {
        plain(Value::Boolean(flag))
    }

    fn serialize_i8(self, number: i8) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_i16(self, number: i16) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_i32(self, number: i32) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_i64(self, number: i64) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_u8(self, number: u8) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_u16(self, number: u16) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_u32(self, number: u32) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_u64(self, number: u64) -> Result<Node, Unwritable> {
        plain(Value::Integer(number.into()))
    }

    fn serialize_f32(self, number: f32) -> Result<Node, Unwritable> {
        plain(Value::Number(number.into()))
    }

    fn serialize_f64(self, number: f64) -> Result<Node, Unwritable> {
        plain(Value::Number(number))
    }

    fn serialize_char(self, letter: char) -> Result<Node, Unwritable> {
        plain(Value::Text(letter.to_string()))
    }

    fn serialize_str(self, text: &str) -> Result<Node, Unwritable> {
        plain(Value::Text(text.to_owned()))
    }

    fn serialize_bytes(self, _bytes: &[u8]) -> Result<Node, Unwritable> {
        Err(Unwritable::custom("bytes have no key"))
    }

    fn serialize_none(self) -> Result<Node, Unwritable> {
        plain(Value::Nothing)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Node, Unwritable> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<Node, Unwritable> {
        plain(Value::Nothing)
    }

    fn serialize_unit_struct(self, _name: &'static str) -> Result<Node, Unwritable> {
        plain(Value::Nothing)
    }

    fn serialize_unit_variant(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
    ) -> Result<Node, Unwritable> {
        plain(Value::Text(variant.to_owned()))
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _name: &'static str,
        value: &T,
    ) -> Result<Node, Unwritable> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<Node, Unwritable> {
        Ok(under(Some(variant), value.serialize(Self)?))
    }

    fn serialize_seq(self, _length: Option<usize>) -> Result<List, Unwritable> {
        Ok(List { variant: None, entries: Vec::new() })
    }

    fn serialize_tuple(self, _length: usize) -> Result<List, Unwritable> {
        Ok(List { variant: None, entries: Vec::new() })
    }

    fn serialize_tuple_struct(self, _name: &'static str, _length: usize) -> Result<List, Unwritable> {
        Ok(List { variant: None, entries: Vec::new() })
    }

    fn serialize_tuple_variant(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
        _length: usize,
    ) -> Result<List, Unwritable> {
        Ok(List { variant: Some(variant), entries: Vec::new() })
    }

    fn serialize_map(self, _length: Option<usize>) -> Result<Members, Unwritable> {
        Ok(Members::default())
    }

    fn serialize_struct(self, _name: &'static str, _length: usize) -> Result<Members, Unwritable> {
        Ok(Members::default())
    }

    fn serialize_struct_variant(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
        _length: usize,
    ) -> Result<Members, Unwritable> {
        Ok(Members { variant: Some(variant), ..Members::default() })
    }
}

/// The value itself, or a table with the variant as its only key.
fn under(variant: Option<&'static str>, node: Node) -> Node {
    let Some(variant) = variant else { return node };
    let mut table = Node::table();
    table.set(variant, node);
    table
}

/// A list under construction.
struct List {
    variant: Option<&'static str>,
    entries: Vec<Node>,
}

impl List {
    fn push<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.entries.push(value.serialize(ToNode)?);
        Ok(())
    }

    fn finish(self) -> Result<Node, Unwritable> {
        Ok(under(self.variant, Node::new(Value::List(self.entries))))
    }
}

impl SerializeSeq for List {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.push(value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}

impl SerializeTuple for List {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.push(value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}

impl SerializeTupleStruct for List {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.push(value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}

impl SerializeTupleVariant for List {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.push(value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}

/// A table under construction.
#[derive(Default)]
struct Members {
    variant: Option<&'static str>,
    members: BTreeMap<String, Member>,
    key: Option<String>,
}

impl Members {
    fn push<T: Serialize + ?Sized>(&mut self, key: String, value: &T) -> Result<(), Unwritable> {
        let node = value.serialize(ToNode)?;
        self.members.insert(key, Member { key: 0..0, node });
        Ok(())
    }

    fn finish(self) -> Result<Node, Unwritable> {
        Ok(under(self.variant, Node::new(Value::Table(self.members))))
    }
}

impl SerializeMap for Members {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Unwritable> {
        match key.serialize(ToNode)?.value {
            Value::Text(text) => self.key = Some(text),
            Value::Integer(number) => self.key = Some(number.to_string()),
            _ => return Err(Unwritable::custom("a key that is no text")),
        }
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        let key = self.key.take().ok_or_else(|| Unwritable::custom("a value without its key"))?;
        self.push(key, value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}

impl SerializeStruct for Members {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, key: &'static str, value: &T) -> Result<(), Unwritable> {
        self.push(key.to_owned(), value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}

impl SerializeStructVariant for Members {
    type Ok = Node;
    type Error = Unwritable;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, key: &'static str, value: &T) -> Result<(), Unwritable> {
        self.push(key.to_owned(), value)
    }

    fn end(self) -> Result<Node, Unwritable> {
        self.finish()
    }
}
