//! One binary that plays every role: macro solver, worker, and the tools around them.

mod cli;
mod engines;
mod scene;
mod workers;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
