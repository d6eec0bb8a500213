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
const VERSION: u32 = 5;

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
    let (definitions, groups) = (&table.definitions, &table.groups);
    if record.points.len() != table.records.len() {
        return Err(unfit(format!("{} Gauss points instead of {}", record.points.len(), table.records.len())));
    }
    for (number, (entry, known)) in record.points.iter().zip(&mut table.records).enumerate() {
        let own = known.made_of;
        // A definition that two engines solve is there twice: only those of the point's own workers count.
        let is_it = |place: &usize| definitions[*place].0 == entry.definition && groups[*place] == groups[own];
        let place = std::iter::once(own).chain(0..definitions.len()).find(is_it);
        let (true, Some(definition)) = (entry.made_of == definitions[own].0, place) else {
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

#[cfg(test)]
mod tests {
    use super::super::points::PointTable;
    use super::super::settings::PoolSettings;
    use super::*;
    use protocol::Definition;
    use std::sync::Arc;

    /// Points 0 and 1 have the same grains and two engines; point 2 has others; point 3 is one that may follow them.
    fn coordinator() -> Coordinator {
        let definitions: Vec<Definition> =
            [1, 1, 2].map(|content| Definition { bytes: vec![content] }).into_iter().collect();
        let engines = ["one", "two", "one"].map(str::to_owned).to_vec();
        let settings = PoolSettings { engines, ..PoolSettings::default() };
        let groups = settings.groups(definitions.len());
        Coordinator::new(settings, PointTable::new(definitions, groups, &[0, 1, 2, 2]))
    }

    fn resumed(from: &Coordinator) -> Coordinator {
        let mut archive = Archive::new();
        save(from, PoolStatistics::default(), &mut archive);
        let mut coordinator = coordinator();
        restore(&mut coordinator, &archive).unwrap();
        coordinator
    }

    fn definitions(coordinator: &Coordinator) -> Vec<usize> {
        coordinator.points.records.iter().map(|record| record.definition).collect()
    }

    #[test]
    fn points_of_two_engines_with_the_same_grains_keep_their_engines() {
        assert_eq!(definitions(&resumed(&coordinator())), [0, 1, 2, 2]);
    }

    #[test]
    fn a_point_that_follows_another_goes_on_with_its_cell_and_returns_to_the_mark() {
        let mut first = coordinator();
        first.points.records[0].committed = PointState::from_snapshot(Arc::from([7, 7]));
        first.points.mark();
        first.points.copy(0, 3);
        assert_eq!(definitions(&first), [0, 1, 2, 0]);
        let resumed = resumed(&first);
        assert_eq!(definitions(&resumed), [0, 1, 2, 0]);
        assert_eq!(*resumed.points.records[3].committed.bytes, [7, 7]);
        first.points.return_to_mark();
        assert_eq!(definitions(&first), [0, 1, 2, 2]);
        assert!(first.points.records[3].committed.bytes.is_empty());
    }
}
