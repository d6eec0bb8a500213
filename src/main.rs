//! The program `grainspan`; everything is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    grainspan::run_command_line(std::env::args_os())
}
