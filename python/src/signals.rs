//! Waiting that Ctrl-C ends.

use crate::error::raised;
use grain_pool::PoolError;
use pyo3::prelude::*;

/// Does `work` without the interpreter. What it is given looks at Python's signals and is `false` after Ctrl-C; then the exception of
/// the signal handler is returned in place of the error, and of the result if the work was done by then: Python does not raise it again.
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
    match signal {
        Some(exception) => {
            // A pool that has been opened meanwhile closes, which waits for its workers.
            py.detach(|| drop(done));
            Err(exception)
        }
        None => done.map_err(|error| raised(py, &error)),
    }
}
