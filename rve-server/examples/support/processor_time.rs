//! Processor time of this thread: on a machine that does other work, wall time says little.

/// Seconds of processor time that this thread has had (Linux).
pub(crate) fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|first| first.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-9
}
