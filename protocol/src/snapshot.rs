//! The envelope round an engine's opaque state: format version, engine name, checksum.
//!
//! Encoded as MessagePack. The payload's meaning belongs to the engine; the envelope lets a macro store, ship and check
//! it without understanding it.

use crate::identity::ContentId;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the envelope, not of any engine's payload.
pub const SNAPSHOT_FORMAT: u32 = 1;

/// More than everything around payload and engine name takes, bytes.
const LARGEST_HEADER: usize = 32;

/// Why a snapshot was refused.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum SnapshotError {
    /// The bytes are not an envelope.
    #[error("these bytes are not a snapshot: {0}")]
    Malformed(String),
    /// The envelope has another format version.
    #[error("snapshot format {found}, but this program reads format {SNAPSHOT_FORMAT}")]
    Format {
        /// Version found in the envelope.
        found: u32,
    },
    /// The snapshot was written by another engine.
    #[error("snapshot of engine `{found}`, but `{expected}` was asked to restore it")]
    Engine {
        /// Name in the envelope.
        found: String,
        /// Name of the restoring engine.
        expected: String,
    },
    /// The payload does not have the recorded checksum.
    #[error("snapshot is damaged: its checksum does not match its content")]
    Checksum,
}

#[derive(Serialize, Deserialize)]
struct Envelope<'a> {
    format: u32,
    engine: &'a str,
    checksum: u64,
    #[serde(with = "serde_bytes")]
    payload: &'a [u8],
}

/// Wraps an engine's payload; `out` is overwritten.
pub fn seal(engine: &str, payload: &[u8], out: &mut Vec<u8>) {
    out.clear();
    out.reserve(payload.len() + engine.len() + LARGEST_HEADER);
    let envelope = Envelope { format: SNAPSHOT_FORMAT, engine, checksum: checksum(payload), payload };
    rmp_serde::encode::write(out, &envelope).expect("writing MessagePack to memory cannot fail");
}

/// Checks an envelope and returns the engine's payload.
///
/// # Errors
/// Every way in which the bytes are not a sound snapshot of `engine`, see [`SnapshotError`].
pub fn open<'a>(engine: &str, bytes: &'a [u8]) -> Result<&'a [u8], SnapshotError> {
    let envelope: Envelope<'a> =
        rmp_serde::from_slice(bytes).map_err(|error| SnapshotError::Malformed(error.to_string()))?;
    if envelope.format != SNAPSHOT_FORMAT {
        return Err(SnapshotError::Format { found: envelope.format });
    }
    if envelope.engine != engine {
        return Err(SnapshotError::Engine { found: envelope.engine.to_owned(), expected: engine.to_owned() });
    }
    if envelope.checksum != checksum(envelope.payload) {
        return Err(SnapshotError::Checksum);
    }
    // The payload is the last field, so bytes behind it belong to nothing.
    let behind = bytes.as_ptr_range().end as usize - envelope.payload.as_ptr_range().end as usize;
    if behind > 0 {
        return Err(SnapshotError::Malformed(format!("{behind} bytes follow its end")));
    }
    Ok(envelope.payload)
}

fn checksum(payload: &[u8]) -> u64 {
    let id = ContentId::of(payload);
    u64::from_le_bytes(id.0[..8].try_into().expect("eight of sixteen bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sealed_payload_opens_to_the_same_bytes() {
        let mut out = Vec::new();
        seal("grains", &[1, 2, 3], &mut out);
        assert_eq!(open("grains", &out).unwrap(), &[1, 2, 3]);
    }

    #[test]
    fn damage_foreign_engines_and_noise_are_refused() {
        let mut out = Vec::new();
        seal("grains", &[9; 100], &mut out);
        assert!(matches!(open("other", &out), Err(SnapshotError::Engine { .. })));
        let last = out.len() - 1;
        out[last] ^= 1;
        assert_eq!(open("grains", &out), Err(SnapshotError::Checksum));
        assert!(matches!(open("grains", &out[..20]), Err(SnapshotError::Malformed(_))));
        assert!(matches!(open("grains", b""), Err(SnapshotError::Malformed(_))));
        out[last] ^= 1;
        out.push(7);
        let error = open("grains", &out).unwrap_err();
        assert_eq!(error, SnapshotError::Malformed("1 bytes follow its end".into()));
    }
}
