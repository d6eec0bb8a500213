//! What can go wrong when a figure is made.

use crate::exit::{Exit, Failure};
use std::path::PathBuf;

/// Why a figure could not be made.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReproduceError {
    /// There is no such figure.
    #[error("there is no figure '{0}'; `grainspan reproduce` lists them")]
    NoFigure(String),
    /// Scenes and packings were not found.
    #[error("no folder with scenes/ and packings/ was found in {0}; name it with --inputs DIR")]
    NoInputs(String),
    /// A program could not be started.
    #[error("could not start {program}: {source}")]
    Start {
        /// Its file.
        program: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A run ended before its end.
    #[error("the run '{name}' ended with exit code {code}; its folder is {folder}")]
    Run {
        /// Name of the run.
        name: String,
        /// Exit code; a dash for a signal.
        code: String,
        /// Where its output lies.
        folder: PathBuf,
    },
    /// A run that is needed has not been made.
    #[error("there is no finished run in {0}; leave --draw-only out")]
    Missing(PathBuf),
    /// A file of a run cannot be used.
    #[error("{file}: {problem}")]
    Unusable {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A quantity cannot be found in the curves of a run.
    #[error("{0}")]
    NotFound(String),
    /// The picture could not be drawn.
    #[error(transparent)]
    Chart(#[from] charts::ChartError),
}

impl From<ReproduceError> for Failure {
    fn from(error: ReproduceError) -> Self {
        let exit = match &error {
            ReproduceError::Run { code, .. } if code == "130" => Exit::Interrupted,
            ReproduceError::Run { code, .. } if code == "3" => Exit::WorkersLost,
            ReproduceError::Run { code, .. } if code == "1" => Exit::NotConverged,
            _ => Exit::BadInput,
        };
        Self::new(exit, error)
    }
}
