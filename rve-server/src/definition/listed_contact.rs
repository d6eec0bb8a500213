//! A contact as packing files have it: one row of numbers.

use crate::space::{Discs, Space};
use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;

/// A contact with a known tangential force, written as one row: grain i, grain j, the integer cell shifts of j along the
/// periodicity vectors, then the tangential force that acts on i, N: in the plane its component along e (from i to j)
/// rotated by +90 degrees, in space a vector in brackets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ListedContact<S: Space = Discs> {
    /// Grain i.
    pub origin: u32,
    /// Grain j.
    pub end: u32,
    /// Cell shifts of grain j.
    pub shift: S::Shift,
    /// Tangential force on grain i, N.
    pub tangential_force: S::Tangential,
}

impl<S: Space> Serialize for ListedContact<S> {
    fn serialize<W: Serializer>(&self, serializer: W) -> Result<W::Ok, W::Error> {
        let mut row = serializer.serialize_tuple(3 + S::DIMENSION)?;
        row.serialize_element(&self.origin)?;
        row.serialize_element(&self.end)?;
        for axis in 0..S::DIMENSION {
            row.serialize_element(&self.shift[axis])?;
        }
        row.serialize_element(&self.tangential_force)?;
        row.end()
    }
}

struct Row<S>(PhantomData<S>);

impl<'de, S: Space> Visitor<'de> for Row<S> {
    type Value = ListedContact<S>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let force = if S::DIMENSION == 2 { "a tangential force" } else { "a tangential force [x, y, z]" };
        write!(formatter, "a contact [i, j, {} cell shifts, {force}]", S::DIMENSION)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut row: A) -> Result<Self::Value, A::Error> {
        let missing = |place: usize| A::Error::invalid_length(place, &Row::<S>(PhantomData));
        let origin = row.next_element()?.ok_or_else(|| missing(0))?;
        let end = row.next_element()?.ok_or_else(|| missing(1))?;
        let mut shift = S::Shift::default();
        for axis in 0..S::DIMENSION {
            shift[axis] = row.next_element()?.ok_or_else(|| missing(2 + axis))?;
        }
        let tangential_force = row.next_element()?.ok_or_else(|| missing(2 + S::DIMENSION))?;
        if row.next_element::<serde::de::IgnoredAny>()?.is_some() {
            return Err(missing(4 + S::DIMENSION));
        }
        Ok(ListedContact { origin, end, shift, tangential_force })
    }
}

impl<'de, S: Space> Deserialize<'de> for ListedContact<S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_tuple(3 + S::DIMENSION, Row(PhantomData))
    }
}
