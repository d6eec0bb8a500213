//! `grainspan completions SHELL`: a completion script on stdout.

use super::CommandLine;
use crate::exit::{Exit, Failure};
use crate::stdout::print;
use clap::CommandFactory;
use clap_complete::Shell;

/// Arguments of `grainspan completions`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Shell that the script is for
    shell: Shell,
}

/// Prints the script.
///
/// # Errors
/// Standard output cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut CommandLine::command(), "grainspan", &mut script);
    print(&script)?;
    Ok(Exit::Done)
}
