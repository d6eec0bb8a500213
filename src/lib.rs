//! The glue of the program `grainspan`: command line, worker processes, engines. Both binaries use it: `grainspan` itself and
//! the benchmarks (`bench/`), which start workers of their own and end with the same exit codes.

pub mod build_info;
mod cli;
mod engines;
pub mod exit;
mod folder_lock;
pub mod machine;
mod side_by_side;
pub mod stderr;
pub mod stdout;
mod workers;

pub use cli::run_command_line;
