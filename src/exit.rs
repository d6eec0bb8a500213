//! How the program ends: five exit codes, one message.

use crate::stderr::tell;
use macro_solver::output::OutputError;
use scene_reader::InputError;
use std::fmt;
use std::process::ExitCode;

/// Exit codes, a contract with scripts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All is done.
    Done,
    /// A step or increment did not converge; everything up to the last accepted one is written.
    NotConverged,
    /// The input, or the place to write to, is not usable.
    BadInput,
    /// Workers were lost and could not be replaced.
    WorkersLost,
    /// A stop was requested by a person or the system.
    Interrupted,
}

impl Exit {
    /// The code that the shell sees.
    pub fn code(self) -> ExitCode {
        ExitCode::from(match self {
            Self::Done => 0,
            Self::NotConverged => 1,
            Self::BadInput => 2,
            Self::WorkersLost => 3,
            Self::Interrupted => 130,
        })
    }
}

/// Failure of a command: one message and the exit code.
#[derive(Debug)]
pub struct Failure {
    /// Exit code.
    pub exit: Exit,
    /// For people: what, where, and the remedy.
    pub message: String,
}

/// Tells people about old names and doubtful numbers in an input file.
pub(crate) fn warn(document: &scene_reader::Document) {
    document.warnings().iter().for_each(|warning| tell(format_args!("warning: {warning}")));
}

impl Failure {
    /// A failure with its exit code.
    pub fn new(exit: Exit, message: impl ToString) -> Self {
        Self { exit, message: message.to_string() }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Self::new(Exit::BadInput, error)
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        Self::new(Exit::BadInput, error)
    }
}
