//! Where the finite elements get their stress from: the seam between the macro solver and the worker pool.
//!
//! The solution procedures see Gauss points only through [`PointMaterial`]. The worker pool implements it; so does a
//! closed-form elastic material that verifies elements without any grains.

#[cfg(test)]
pub(crate) mod altered;
#[cfg(test)]
pub(crate) mod damage;
pub mod difference;
pub mod elastic;
pub mod error_estimate;
pub mod frictional;
pub mod stress_level;
mod trial_states;

use crate::checkpoint::{Archive, CheckpointError};
use error_estimate::ErrorEstimate;
use protocol::{Tensor2, TrialOptions, TrialResult};
use thiserror::Error;

/// Number of a Gauss point, from 0: those of an element follow each other from its place in
/// [`Mesh::first_points`](crate::mesh::Mesh::first_points) on.
pub type PointId = usize;

/// One trial: the stress of this point if deformed by `target` from its committed state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointTrial {
    /// Gauss point.
    pub point: PointId,
    /// Total displacement gradient `H = F - I` from the committed configuration.
    pub target: Tensor2,
    /// Results wanted in addition to the stress.
    pub options: TrialOptions,
}

/// Why a point gave no answer.
#[derive(Debug, Error)]
pub enum MaterialError {
    /// The engine refused the target; a smaller step may help.
    #[error("Gauss point {point}: {reason}")]
    Point {
        /// Gauss point.
        point: PointId,
        /// Engine's reason.
        reason: protocol::RveError,
    },
    /// No workers are left and none can be started.
    #[error("{0}")]
    WorkersLost(String),
    /// A stop was requested (Ctrl-C).
    #[error("interrupted")]
    Interrupted,
    /// An engine cannot solve an RVE of the run.
    #[error("{0}")]
    DefinitionRefused(String),
    /// The channel to the workers failed.
    #[error("{0}")]
    Channel(String),
}

impl MaterialError {
    /// Whether a smaller load step could avoid it: the target was at fault, not the definition or the engine.
    pub fn is_curable_by_smaller_step(&self) -> bool {
        use protocol::RveError::{
            NotEquilibrated, NotFinite, StepTooLarge, TargetInverted, TargetNotFinite, TargetTooLarge,
        };
        let Self::Point { reason, .. } = self else { return false };
        matches!(
            reason,
            TargetNotFinite
                | TargetInverted { .. }
                | TargetTooLarge { .. }
                | StepTooLarge(_)
                | NotFinite { .. }
                | NotEquilibrated { .. }
        )
    }

    /// Force evaluations that a refused trial has taken, as far as it says.
    pub fn force_evaluations(&self) -> u64 {
        match self {
            Self::Point { reason, .. } => reason.force_evaluations(),
            Self::Interrupted | Self::DefinitionRefused(_) | Self::WorkersLost(_) | Self::Channel(_) => 0,
        }
    }

    /// Whether the grains of a point did not come to rest within their step cap.
    pub fn is_unfinished_trial(&self) -> bool {
        matches!(self, Self::Point { reason: protocol::RveError::NotEquilibrated { .. }, .. })
    }
}

/// A material law at every Gauss point, with committed and trial states.
pub trait PointMaterial {
    /// Solves all trials; results in their order. Every trial starts from its point's committed state; the latest trial
    /// of a point replaces its earlier ones.
    ///
    /// # Errors
    /// See [`MaterialError`]; committed states are unchanged. With several failing points the lowest is reported.
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError>;

    /// Makes the latest trial of every point its committed state. Points without a trial since the last commit keep
    /// their state.
    ///
    /// # Errors
    /// Only when the material has lost its trial states for good.
    fn commit(&mut self) -> Result<(), MaterialError>;

    /// Forgets all trials.
    fn rollback(&mut self);

    /// Remembers the committed states, in place of those that it remembered before.
    fn mark(&mut self);

    /// Makes the remembered states the committed ones again and forgets all trials. Counts of work stay.
    fn return_to_mark(&mut self);

    /// Gives a point the committed state of another one, with the cell that it belongs to, and forgets its trial. For points that follow
    /// Gauss points (see [`error_estimate`]); the next [`PointMaterial::return_to_mark`] undoes it.
    fn copy_state(&mut self, from: PointId, to: PointId);

    /// Estimated error of the committed stresses, of a material that estimates it.
    fn error_estimate(&self) -> Option<ErrorEstimate> {
        None
    }

    /// Puts the committed states, and everything else that can influence a later bit or is counted, into sections of its own. Nothing for a
    /// material without states.
    fn save(&self, _archive: &mut Archive) {}

    /// Takes up the committed states that were saved.
    ///
    /// # Errors
    /// The section is missing, of another version, or does not fit; the run must not start then.
    fn restore(&mut self, _archive: &Archive) -> Result<(), CheckpointError> {
        Ok(())
    }
}
