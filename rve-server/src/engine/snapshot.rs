//! Snapshots of this engine: which states they hold, and how they are read.

use crate::cell::GrainState;
use crate::space::Space;
use protocol::{DefinitionId, RveError, snapshot};

/// Name of this engine, which serves discs and spheres, in snapshots and capabilities.
pub const ENGINE_NAME: &str = "grainspan-grains";

/// Reads the state of a snapshot that belongs to a definition with this many grains.
///
/// # Errors
/// [`RveError::Snapshot`].
pub(crate) fn opened<S: Space>(
    bytes: &[u8],
    id: DefinitionId,
    grain_count: usize,
) -> Result<GrainState<S>, RveError> {
    let refuse = |reason: String| RveError::Snapshot(reason);
    let payload = snapshot::open(ENGINE_NAME, bytes).map_err(|error| refuse(error.to_string()))?;
    GrainState::from_bytes(payload, id, grain_count).map_err(|error| refuse(error.to_string()))
}
