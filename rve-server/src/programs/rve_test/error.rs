//! Why an element test was refused or stopped.

use crate::definition::PackingError;
use protocol::RveError;
use thiserror::Error;

/// Why an element test was refused or stopped. Rows already delivered stay valid.
#[derive(Debug, Error)]
pub enum ElementError {
    /// The test file is not what it should be; names the key.
    #[error("{0}")]
    Test(String),
    /// The packing file cannot be used.
    #[error(transparent)]
    Packing(#[from] PackingError),
    /// The packing, contact law and options make no cell.
    #[error(transparent)]
    Definition(RveError),
    /// The cell refused or failed.
    #[error("increment {increment}: {reason}")]
    Cell {
        /// Row that was being computed.
        increment: u64,
        /// The cell's reason.
        reason: RveError,
    },
    /// It was asked to end.
    #[error("interrupted in increment {increment}")]
    Interrupted {
        /// Row that was being computed.
        increment: u64,
    },
    /// The prescribed stress asks for more deformation than a trial can have.
    #[error(
        "increment {increment}: the cell hardly resists on the way to its target stress, which its grains cannot carry or which lies too far \
         away for one trial ({}); use more increments, or prescribe the strain where the packing softens",
        largest_trial(reason)
    )]
    StressOutOfReach {
        /// Row that was being computed.
        increment: u64,
        /// Why the cell refused the first trial.
        reason: RveError,
    },
    /// The prescribed stress was not reached.
    #[error(
        "increment {increment}: sigma_{component} = {reached:.6e} Pa did not reach {target:.6e} Pa within {tolerance:.1e} Pa \
         in {iterations} iterations; {remedy}"
    )]
    StressNotReached {
        /// Row that was being computed.
        increment: u64,
        /// Component farthest from its target.
        component: &'static str,
        /// Value in the best iteration, Pa.
        reached: f64,
        /// Value wanted, Pa.
        target: f64,
        /// Largest difference allowed, Pa.
        tolerance: f64,
        /// Trials made.
        iterations: u32,
        /// What to do.
        remedy: &'static str,
    },
}

/// How far a trial may go, by why one was refused.
fn largest_trial(refused: &RveError) -> String {
    match refused {
        RveError::TargetTooLarge { limit, .. } => format!("of a strain of {limit:.1e} at most"),
        _ => "it would turn the cell inside out".to_owned(),
    }
}

/// Remedy of a stress that was not reached by a cell that bears load.
pub(super) const SMALLER_STEPS: &str = "use more increments, or prescribe the strain where the packing softens";

/// Remedy of a stress that was not reached by a cell without load-bearing contacts.
pub(super) const APART: &str = "the grains have come apart, no chain of contacts bears load: prescribe the strain, or prepare the packing under this contact law";

impl ElementError {
    /// Whether the input is to blame (exit code 2) and not the course of the test (exit code 1).
    pub fn is_bad_input(&self) -> bool {
        matches!(self, Self::Test(_) | Self::Packing(_) | Self::Definition(_))
    }
}
