//! One cell in this process.

use crate::error::PoolError;
use crate::snapshot::{Snapshot, SnapshotError};
use macro_solver::pool::PointState;
use protocol::{DefinitionId, RveEngine, RveError, RveSolver, Tensor2, TrialOptions, TrialResult};
use rve_server::definition::AnyDefinition;
use rve_server::engine::GrainEngine;

/// One cell in this process, with a committed and at most one trial state. Its trials have the bits of those of an
/// [`RvePool`](crate::RvePool).
pub struct Rve {
    solver: Box<dyn RveSolver>,
    definition: DefinitionId,
    /// No trial has been committed and no state restored.
    is_initial: bool,
}

impl Rve {
    /// A cell in its initial state.
    ///
    /// # Errors
    /// [`PoolError::Refused`]: packing, law and options make no cell.
    pub fn new(cell: &AnyDefinition) -> Result<Self, PoolError> {
        let definition = cell.to_protocol();
        let solver = GrainEngine.create(&definition).map_err(refused)?;
        Ok(Self { solver, definition: definition.id(), is_initial: true })
    }

    /// Deforms the cell from its committed state by `target = F - I`; the committed state stays as it is.
    ///
    /// # Errors
    /// [`PoolError::Refused`]; there is no trial then.
    pub fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, PoolError> {
        self.solver.trial(target, options).map_err(refused)
    }

    /// Makes the trial the committed state.
    ///
    /// # Errors
    /// [`PoolError::NothingToCommit`].
    pub fn commit(&mut self) -> Result<(), PoolError> {
        self.solver.commit().map_err(|_| PoolError::NothingToCommit { place: 0 })?;
        self.is_initial = false;
        Ok(())
    }

    /// Drops the trial.
    pub fn rollback(&mut self) {
        self.solver.rollback();
    }

    /// The committed state.
    pub fn snapshot(&self) -> Snapshot {
        let mut bytes = Vec::new();
        if !self.is_initial {
            self.solver.snapshot(&mut bytes);
        }
        Snapshot { definition: self.definition, state: PointState::from_snapshot(bytes.into()) }
    }

    /// Replaces the committed state and drops the trial.
    ///
    /// # Errors
    /// [`PoolError::Snapshot`]; the committed state is unchanged.
    pub fn restore(&mut self, snapshot: &Snapshot, cell: &AnyDefinition) -> Result<(), PoolError> {
        let refuse = |reason: SnapshotError| PoolError::Snapshot { place: 0, reason };
        snapshot.fits(self.definition).map_err(refuse)?;
        if snapshot.state.bytes.is_empty() {
            *self = Self::new(cell)?;
            return Ok(());
        }
        self.solver.restore(&snapshot.state.bytes).map_err(|error| refuse(error.into()))?;
        self.is_initial = false;
        Ok(())
    }
}

fn refused(reason: RveError) -> PoolError {
    PoolError::Refused { point: 0, reason }
}
