//! `grainspan watch`: the page of a run, live, from a web server on this machine.

use super::run::counters::{Concern, concern, in_words};
use crate::exit::{Exit, Failure};
use crate::stdout::print;
use crate::workers::run_that_writes_to;
use page::{Program, RunFolder, Server, ServerSettings};
use std::path::PathBuf;

/// Port that is tried first.
const PORT: u16 = 8642;

/// Arguments of `grainspan watch`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan watch out/biaxial
  grainspan watch out/biaxial --port 9000

The server listens on this machine only. To look at a run on another one, forward the port and open the same address:
  ssh -L 8642:127.0.0.1:8642 OTHER

Ctrl-C ends the server; the run goes on. `grainspan report` writes the same page into one file.")]
pub(crate) struct Arguments {
    /// Output folder of a run, live or finished
    folder: PathBuf,
    /// Port on 127.0.0.1 [default: 8642, or a free one if it is taken]
    #[arg(long, value_name = "PORT")]
    port: Option<u16>,
}

/// Serves the page until it is interrupted.
///
/// # Errors
/// The folder is no run's output, or the port is taken.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let bad = |error| Failure::new(Exit::BadInput, error);
    let folder = RunFolder::open(&arguments.folder).map_err(bad)?;
    let settings = ServerSettings { port: arguments.port.unwrap_or(PORT), any_if_taken: arguments.port.is_none() };
    let server = Server::bind(folder, program(), settings).map_err(bad)?;
    let port = server.port();
    let text = format!(
        "{}\nfrom another machine: ssh -L {port}:127.0.0.1:{port} THIS_MACHINE, then the same address\nCtrl-C ends the server; a \
         run goes on\n",
        server.address()
    );
    print(text.as_bytes())?;
    server.run();
    Ok(Exit::Done)
}

/// What the page learns from the program.
pub(super) fn program() -> Program {
    Program {
        live: |folder| run_that_writes_to(folder).and_then(|progress| serde_json::to_value(progress).ok()),
        counter: |name, count| (in_words(name, count), concern(name) == Concern::LookAtThis),
    }
}
