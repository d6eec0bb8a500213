//! Why a page cannot be made.

use thiserror::Error;

/// Why a page cannot be made or served; for people, with the remedy.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct PageError(pub String);
