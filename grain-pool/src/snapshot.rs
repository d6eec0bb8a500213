//! The state of one point as bytes that can be kept and moved.

use macro_solver::pool::PointState;
use protocol::{ContentId, DefinitionId, RveError, snapshot};
use rve_server::engine::ENGINE_NAME;
use thiserror::Error;

/// Bytes of the identity before the state.
const IDENTITY: usize = 16;

/// Why bytes, or what they hold, cannot become the state of a point.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// Not even an identity.
    #[error("these bytes are too short to be a snapshot; give the bytes that `snapshot` returned")]
    TooShort,
    /// Damaged or foreign bytes.
    #[error(transparent)]
    Sealed(#[from] snapshot::SnapshotError),
    /// It was taken of another definition.
    #[error("it was taken of another cell; packing, contact law and options have to be the same")]
    OtherCell,
    /// The cell refuses the state.
    #[error(transparent)]
    State(#[from] RveError),
}

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
    /// [`SnapshotError`]: damaged or foreign bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SnapshotError> {
        let Some((identity, state)) = bytes.split_first_chunk::<IDENTITY>() else {
            return Err(SnapshotError::TooShort);
        };
        if !state.is_empty() {
            snapshot::open(ENGINE_NAME, state)?;
        }
        Ok(Self { definition: ContentId(*identity), state: PointState::from_snapshot(state.into()) })
    }

    /// Whether it can be restored to a point of this definition.
    ///
    /// # Errors
    /// [`SnapshotError::OtherCell`].
    pub(crate) fn fits(&self, definition: DefinitionId) -> Result<(), SnapshotError> {
        if self.definition == definition {
            return Ok(());
        }
        Err(SnapshotError::OtherCell)
    }
}
