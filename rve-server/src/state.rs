//! Everything that a committed or trial state of one cell consists of, and its bytes.
//!
//! A state is complete: two solvers with equal states give equal answers. The pair list is a cache and therefore not
//! part of it, and positions are never wrapped back into the cell because the cell shift is part of a contact's key.

use crate::cell::Cell;
use crate::pairs::PairKey;
use crate::plane::Plane;
use bytemuck::{Pod, Zeroable};
use protocol::{ContentId, DefinitionId};
use serde::{Deserialize, Serialize};

/// A touching pair and its tangential force.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ContactRecord {
    /// Origin grain.
    pub origin: u32,
    /// End grain.
    pub end: u32,
    /// Cell shifts of the end grain along Y1 and Y2.
    pub shift: [i32; 2],
    /// Tangential force along t, N.
    pub tangential_force: f64,
}

impl ContactRecord {
    /// Key of the pair.
    pub fn key(&self) -> PairKey {
        PairKey { origin: self.origin, end: self.end, shift: self.shift }
    }
}

/// State of one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct GrainState {
    /// Periodic cell.
    pub cell: Cell,
    /// Grain centres, m; not wrapped.
    pub positions: Vec<[f64; 2]>,
    /// Grain rotations since the initial state, rad, counter-clockwise.
    pub rotations: Vec<f64>,
    /// Touching pairs, sorted by key.
    pub contacts: Vec<ContactRecord>,
    /// Work lost to friction since the initial state, J.
    pub dissipation: f64,
    /// Cell area of the initial state, m2.
    pub initial_area: f64,
    /// Value of the equilibrium criterion when the state was reached.
    pub unbalanced: f64,
}

#[derive(Serialize, Deserialize)]
struct Payload<'a> {
    definition: ContentId,
    cell: Plane,
    dissipation: f64,
    initial_area: f64,
    unbalanced: f64,
    #[serde(with = "serde_bytes")]
    positions: &'a [u8],
    #[serde(with = "serde_bytes")]
    rotations: &'a [u8],
    #[serde(with = "serde_bytes")]
    contacts: &'a [u8],
}

impl GrainState {
    /// The bytes of the state, naming the definition it belongs to.
    pub fn to_bytes(&self, definition: DefinitionId) -> Vec<u8> {
        let payload = Payload {
            definition,
            cell: self.cell.rows,
            dissipation: self.dissipation,
            initial_area: self.initial_area,
            unbalanced: self.unbalanced,
            positions: bytemuck::cast_slice(&self.positions),
            rotations: bytemuck::cast_slice(&self.rotations),
            contacts: bytemuck::cast_slice(&self.contacts),
        };
        rmp_serde::to_vec(&payload).expect("writing MessagePack to memory cannot fail")
    }

    /// Reads a state of `grain_count` grains back.
    ///
    /// # Errors
    /// Bytes that are not a state, or a state of another definition.
    pub fn from_bytes(bytes: &[u8], definition: DefinitionId, grain_count: usize) -> Result<Self, String> {
        let payload: Payload<'_> =
            rmp_serde::from_slice(bytes).map_err(|error| format!("not a state of a grain cell: {error}"))?;
        if payload.definition != definition {
            return Err(format!("state of definition {}, but this RVE is {definition}", payload.definition));
        }
        let state = Self {
            cell: Cell { rows: payload.cell },
            positions: copied(payload.positions)?,
            rotations: copied(payload.rotations)?,
            contacts: copied(payload.contacts)?,
            dissipation: payload.dissipation,
            initial_area: payload.initial_area,
            unbalanced: payload.unbalanced,
        };
        if state.positions.len() != grain_count || state.rotations.len() != grain_count {
            return Err(format!("state of {} grains, but this RVE has {grain_count}", state.positions.len()));
        }
        let known = |contact: &ContactRecord| (contact.origin.max(contact.end) as usize) < grain_count;
        if !state.contacts.iter().all(known) || !state.contacts.is_sorted_by_key(ContactRecord::key) {
            return Err("state with a contact list that is not sound".into());
        }
        Ok(state)
    }
}

/// Copies unaligned bytes into values.
fn copied<T: Pod>(bytes: &[u8]) -> Result<Vec<T>, String> {
    if !bytes.len().is_multiple_of(size_of::<T>()) {
        return Err(format!("{} bytes do not hold a whole number of records", bytes.len()));
    }
    let mut values = vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::cast_slice_mut(&mut values).copy_from_slice(bytes);
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> GrainState {
        GrainState {
            cell: Cell { rows: [[1.0, 0.1], [-0.3, 2.0]] },
            positions: vec![[0.1, 0.2], [f64::MIN_POSITIVE, -1.0 / 3.0]],
            rotations: vec![0.0, -1e-17],
            contacts: vec![ContactRecord { origin: 0, end: 1, shift: [-1, 2], tangential_force: 0.1 + 0.2 }],
            dissipation: 1e-30,
            initial_area: 2.03,
            unbalanced: 1e-4,
        }
    }

    #[test]
    fn bytes_restore_every_bit() {
        let id = ContentId::of(b"definition");
        let bytes = state().to_bytes(id);
        let restored = GrainState::from_bytes(&bytes, id, 2).unwrap();
        assert_eq!(restored.to_bytes(id), bytes);
        assert_eq!(restored, state());
    }

    #[test]
    fn foreign_or_damaged_states_are_refused() {
        let id = ContentId::of(b"definition");
        let bytes = state().to_bytes(id);
        assert!(GrainState::from_bytes(&bytes, ContentId::of(b"other"), 2).unwrap_err().contains("definition"));
        assert!(GrainState::from_bytes(&bytes, id, 3).unwrap_err().contains("2 grains"));
        assert!(GrainState::from_bytes(&bytes[1..], id, 2).is_err());
        let mut unsound = state();
        unsound.contacts[0].end = 5;
        assert!(GrainState::from_bytes(&unsound.to_bytes(id), id, 2).unwrap_err().contains("not sound"));
    }
}
