//! What this program was built with, for summaries and measurements.

/// Version of the package.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The compiler's own version line; `unknown` if it could not be started.
pub const COMPILER: &str = env!("GRAINSPAN_COMPILER");

/// Optimisation level: `0` to `3`, `s` or `z`.
pub const OPTIMISATION: &str = env!("GRAINSPAN_OPTIMISATION");

/// Additional code generation flags, separated by spaces.
pub const FLAGS: &str = env!("GRAINSPAN_FLAGS");

/// Version and content of this executable: only the same one promises the same bits.
pub(crate) fn this_program() -> String {
    let content = std::env::current_exe()
        .and_then(std::fs::File::open)
        .and_then(protocol::ContentId::of_reader)
        .map_or("unknown".to_owned(), |content| content.to_string());
    format!("grainspan {} {content}", VERSION)
}
