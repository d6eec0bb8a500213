//! Content identity: a state or definition is named by a hash of its bytes.
//!
//! Two processes that hold equal bytes agree on the name without talking, a job can be sent twice without harm, and
//! equal bits after a crash show as equal names.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io::{self, Read};

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

    /// Names what a reader gives, in pieces: nothing large is held in memory.
    ///
    /// # Errors
    /// Those of the reader.
    pub fn of_reader(mut reader: impl Read) -> io::Result<Self> {
        let mut state = xxhash_rust::xxh3::Xxh3Default::new();
        let mut piece = vec![0; 1 << 16];
        loop {
            match reader.read(&mut piece)? {
                0 => return Ok(Self(state.digest128().to_le_bytes())),
                length => state.update(&piece[..length]),
            }
        }
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

    #[test]
    fn what_is_read_in_pieces_has_the_same_name() {
        for length in [0, 1, 65_536, 200_001] {
            let bytes: Vec<u8> = (0..length).map(|place| (place % 251) as u8).collect();
            assert_eq!(ContentId::of_reader(bytes.as_slice()).unwrap(), ContentId::of(&bytes), "{length}");
        }
    }
}
