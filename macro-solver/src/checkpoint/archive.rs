//! The state of a run in memory: named sections and the snapshots that they refer to.

use super::CheckpointError;
use protocol::StateId;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One part's state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Section {
    /// Version of the part's own layout.
    pub(super) version: u32,
    /// MessagePack.
    #[serde(with = "serde_bytes")]
    pub(super) bytes: Vec<u8>,
}

/// Sections by name and snapshots by content. Snapshots are shared with their owner, so collecting them copies nothing, and
/// equal ones are stored once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Archive {
    pub(super) sections: BTreeMap<String, Section>,
    pub(super) snapshots: BTreeMap<StateId, Arc<[u8]>>,
}

impl Archive {
    /// Nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Puts a section; `version` counts changes of the layout of `value`.
    ///
    /// # Panics
    /// When `value` cannot be encoded, which plain data always can.
    pub fn put<T: Serialize>(&mut self, name: &str, version: u32, value: &T) {
        let bytes = rmp_serde::to_vec(value).expect("sections are plain data");
        self.sections.insert(name.to_owned(), Section { version, bytes });
    }

    /// Reads a section.
    ///
    /// # Errors
    /// [`CheckpointError::Missing`], [`CheckpointError::Section`], [`CheckpointError::Unfit`].
    pub fn get<T: DeserializeOwned>(&self, name: &str, version: u32) -> Result<T, CheckpointError> {
        let missing = || CheckpointError::Missing { section: name.to_owned() };
        let section = self.sections.get(name).ok_or_else(missing)?;
        if section.version != version {
            let section_name = name.to_owned();
            return Err(CheckpointError::Section {
                section: section_name,
                found: section.version,
                expected: version,
            });
        }
        rmp_serde::from_slice(&section.bytes).map_err(|error| CheckpointError::unfit(name, error))
    }

    /// Bytes of all sections and snapshots.
    pub fn size(&self) -> u64 {
        let sections = self.sections.values().map(|section| section.bytes.len() as u64).sum::<u64>();
        sections + self.snapshots.values().map(|bytes| bytes.len() as u64).sum::<u64>()
    }

    /// Whether a section of this name is there.
    pub fn holds(&self, name: &str) -> bool {
        self.sections.contains_key(name)
    }

    /// Keeps a snapshot under its name.
    pub fn keep_snapshot(&mut self, id: StateId, bytes: &Arc<[u8]>) {
        self.snapshots.entry(id).or_insert_with(|| Arc::clone(bytes));
    }

    /// A snapshot by its name.
    pub fn snapshot(&self, id: StateId) -> Option<Arc<[u8]>> {
        self.snapshots.get(&id).cloned()
    }
}
