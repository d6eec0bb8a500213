//! The truth about every Gauss point: what it is made of, its committed state, its trial.
//!
//! Workers are caches of what is held here. States are opaque bytes named by their content and shared, not copied:
//! points that answered alike hold one snapshot together.

use super::cost_model::CostModel;
use crate::material::PointId;
use protocol::transport::WorkerId;
use protocol::{Definition, DefinitionId, StateId};
use std::sync::Arc;

/// A snapshot and its name; [`StateId::NONE`] with no bytes is the initial state of the point's definition.
#[derive(Clone, Debug)]
pub struct PointState {
    /// Content identity of `bytes`.
    pub id: StateId,
    /// Sealed snapshot, empty for the initial state.
    pub bytes: Arc<[u8]>,
    /// Worker that produced it and so probably still holds it; a hint only.
    pub(super) holder: Option<WorkerId>,
}

impl PointState {
    /// The initial state of whatever definition.
    pub fn initial() -> Self {
        Self { id: StateId::NONE, bytes: Arc::from([]), holder: None }
    }

    /// A state from its snapshot; no bytes make the initial state.
    pub fn from_snapshot(bytes: Arc<[u8]>) -> Self {
        let id = if bytes.is_empty() { StateId::NONE } else { StateId::of(&bytes) };
        Self { id, bytes, holder: None }
    }
}

/// One Gauss point.
#[derive(Clone, Debug)]
pub(super) struct PointRecord {
    /// Index of the definition that it was made of.
    pub(super) made_of: usize,
    /// Index of the definition that its state belongs to: another one only after [`PointTable::copy`].
    pub(super) definition: usize,
    /// Where every trial starts.
    pub(super) committed: PointState,
    /// End of the latest trial since the last commit or rollback.
    pub(super) trial: Option<PointState>,
    /// What its trials cost.
    pub(super) cost_model: CostModel,
}

impl PointRecord {
    fn new(made_of: usize, committed: PointState) -> Self {
        Self { made_of, definition: made_of, committed, trial: None, cost_model: CostModel::default() }
    }

    /// Makes the trial, if there is one, the committed state.
    pub(super) fn commit(&mut self) {
        if let Some(trial) = self.trial.take() {
            self.committed = trial;
        }
    }
}

/// All Gauss points and the definitions they are made of.
#[derive(Debug)]
pub(super) struct PointTable {
    pub(super) definitions: Vec<(DefinitionId, Definition)>,
    /// For each definition, the group of workers that solves it.
    pub(super) groups: Vec<usize>,
    pub(super) records: Vec<PointRecord>,
    /// Definitions and committed states to which the points may be returned, by point; empty before [`PointTable::mark`].
    marked: Vec<(usize, PointState)>,
}

impl PointTable {
    /// `made_of[p]` is the index of point p's definition, `groups[d]` the group of workers that solves definition d.
    pub(super) fn new(definitions: Vec<Definition>, groups: Vec<usize>, made_of: &[usize]) -> Self {
        let initial = PointState::initial();
        let records = made_of
            .iter()
            .map(|&definition| {
                assert!(definition < definitions.len(), "every point names one of the definitions given");
                PointRecord::new(definition, initial.clone())
            })
            .collect();
        Self {
            definitions: definitions.into_iter().map(|one| (one.id(), one)).collect(),
            groups,
            records,
            marked: Vec::new(),
        }
    }

    /// Adds points in the initial state of a definition and returns the number of the first.
    pub(super) fn add(&mut self, definition: usize, count: usize) -> PointId {
        assert!(definition < self.definitions.len(), "every point names one of the definitions given");
        let first = self.records.len();
        let record = PointRecord::new(definition, PointState::initial());
        self.records.resize(first + count, record);
        first
    }

    /// Makes every trial the committed state.
    pub(super) fn commit(&mut self) {
        self.records.iter_mut().for_each(PointRecord::commit);
    }

    /// Forgets all trials.
    pub(super) fn rollback(&mut self) {
        for record in &mut self.records {
            record.trial = None;
        }
    }

    /// Remembers the committed states of all points.
    pub(super) fn mark(&mut self) {
        self.marked = self.records.iter().map(|record| (record.definition, record.committed.clone())).collect();
    }

    /// Makes the remembered states the committed ones and forgets all trials.
    pub(super) fn return_to_mark(&mut self) {
        for (record, (definition, state)) in self.records.iter_mut().zip(&self.marked) {
            record.definition = *definition;
            record.committed.clone_from(state);
            record.trial = None;
        }
    }

    /// Gives a point the cell and the committed state of another one, and what is known of the cost of its trials.
    pub(super) fn copy(&mut self, from: PointId, to: PointId) {
        let PointRecord { definition, ref committed, cost_model, .. } = self.records[from];
        let committed = committed.clone();
        let record = &mut self.records[to];
        (record.definition, record.committed, record.trial, record.cost_model) =
            (definition, committed, None, cost_model);
    }

    /// Lowest point made of this definition.
    pub(super) fn first_point_of(&self, definition: DefinitionId) -> Option<PointId> {
        self.records.iter().position(|record| self.definitions[record.definition].0 == definition)
    }
}
