//! `grainspan bench NAME`: the benchmarks are a program of their own, [`PROGRAM`]; this command runs it.

use crate::exit::{Exit, Failure};
use crate::stdout::print;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program of the benchmarks. It is looked for next to this program, then in PATH.
const PROGRAM: &str = "grainspan-bench";

/// What help there is without that program.
const HELP: &str = "Measure the cost of this program on this machine

Usage: grainspan bench NAME [OPTIONS]

The studies are those of the program `grainspan-bench`, which is neither next to this program nor in PATH. It is built from the sources with
`cargo build --release --package grainspan-bench`; packages do not have it. Then `grainspan bench --list` names the studies, and
`grainspan bench --help` the options.
";

/// Arguments of `grainspan bench`: those of the benchmarks, `--help` included.
#[derive(clap::Args, Debug)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Study and options; `grainspan bench --list` lists the studies, `grainspan bench --help` the options
    #[arg(value_name = "NAME", trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Becomes the program of the benchmarks, in the same process.
///
/// # Errors
/// Returns only if that program cannot be started.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let program = std::env::current_exe().ok().and_then(|own| neighbour(&own)).unwrap_or_else(|| PROGRAM.into());
    let error = Command::new(&program).args(&arguments.arguments).exec();
    let asks_for_help = arguments.arguments.iter().any(|argument| argument == "--help" || argument == "-h");
    if error.kind() == ErrorKind::NotFound && (asks_for_help || arguments.arguments.is_empty()) {
        print(HELP.as_bytes())?;
        return Ok(Exit::Done);
    }
    let text = if error.kind() == ErrorKind::NotFound {
        format!(
            "the benchmarks are the program `{PROGRAM}`, which is neither next to this program nor in PATH\nhint: build it with \
             `cargo build --release --package {PROGRAM}`; packages do not have it"
        )
    } else {
        format!("{} could not be started: {error}", program.display())
    };
    Err(Failure::new(Exit::BadInput, text))
}

/// The program of the benchmarks in the folder of another program.
fn neighbour(own: &Path) -> Option<PathBuf> {
    let path = own.parent()?.join(PROGRAM);
    path.is_file().then_some(path)
}
