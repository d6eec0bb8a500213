//! `grainspan agent --join ENDPOINT`: the workers of this host for a run on another.

#[cfg(feature = "hosts")]
mod serve;

use crate::engines::BUILT_IN;
use crate::exit::{Exit, Failure};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// What a build for one host says to the commands and options of several.
#[cfg(not(feature = "hosts"))]
pub(crate) const WITHOUT_HOSTS: &str =
    "this program was built for one host\nhint: build it with `cargo build --release --features hosts`";

/// Arguments of `grainspan agent`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples, the run on host node1:
  node1$ grainspan run scenes/biaxial.toml --listen 0.0.0.0:7400 \\
      --out out/biaxial
  node2$ grainspan agent --join out/biaxial/join   the folder is on both hosts
  node2$ grainspan agent --join node1:7400 --secret ~/.grainspan-secret

For programs built with `--features hosts`, as the packages are.
Agents may join and leave while the run goes on; results stay bitwise identical.
Exit codes: 0 the run has ended; 2 refused, or bad input; 3 no run was found, or it was lost for too long; 130 stopped.")]
pub(crate) struct Arguments {
    /// Where the run is: ADDRESS:PORT, or the file `join` in its output folder
    #[arg(long, value_name = "ENDPOINT|FILE")]
    join: String,
    /// The secret of the run, in a file that only you may read
    #[arg(long, value_name = "FILE")]
    secret: Option<PathBuf>,
    /// Worker processes [default: one per core]
    #[arg(long, value_name = "N")]
    workers: Option<NonZeroUsize>,
    /// Engine of the workers: the built-in one, or one of the catalogue, see docs/guide/external-engines.md
    #[arg(long, value_name = "NAME", default_value = BUILT_IN)]
    engine: String,
    /// How long to look for the run, at the start and when it was lost
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, value_parser = crate::cli::seconds::seconds)]
    timeout: f64,
    /// Time without any sign of life of the run's host after which it counts as lost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = crate::cli::seconds::seconds)]
    silence: f64,
    /// States kept for the workers of this host, so that they need not travel twice
    #[arg(long, value_name = "MIB", default_value_t = 256)]
    keep_states: u32,
    /// Wait for ever for runs and serve one after the other
    #[arg(long, conflicts_with = "timeout")]
    standing: bool,
}

/// Serves until the run ends.
///
/// # Errors
/// No run is found, or it refuses this host.
#[cfg(feature = "hosts")]
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    serve::run(arguments)
}

/// Says that this program cannot.
///
/// # Errors
/// Always.
#[cfg(not(feature = "hosts"))]
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    tracing::debug!(?arguments, "not available");
    Err(Failure::new(Exit::BadInput, WITHOUT_HOSTS))
}
