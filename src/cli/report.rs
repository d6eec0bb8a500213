//! `grainspan report`: the output folder of a run as one page that needs no other file.

use super::watch::program;
use crate::exit::{Exit, Failure};
use crate::stderr::tell;
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
    if let Some(defect) = defect_of(&arguments.folder.join("summary.json")) {
        tell(format_args!("note: {defect}; the page does without it"));
    }
    write_atomically(&place, page::report(&folder, &program()).as_bytes())?;
    print(format!("written to {}\n", place.display()).as_bytes())?;
    Ok(Exit::Done)
}

/// Why a file that is there cannot be read as JSON.
fn defect_of(file: &Path) -> Option<String> {
    let bytes = std::fs::read(file).ok()?;
    let error = serde_json::from_slice::<serde::de::IgnoredAny>(&bytes).err()?;
    Some(format!("{} cannot be read: {error}", file.display()))
}

/// The files in a folder.
fn files_of(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::defect_of;

    #[test]
    fn a_summary_that_ends_early_is_named() {
        let place = tempfile::tempdir().unwrap();
        let summary = place.path().join("summary.json");
        assert_eq!(defect_of(&summary), None);
        std::fs::write(&summary, "{\"status\": \"converged\"}").unwrap();
        assert_eq!(defect_of(&summary), None);
        std::fs::write(&summary, "{\"status\": ").unwrap();
        assert!(defect_of(&summary).unwrap().contains("summary.json cannot be read: EOF"));
    }
}
