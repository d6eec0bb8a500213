//! The program `grainspan`; everything is in the library.

use std::process::ExitCode;

/// Every tangent takes and frees a few megabytes. The allocator of the system gives them back each time, and the pages are then cleared
/// and mapped anew: a fifth of a worker's time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    grainspan::run_command_line(std::env::args_os())
}
