//! Content identity: a state or definition is named by a hash of its bytes.
//!
//! Two processes that hold equal bytes agree on the name without talking, a job can be sent twice without harm, and
//! equal bits after a crash show as equal names.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;

/// 128-bit XXH3 of the named bytes, little endian. Guards against accidents, not against forgery.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[repr(transparent)]
pub struct ContentId(pub [u8; 16]);

/// Names one snapshot of one RVE.
pub type StateId = ContentId;

/// Names one RVE definition (packing, contact law, options).
pub type DefinitionId = ContentId;

impl ContentId {
    /// The name of nothing: a definition's own initial state is asked for with it.
    pub const NONE: Self = Self([0; 16]);

    /// Names `bytes`.
    pub fn of(bytes: &[u8]) -> Self {
        Self(xxhash_rust::xxh3::xxh3_128(bytes).to_le_bytes())
    }
}

impl fmt::Display for ContentId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for byte in &self.0[..6] {
            write!(formatter, "{byte:02x}")?;
        }
        Ok(())
    }
}

impl fmt::Debug for ContentId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for byte in &self.0 {
            write!(formatter, "{byte:02x}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_bytes_have_equal_names_and_one_bit_changes_the_name() {
        let bytes = vec![7u8; 50_000];
        let mut other = bytes.clone();
        assert_eq!(ContentId::of(&bytes), ContentId::of(&other));
        other[31_415] ^= 1;
        assert_ne!(ContentId::of(&bytes), ContentId::of(&other));
    }
}
