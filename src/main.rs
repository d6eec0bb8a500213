//! One binary that plays every role: macro solver, worker, and the tools around them.

mod cli;
mod engines;
mod workers;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
