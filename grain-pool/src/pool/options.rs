//! How a pool is opened.

use protocol::transport::shared_memory::Waiting;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// How a pool is opened. Nothing of it changes a result.
#[derive(Clone, Debug)]
pub struct PoolOptions {
    /// The program `grainspan`, which the workers run.
    pub program: PathBuf,
    /// Number of workers, at least 1.
    pub workers: usize,
    /// How both ends wait for messages.
    pub waiting: Waiting,
}

impl PoolOptions {
    /// One worker per core that run this program.
    pub fn new(program: impl Into<PathBuf>) -> Self {
        let workers = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        Self { program: program.into(), workers, waiting: Waiting::default() }
    }
}
