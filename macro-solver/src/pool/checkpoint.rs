//! What the pool saves: the committed state of every point, and its counts.

use super::coordinator::Coordinator;
use super::cost_model::CostModel;
use super::points::PointState;
use super::statistics::PoolStatistics;
use crate::checkpoint::{Archive, CheckpointError};
use protocol::{DefinitionId, StateId};
use serde::{Deserialize, Serialize};

const SECTION: &str = "pool";

/// Counts changes of [`Record`], and of the name that seals the snapshots of the built-in engine.
const VERSION: u32 = 4;

#[derive(Serialize, Deserialize)]
struct Record {
    points: Vec<PointEntry>,
    statistics: PoolStatistics,
}

#[derive(Serialize, Deserialize)]
struct PointEntry {
    made_of: DefinitionId,
    definition: DefinitionId,
    state: StateId,
    cost_model: CostModel,
}

/// Saves committed states and the counts of the pool; trials are not part of a checkpoint.
pub(super) fn save(coordinator: &Coordinator, statistics: PoolStatistics, archive: &mut Archive) {
    let table = &coordinator.points;
    let mut points = Vec::with_capacity(table.records.len());
    for record in &table.records {
        let id = |definition: usize| table.definitions[definition].0;
        if record.committed.id != StateId::NONE {
            archive.keep_snapshot(record.committed.id, &record.committed.bytes);
        }
        points.push(PointEntry {
            made_of: id(record.made_of),
            definition: id(record.definition),
            state: record.committed.id,
            cost_model: record.cost_model,
        });
    }
    archive.put(SECTION, VERSION, &Record { points, statistics });
}

/// Restores committed states. Workers that have joined meanwhile stay; they, and what has happened to them, are counted on top.
pub(super) fn restore(coordinator: &mut Coordinator, archive: &Archive) -> Result<(), CheckpointError> {
    let record: Record = archive.get(SECTION, VERSION)?;
    let unfit = |reason: String| CheckpointError::unfit(SECTION, reason);
    let table = &mut coordinator.points;
    if record.points.len() != table.records.len() {
        return Err(unfit(format!("{} Gauss points instead of {}", record.points.len(), table.records.len())));
    }
    for (number, (entry, known)) in record.points.iter().zip(&mut table.records).enumerate() {
        let place = table.definitions.iter().position(|(id, _)| *id == entry.definition);
        let (true, Some(definition)) = (entry.made_of == table.definitions[known.made_of].0, place) else {
            return Err(unfit(format!("Gauss point {number} was made of other grains")));
        };
        known.definition = definition;
        known.committed = match entry.state {
            StateId::NONE => PointState::initial(),
            state => PointState::from_snapshot(
                archive
                    .snapshot(state)
                    .ok_or_else(|| unfit(format!("the state of Gauss point {number} is missing")))?,
            ),
        };
        known.trial = None;
        known.cost_model = entry.cost_model;
    }
    let now = std::mem::replace(&mut coordinator.statistics, record.statistics);
    let earlier = coordinator.statistics.workers.len();
    coordinator.workers.renumber(|tally| tally + earlier);
    coordinator.statistics.add_workers(now);
    Ok(())
}
