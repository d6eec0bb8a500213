//! The clock of the microbenchmarks.

/// Processor time of this thread, s; NaN if the system does not report it. Wall time says little on a machine that does other work.
pub(super) fn processor_time() -> f64 {
    crate::workers::measured_processor_seconds("thread-self").unwrap_or(f64::NAN)
}
