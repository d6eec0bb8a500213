//! Why a table of a definition was refused, and the checks of its numbers.

use schemars::JsonSchema;
use serde::Serialize;
use thiserror::Error;

/// Why a table was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct DefinitionError(pub String);

/// Checks the numbers of a table against the ranges that its keys declare; `name` is that of the table.
///
/// # Errors
/// The first number that is out of range or not finite.
pub(crate) fn in_declared_ranges<T: Serialize + JsonSchema>(table: &T, name: &str) -> Result<(), DefinitionError> {
    keys::check_settings(table, &[name]).map_err(|fault| DefinitionError(fault.to_string()))
}
