//! `grainspan report`: the output folder of a run as one page that needs no other file.

use super::watch::program;
use crate::exit::{Exit, Failure};
use crate::stdout::{expect_place, print};
use macro_solver::output::write_atomically;
use page::RunFolder;
use std::path::{Path, PathBuf};

/// Arguments of `grainspan report`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Examples:\n  grainspan report out/biaxial\n  grainspan report out/biaxial --out biaxial.html\n\n`grainspan watch` shows \
                  the same page while a run goes on."
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
/// The folder is no run's output, or the page cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let folder = RunFolder::open(&arguments.folder).map_err(|error| Failure::new(Exit::BadInput, error))?;
    let place = arguments.out.clone().unwrap_or_else(|| arguments.folder.join("report.html"));
    let inputs: Vec<PathBuf> =
        files_of(&arguments.folder).filter(|path| path.file_name() != Some("report.html".as_ref())).collect();
    expect_place(Some(&place), &inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    write_atomically(&place, page::report(&folder, &program()).as_bytes())?;
    print(format!("written to {}\n", place.display()).as_bytes())?;
    Ok(Exit::Done)
}

/// The files in a folder.
fn files_of(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.is_file())
}
