//! `grainspan clean`: removes what dead runs of this user left in shared memory.

use crate::exit::{Exit, Failure};
use crate::stdout::print;
use protocol::transport::shared_memory::RunDirectory;

/// Arguments of `grainspan clean`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Live runs are left alone. Output folders are never touched.")]
pub(crate) struct Arguments {}

/// Removes the remains of dead runs and lists them.
///
/// # Errors
/// The folder of runs cannot be read; standard output cannot be written.
pub(crate) fn run(_arguments: &Arguments) -> Result<Exit, Failure> {
    let removed = RunDirectory::clean().map_err(|error| Failure::new(Exit::BadInput, error))?;
    let text = match &removed[..] {
        [] => "Nothing to clean.\n".to_owned(),
        names => format!("Removed what was left of: {}.\n", names.join(", ")),
    };
    print(text.as_bytes())?;
    Ok(Exit::Done)
}
