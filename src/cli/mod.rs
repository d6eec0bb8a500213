//! The command line: all commands, and how each of them ends.

mod agent;
mod bench;
mod cell_files;
mod check;
mod clean;
mod commit;
mod comparison;
mod completions;
mod ctl;
mod earlier_files;
mod estimate;
mod explain;
mod failure_case;
mod force_distribution;
mod glossary;
mod pack;
mod report;
mod reproduce;
mod run;
mod rve_server;
mod rve_test;
mod seconds;
mod specimen;
mod start_state;
mod status;
mod study;
mod sweep;
mod verification;
mod waiting_progress;
mod watch;

use crate::stderr::tell;
use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  grainspan check scenes/biaxial.toml                validate a scene without running it
  grainspan run scenes/biaxial.toml                  run it on all cores, into out/biaxial
  grainspan run scenes/biaxial.toml --workers 2 --set loading.increments=80
  grainspan watch out/biaxial                        look at it in a browser meanwhile
  grainspan pack packings/discs-400.toml --out packing.json
  grainspan element scenes/rve-biaxial.toml --out curve.csv   one packing along a path

Exit codes: 0 done; 1 did not converge; 2 bad input; 3 workers lost; 130 interrupted.";

/// FEM x DEM multiscale simulation: finite elements whose material law is a packing of grains, solved by a pool of
/// worker processes.
#[derive(Debug, Parser)]
#[command(name = "grainspan", version, after_help = EXAMPLES)]
pub(crate) struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scene on a pool of worker processes
    Run(run::Arguments),
    /// Take one packing along a strain/stress path, without finite elements
    #[command(visible_alias = "rve-test")]
    Element(rve_test::Arguments),
    /// Prepare a packing of grains and report its quality
    Pack(pack::Arguments),
    /// Take ensembles of packings along paths: mean, scatter, and how it falls with the number of grains
    Study(study::Arguments),
    /// Run single-scale grain dynamics of a whole specimen
    Specimen(specimen::Arguments),
    /// Validate everything a run would need; run nothing
    Check(check::Arguments),
    /// Serve a run as one of its workers
    RveServer(rve_server::Arguments),
    /// Serve a run on another host with the workers of this one
    Agent(agent::Arguments),
    /// Show live runs, their progress and their workers
    Status(status::Arguments),
    /// Remove the remains of dead runs
    Clean(clean::Arguments),
    /// Make the published figures of the three papers, with their numbers over ours
    Reproduce(reproduce::Arguments),
    /// Show the page of a run in a browser, live or afterwards
    Watch(watch::Arguments),
    /// Pause, resume, save or stop a live run between two steps
    Ctl(ctl::Arguments),
    /// Write the page of a run into one HTML file
    Report(report::Arguments),
    /// Measure the cost of this program on this machine (runs `grainspan-bench`)
    Bench(bench::Arguments),
    /// Explain the keys of input files
    Explain(explain::Arguments),
    /// Print a completion script for a shell
    Completions(completions::Arguments),
    /// Write the generated pages of the verification into a copy of the repository
    #[command(hide = true)]
    Verification(verification::Arguments),
    /// Complete a key of `--set`, for the completion scripts
    #[command(hide = true)]
    CompleteKey(explain::CompleteArguments),
}

/// Carries out a command line, whose first entry is the name of the program, and returns the exit code. Errors are printed; a
/// command line that cannot be read, or asks for help, ends the process.
pub fn run_command_line(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let ended = match CommandLine::parse_from(arguments).command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Element(arguments) => rve_test::run(&arguments),
        Command::Pack(arguments) => pack::run(&arguments),
        Command::Study(arguments) => study::run(&arguments),
        Command::Specimen(arguments) => specimen::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::RveServer(arguments) => rve_server::run(&arguments),
        Command::Agent(arguments) => agent::run(&arguments),
        Command::Status(arguments) => status::run(&arguments),
        Command::Clean(arguments) => clean::run(&arguments),
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Watch(arguments) => watch::run(&arguments),
        Command::Ctl(arguments) => ctl::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Explain(arguments) => explain::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Verification(arguments) => verification::run(&arguments),
        Command::CompleteKey(arguments) => explain::complete(&arguments),
    };
    match ended {
        Ok(exit) => exit.code(),
        Err(failure) => {
            tell(format_args!("error: {failure}"));
            failure.exit.code()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// The help is wrapped at the width of the terminal: a longer command is torn apart, and cannot be copied.
    #[test]
    fn examples_fit_into_a_narrow_terminal() {
        let program = CommandLine::command();
        let mut checked = 0;
        for command in program.get_subcommands().chain([&program]) {
            let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            for line in text.lines().filter(|line| line.starts_with("  ")) {
                let is_command = line.contains("grainspan ") || line.trim_start().starts_with("--");
                // What stands behind a gap is a comment.
                let indent = line.len() - line.trim_start().len();
                let command_alone = line.trim_start().split("   ").next().unwrap_or_default();
                let width = indent + command_alone.chars().count();
                assert!(!is_command || width <= 80, "{}: {line}", command.get_name());
                checked += usize::from(is_command);
            }
        }
        assert!(checked > 30, "{checked}");
    }
}
