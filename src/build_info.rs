//! What this program was built with, for summaries and measurements.

use grain_pool::processes::RUNNING_PROGRAM;
use std::path::{Path, PathBuf};

/// Version of the package.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The compiler's own version line; `unknown` if it could not be started.
pub const COMPILER: &str = env!("GRAINSPAN_COMPILER");

/// Optimisation level: `0` to `3`, `s` or `z`.
pub const OPTIMISATION: &str = env!("GRAINSPAN_OPTIMISATION");

/// Additional code generation flags, separated by spaces.
pub const FLAGS: &str = env!("GRAINSPAN_FLAGS");

/// The file that this process executes. The system's own link to it also leads there when another build has taken its place on the disk, so
/// that a run goes on starting workers of its own build.
pub(crate) fn running_program() -> PathBuf {
    let image = Path::new(RUNNING_PROGRAM);
    if image.exists() { image.to_owned() } else { std::env::current_exe().unwrap_or_else(|_| "grainspan".into()) }
}

/// Version and content of this executable: only the same one promises the same bits.
pub(crate) fn this_program() -> String {
    let content = std::fs::File::open(running_program())
        .and_then(protocol::ContentId::of_reader)
        .map_or("unknown".to_owned(), |content| content.to_string());
    format!("grainspan {} {content}", VERSION)
}
