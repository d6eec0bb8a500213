//! Why an attempt at a step fails: what a smaller step may cure, and what ends the run.

use crate::material::MaterialError;
use crate::observer::Outcome;

/// Why an attempt ended without convergence.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A smaller step may help.
    Attempt(String),
    /// Nothing more can be done.
    Run(Outcome),
}

impl Failure {
    /// The end of the run where no smaller step can be tried.
    pub(crate) fn into_outcome(self) -> Outcome {
        match self {
            Self::Run(outcome) => outcome,
            Self::Attempt(reason) => Outcome::DidNotConverge { reason },
        }
    }
}

/// What a material's error means for the run.
pub(crate) fn failure(error: MaterialError) -> Failure {
    match error {
        MaterialError::Point { .. } if error.is_curable_by_smaller_step() => Failure::Attempt(error.to_string()),
        // What an engine does not do at all.
        MaterialError::Point { reason: protocol::RveError::Unsupported(_), .. } => {
            Failure::Run(Outcome::DefinitionRefused { reason: error.to_string() })
        }
        // Asking for less would only repeat it.
        MaterialError::Point { .. } => Failure::Run(Outcome::DidNotConverge { reason: error.to_string() }),
        MaterialError::Interrupted => Failure::Run(Outcome::Interrupted),
        MaterialError::DefinitionRefused(reason) => Failure::Run(Outcome::DefinitionRefused { reason }),
        MaterialError::WorkersLost(reason) | MaterialError::Channel(reason) => {
            Failure::Run(Outcome::WorkersLost { reason })
        }
    }
}
