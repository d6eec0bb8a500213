//! The state of one point as bytes that can be kept and moved.

use macro_solver::pool::PointState;
use protocol::{ContentId, DefinitionId, snapshot};
use rve_server::engine::ENGINE_NAME;

/// Bytes of the identity before the state.
const IDENTITY: usize = 16;

/// The committed state of one point: what it is made of, and the sealed state of its grains. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Snapshot {
    pub(crate) definition: DefinitionId,
    pub(crate) state: PointState,
}

impl Snapshot {
    /// The snapshot as bytes. They stay valid for the same packing, contact law and options, in any process and pool.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(IDENTITY + self.state.bytes.len());
        bytes.extend_from_slice(&self.definition.0);
        bytes.extend_from_slice(&self.state.bytes);
        bytes
    }

    /// Reads the bytes of [`Snapshot::to_bytes`].
    ///
    /// # Errors
    /// Damaged or foreign bytes, in a sentence.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let Some((identity, state)) = bytes.split_first_chunk::<IDENTITY>() else {
            return Err("these bytes are too short to be a snapshot; give the bytes that `snapshot` returned".into());
        };
        if !state.is_empty() {
            snapshot::open(ENGINE_NAME, state).map_err(|error| error.to_string())?;
        }
        Ok(Self { definition: ContentId(*identity), state: PointState::from_snapshot(state.into()) })
    }

    /// Whether it can be restored to a point of this definition.
    ///
    /// # Errors
    /// It belongs to another definition, in a sentence.
    pub(crate) fn fits(&self, definition: DefinitionId) -> Result<(), String> {
        if self.definition == definition {
            return Ok(());
        }
        Err("it was taken of another cell; packing, contact law and options have to be the same".into())
    }
}
