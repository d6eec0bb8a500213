//! What the pool saves: the committed state of every point, and its counts.

use super::coordinator::Desk;
use super::cost_model::Forecast;
use super::points::PointState;
use super::statistics::PoolStatistics;
use crate::checkpoint::{Archive, CheckpointError};
use protocol::{DefinitionId, StateId};
use serde::{Deserialize, Serialize};

const SECTION: &str = "pool";

/// Counts changes of [`Record`].
const VERSION: u32 = 2;

#[derive(Serialize, Deserialize)]
struct Record {
    points: Vec<PointEntry>,
    statistics: PoolStatistics,
}

#[derive(Serialize, Deserialize)]
struct PointEntry {
    definition: DefinitionId,
    state: StateId,
    forecast: Forecast,
}

/// Saves committed states; trials are not part of a checkpoint.
pub(super) fn save(desk: &Desk, archive: &mut Archive) {
    let table = &desk.points;
    let mut points = Vec::with_capacity(table.records.len());
    for record in &table.records {
        let definition = table.definitions[record.definition].0;
        if record.committed.id != StateId::NONE {
            archive.keep_snapshot(record.committed.id, &record.committed.bytes);
        }
        points.push(PointEntry { definition, state: record.committed.id, forecast: record.forecast });
    }
    archive.put(SECTION, VERSION, &Record { points, statistics: desk.statistics.clone() });
}

/// Restores committed states. Workers that have joined meanwhile stay, and are counted on top.
pub(super) fn restore(desk: &mut Desk, archive: &Archive) -> Result<(), CheckpointError> {
    let record: Record = archive.get(SECTION, VERSION)?;
    let unfit = |reason: String| CheckpointError::unfit(SECTION, reason);
    let table = &mut desk.points;
    if record.points.len() != table.records.len() {
        return Err(unfit(format!("{} Gauss points instead of {}", record.points.len(), table.records.len())));
    }
    for (number, (entry, known)) in record.points.iter().zip(&mut table.records).enumerate() {
        if entry.definition != table.definitions[known.definition].0 {
            return Err(unfit(format!("Gauss point {number} was made of other grains")));
        }
        known.committed = match entry.state {
            StateId::NONE => PointState::initial(),
            state => PointState::from_snapshot(
                archive
                    .snapshot(state)
                    .ok_or_else(|| unfit(format!("the state of Gauss point {number} is missing")))?,
            ),
        };
        known.trial = None;
        known.forecast = entry.forecast;
    }
    let now = std::mem::replace(&mut desk.statistics, record.statistics);
    let earlier = desk.statistics.workers.len();
    desk.roster.renumber(|tally| tally + earlier);
    desk.statistics.workers_joined += now.workers_joined;
    desk.statistics.workers_refused += now.workers_refused;
    desk.statistics.refused_messages += now.refused_messages;
    desk.statistics.workers.extend(now.workers);
    Ok(())
}
