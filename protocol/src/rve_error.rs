//! Why engines refuse.

use crate::trial::TrialOptions;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a trial or a definition was refused. The committed state is unchanged in every case.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
pub enum RveError {
    /// NaN or infinity in the target.
    #[error("the target deformation is not finite")]
    TargetNotFinite,
    /// `det F <= 0`.
    #[error("the target deformation turns the cell inside out: det F = {determinant:.6e}")]
    TargetInverted {
        /// Determinant of `F`.
        determinant: f64,
    },
    /// The target is farther than the engine accepts in one trial.
    #[error(
        "the target deformation |H| = {norm:.3e} exceeds the limit {limit:.3e} of one trial (`rve.largest_target`); use smaller steps"
    )]
    TargetTooLarge {
        /// Size of the target; an engine may leave pure rotation out of it.
        norm: f64,
        /// Limit of the engine.
        limit: f64,
    },
    /// The engine takes no step as large as this one, for a reason of its own.
    #[error("{0}; use smaller steps")]
    StepTooLarge(String),
    /// The solver produced NaN or infinity.
    #[error("the grain solver produced a non-finite value after {force_evaluations} force evaluations")]
    NotFinite {
        /// Force evaluations until then.
        force_evaluations: u64,
    },
    /// The step cap ended the solver before the grains were in equilibrium, and the options accept no result then.
    #[error(
        "the grains did not come to rest: strain {strain:.3e} of {target:.3e} applied in {increments} of {of} increments, \
         with a force ratio of {unbalanced:.2e} (tolerance {tolerance:.2e}) at the end of {force_evaluations} force evaluations; \
         use smaller steps, or raise the step cap: rve.max_steps, or rve.max_evaluations where it is given"
    )]
    NotEquilibrated {
        /// Largest component of the stretch that was applied.
        strain: f64,
        /// The same of the target.
        #[serde(rename = "asked")]
        target: f64,
        /// Increments of the ramp that were done.
        increments: u64,
        /// Increments of the whole ramp.
        of: u64,
        /// Value of the engine's equilibrium criterion when it gave up.
        unbalanced: f64,
        /// Value that it had to reach.
        tolerance: f64,
        /// Force evaluations spent.
        force_evaluations: u64,
    },
    /// The engine cannot deliver a requested result.
    #[error("{0} is not supported by this engine")]
    Unsupported(String),
    /// The definition does not describe a usable RVE.
    #[error("{0}")]
    Definition(String),
    /// A snapshot was refused.
    #[error("{0}")]
    Snapshot(String),
    /// No trial to commit.
    #[error("commit without a trial")]
    NothingToCommit,
    /// The engine broke down (a panic, an answer too large to send): a defect of the engine, not of the request.
    #[error("the engine broke down: {0}")]
    EngineFault(String),
}

impl RveError {
    /// What an engine that has one friction only says to a trial.
    ///
    /// # Errors
    /// [`RveError::Unsupported`] where the friction is to be reduced.
    pub fn refuse_reduced_friction(options: &TrialOptions) -> Result<(), Self> {
        match options.friction_reduction {
            0.0 => Ok(()),
            _ => Err(Self::Unsupported("friction that changes during the run".into())),
        }
    }

    /// Force evaluations spent before the refusal, as far as it says.
    pub fn force_evaluations(&self) -> u64 {
        match self {
            Self::NotFinite { force_evaluations } | Self::NotEquilibrated { force_evaluations, .. } => {
                *force_evaluations
            }
            Self::TargetNotFinite
            | Self::TargetInverted { .. }
            | Self::TargetTooLarge { .. }
            | Self::StepTooLarge(_)
            | Self::Unsupported(_)
            | Self::Definition(_)
            | Self::Snapshot(_)
            | Self::NothingToCommit
            | Self::EngineFault(_) => 0,
        }
    }
}
