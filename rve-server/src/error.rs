//! Why a table of a definition was refused, and the checks of its numbers.

use thiserror::Error;

/// Why a table was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct DefinitionError(pub String);

pub(crate) fn positive(key: &str, value: f64) -> Result<(), DefinitionError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(DefinitionError(format!("{key} = {value} must be a positive number")))
}

pub(crate) fn not_negative(key: &str, value: f64) -> Result<(), DefinitionError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(DefinitionError(format!("{key} = {value} must be zero or a positive number")))
}
