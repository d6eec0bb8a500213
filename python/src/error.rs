//! Errors of the pool as the exceptions of `grainspan.errors`.

use grain_pool::PoolError;
use pyo3::prelude::*;

/// The exception for an error. If the package cannot be imported, that is the exception.
pub(crate) fn raised(py: Python<'_>, error: &PoolError) -> PyErr {
    let class = match error {
        PoolError::Refused { .. } => "TrialRefused",
        PoolError::WorkersLost(_) | PoolError::Channel(_) => "WorkersLost",
        PoolError::Interrupted => "Interrupted",
        PoolError::Closed | PoolError::OtherProcess { .. } => "PoolClosed",
        PoolError::NothingToCommit { .. } => "NothingToCommit",
        PoolError::Input(_)
        | PoolError::ForeignState { .. }
        | PoolError::NoSuchCell { .. }
        | PoolError::Arguments(_)
        | PoolError::Snapshot { .. }
        | PoolError::Element(_) => "InputError",
        PoolError::NoProgram(_) | PoolError::Start { .. } => "StartError",
    };
    let message = error.to_string();
    let made = py.import("grainspan.errors").and_then(|module| {
        let class = module.getattr(class)?;
        match error {
            PoolError::Refused { point, .. } => class.call1((message, *point, error.is_curable_by_smaller_step())),
            _ => class.call1((message,)),
        }
    });
    match made {
        Ok(exception) => PyErr::from_value(exception),
        Err(failure) => failure,
    }
}
