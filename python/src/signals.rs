//! Waiting that Ctrl-C ends.

use crate::error::raised;
use grain_pool::PoolError;
use pyo3::prelude::*;

/// Does `work` without the interpreter. What it is given looks at Python's signals and is `false` after Ctrl-C; then the exception of
/// the signal handler is returned in place of the error.
///
/// # Errors
/// That of the work as an exception, or that of a signal handler.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&mut dyn FnMut() -> bool) -> Result<T, PoolError> + Send,
) -> PyResult<T> {
    let mut signal = None;
    let done = py.detach(|| {
        work(&mut || match Python::attach(|py| py.check_signals()) {
            Ok(()) => true,
            Err(exception) => {
                signal = Some(exception);
                false
            }
        })
    });
    match (signal, done) {
        (Some(exception), Err(_)) => Err(exception),
        (_, Ok(done)) => Ok(done),
        (None, Err(error)) => Err(raised(py, &error)),
    }
}
