//! Why a specimen test ends without a result.

use crate::definition::PackingError;
use crate::error::DefinitionError;
use thiserror::Error;

/// Why a specimen test was refused or stopped.
#[derive(Debug, Error)]
pub enum SpecimenError {
    /// The test file is not what it should be; names the key.
    #[error(transparent)]
    Test(#[from] DefinitionError),
    /// The packing does not suit the specimen.
    #[error(transparent)]
    Packing(#[from] PackingError),
    /// A state that belongs to another test or packing.
    #[error("the saved state does not fit this test and packing; start again without it")]
    Unfit,
    /// Velocities are no longer finite.
    #[error(
        "stage \"{stage}\": the motion went out of control at step {step}; lower motion.safety or the strain per step"
    )]
    Diverged {
        /// Name of the stage.
        stage: String,
        /// Step of the stage.
        step: u64,
    },
    /// Energy that was put in is neither stored nor booked as lost.
    #[error(
        "stage \"{stage}\": at step {step} {missing:.2e} J, {percent:.0} % of the energy turned over, are not accounted for: \
         the motion is not what the laws say; lower motion.safety or the strain per step"
    )]
    EnergyLost {
        /// Name of the stage.
        stage: String,
        /// Step of the stage.
        step: u64,
        /// Missing energy, J; negative if there is more than was put in.
        missing: f64,
        /// Its share of the energy turned over, %.
        percent: f64,
    },
}
