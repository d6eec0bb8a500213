//! `grainspan verification`: the pages of the verification and of the published figures, from the committed comparisons.

mod pages;
mod rows;

use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use macro_solver::output::write_atomically;
use std::path::{Path, PathBuf};

/// Arguments of the hidden command.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example, after new figures or studies were committed:
  grainspan verification --repository .")]
pub(crate) struct Arguments {
    /// Copy of the repository whose pages are written
    #[arg(long, value_name = "DIR", default_value = ".")]
    repository: PathBuf,
}

/// Writes the pages.
///
/// # Errors
/// A table is missing or cannot be read; a page cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    for (file, text) in made(&arguments.repository)? {
        write_atomically(&file, text.as_bytes())?;
        tell(format_args!("written: {}", file.display()));
    }
    Ok(Exit::Done)
}

/// The pages and where they belong.
fn made(root: &Path) -> Result<[(PathBuf, String); 2], Failure> {
    let (entries, sources) = (rows::catalogue(root)?, rows::sources(root)?);
    Ok([
        (
            root.join("docs/reference/verification-results.md"),
            pages::verification(&entries, &sources, &rows::missed_in_lab_book(root)?),
        ),
        (root.join("docs/papers/comparison.md"), pages::papers(&sources)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With `WRITE_REFERENCE=1` this test writes the pages.
    #[test]
    fn the_committed_pages_are_what_the_tables_say() {
        for (file, text) in made(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap() {
            if std::env::var_os("WRITE_REFERENCE").is_some() {
                std::fs::write(&file, &text).unwrap();
            }
            let written = std::fs::read_to_string(&file).unwrap_or_default();
            assert!(written == text, "{} is not up to date: write it with `grainspan verification`", file.display());
        }
    }

    #[test]
    fn every_row_that_a_figure_gives_an_entry_has_one_in_the_catalogue() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let (entries, sources) = (rows::catalogue(root).unwrap(), rows::sources(root).unwrap());
        for figure in crate::cli::reproduce::summaries() {
            let source = sources
                .iter()
                .find(|source| source.command.contains(&format!("reproduce {} ", figure.name)))
                .unwrap();
            for (id, part) in figure.entries {
                assert!(entries.iter().any(|entry| entry.id == *id), "{}: {id}", figure.name);
                assert!(
                    source.rows.iter().any(|row| row.quantity.contains(part)),
                    "{}: no row has '{part}'",
                    figure.name
                );
            }
        }
    }
}
