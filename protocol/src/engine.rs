//! The contract of an RVE engine: what any grain solver, ours or foreign, must be able to do.
//!
//! A **trial is a pure function** of (committed state, target, options): it returns the same bits in any worker, and it
//! does not change the committed state. The whole project relies on this.

use crate::capabilities::Capabilities;
use crate::identity::{ContentId, DefinitionId};
use crate::rve_error::RveError;
use crate::tensor::Tensor2;
use crate::trial::{TrialOptions, TrialResult};
use serde::{Deserialize, Serialize};

/// Definition of an RVE: opaque to everyone but the engine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Definition {
    /// Engine-specific description (packing, contact law, options).
    #[serde(with = "serde_bytes")]
    pub bytes: Vec<u8>,
}

impl Definition {
    /// Its content identity.
    pub fn id(&self) -> ContentId {
        ContentId::of(&self.bytes)
    }
}

/// One RVE with a committed and at most one trial state.
pub trait RveSolver: Send {
    /// Deforms from the committed state by `target` (`H = F - I`, relative to the committed cell).
    ///
    /// Replaces an earlier trial state; the committed state stays as it is.
    ///
    /// # Errors
    /// See [`RveError`]; there is no trial state afterwards.
    fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, RveError>;

    /// Makes the trial state the committed state.
    ///
    /// # Errors
    /// [`RveError::NothingToCommit`] without a trial.
    fn commit(&mut self) -> Result<(), RveError>;

    /// Drops the trial state.
    fn rollback(&mut self);

    /// Writes the committed state as a sealed snapshot; `out` is overwritten.
    fn snapshot(&self, out: &mut Vec<u8>);

    /// Writes the trial state as a sealed snapshot; `out` is overwritten.
    ///
    /// # Errors
    /// [`RveError::NothingToCommit`] without a trial.
    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError>;

    /// Replaces the committed state; drops the trial state.
    ///
    /// # Errors
    /// [`RveError::Snapshot`] with the reason; the committed state is unchanged.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError>;

    /// Identity of everything besides the state that answers depend on. Solvers of one engine with equal identities answer requests for
    /// states of each other's definitions, so that cells that differ in their initial state only are solved together. `None`: the
    /// definition itself.
    fn model_identity(&self) -> Option<ContentId> {
        None
    }

    /// Solves several requests at once, each from a state of its own. Every result is what [`restore`](Self::restore),
    /// [`trial`](Self::trial) and [`snapshot_trial`](Self::snapshot_trial) would give for its request alone, to the
    /// bit; an engine that solves several cells at once overrides this to be faster. The committed state afterwards is
    /// not specified; there is no trial state.
    fn solve_batch(&mut self, requests: &[TrialRequest<'_>]) -> Vec<Result<(TrialResult, Vec<u8>), RveError>> {
        requests.iter().map(|request| solve_alone(self, request)).collect()
    }
}

/// A trial from a state of its own.
#[derive(Clone, Copy, Debug)]
pub struct TrialRequest<'a> {
    /// The definition that the state belongs to: that of the solver, or one with the same [`RveSolver::model_identity`].
    pub definition: DefinitionId,
    /// Sealed snapshot of the committed state.
    pub state: &'a [u8],
    /// The target, relative to the cell of that state.
    pub target: Tensor2,
    /// What to deliver.
    pub options: TrialOptions,
}

/// The result of one request with the sealed snapshot of the trial state.
///
/// # Errors
/// See [`RveError`].
pub fn solve_alone<T: RveSolver + ?Sized>(
    solver: &mut T,
    request: &TrialRequest<'_>,
) -> Result<(TrialResult, Vec<u8>), RveError> {
    solver.restore(request.state)?;
    let answer = solver.trial(&request.target, &request.options)?;
    let mut state = Vec::new();
    let written = solver.snapshot_trial(&mut state);
    solver.rollback();
    written.map(|()| (answer, state))
}

/// Builds RVEs from definitions.
pub trait RveEngine: Send {
    /// What this engine can do.
    fn capabilities(&self) -> Capabilities;

    /// Builds an RVE in its initial committed state.
    ///
    /// # Errors
    /// [`RveError::Definition`] with the reason.
    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError>;
}
