//! `grainspan report`: the output folder of a run as one page that needs no other file.

mod columns;
mod contents;
mod page;
mod picture;

use crate::exit::{Exit, Failure};
use crate::stdout::print;
use contents::Contents;
use macro_solver::output::write_atomically;
use std::path::PathBuf;

/// Arguments of `grainspan report`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Examples:\n  grainspan report out/biaxial\n  grainspan report out/biaxial --out biaxial.html"
)]
pub(crate) struct Arguments {
    /// Output folder of a run, finished or not
    folder: PathBuf,
    /// The page [default: report.html in the folder]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Reads the folder and writes the page.
///
/// # Errors
/// The folder is no run's output, a file in it cannot be understood, or the page cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let contents = Contents::read(&arguments.folder)?;
    let place = arguments.out.clone().unwrap_or_else(|| arguments.folder.join("report.html"));
    let page = page::page(&contents).map_err(|error| Failure::new(Exit::BadInput, error))?;
    write_atomically(&place, page.as_bytes())?;
    print(format!("written to {}\n", place.display()).as_bytes())?;
    Ok(Exit::Done)
}
