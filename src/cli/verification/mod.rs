//! `grainspan verification`: the pages of the verification and of the published figures, and the tables of the papers' pages, from the
//! committed comparisons.

mod figure_tables;
mod measured;
mod pages;
mod rows;

use crate::cli::commit::commit_of;
use crate::exit::{Exit, Failure};
use crate::machine::Machine;
use crate::stderr::tell;
use macro_solver::output::write_atomically;
use std::path::{Path, PathBuf};

/// Arguments of the hidden command.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan verification --repository .   after new figures or studies
  grainspan verification --measured /tmp/measured
      after GRAINSPAN_MEASURED=/tmp/measured cargo test --release --workspace, in the same unchanged copy:
      rows bear its commit, and the date and processor of this command")]
pub(crate) struct Arguments {
    /// Copy of the repository whose pages are written
    #[arg(long, value_name = "DIR", default_value = ".")]
    repository: PathBuf,
    /// Take over what tests have written down in this folder (environment variable GRAINSPAN_MEASURED)
    #[arg(long, value_name = "DIR")]
    measured: Option<PathBuf>,
}

/// Writes the pages.
///
/// # Errors
/// A table is missing or cannot be read; a page cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let root = &arguments.repository;
    if let Some(folder) = &arguments.measured {
        let file = measured::table(root);
        write_atomically(&file, &measured::encoded(&taken_over(root, folder)?)?)?;
        tell(format_args!("written: {}", file.display()));
    }
    for (file, text) in made(root)? {
        write_atomically(&file, text.as_bytes())?;
        tell(format_args!("written: {}", file.display()));
    }
    Ok(Exit::Done)
}

/// The table of measured numbers with the records of a folder.
///
/// # Errors
/// They cannot be read, or there are none; an entry is not in the catalogue.
fn taken_over(root: &Path, folder: &Path) -> Result<Vec<measured::Measured>, Failure> {
    let mut records = claims::read(folder).map_err(|error| rows::unusable(folder, error))?;
    // Entries of examples, which the tests of claims themselves state.
    records.retain(|record| !record.entry.starts_with("X-"));
    if records.is_empty() {
        let problem = "there are no records\nhint: run the tests with GRAINSPAN_MEASURED set to the absolute path of this folder";
        return Err(rows::unusable(folder, problem));
    }
    let entries = rows::catalogue(root)?;
    if let Some(stray) = records.iter().find(|record| entries.iter().all(|entry| entry.id != record.entry)) {
        return Err(rows::unusable(folder, format!("{} is not in the catalogue ({})", stray.entry, stray.file)));
    }
    let machine = Machine::here();
    let commit = commit_of(root).unwrap_or_default();
    let occasion = measured::Occasion { date: machine.date, commit, processor: machine.processor };
    Ok(measured::updated(measured::read(root)?, &records, &entries, &occasion))
}

/// The pages and where they belong.
fn made(root: &Path) -> Result<Vec<(PathBuf, String)>, Failure> {
    let (entries, mut sources) = (rows::catalogue(root)?, rows::sources(root)?);
    let mut made = Vec::new();
    for page in figure_tables::PAGES {
        let file = root.join(page);
        let text = std::fs::read_to_string(&file).map_err(|error| rows::unusable(&file, error))?;
        let text = figure_tables::filled(&text, &sources).map_err(|problem| rows::unusable(&file, problem))?;
        made.push((file, text));
    }
    let papers = pages::papers(&sources);
    sources.extend(measured::read(root)?.iter().map(|row| row.source(&entries)));
    made.extend([
        (
            root.join("docs/reference/verification-results.md"),
            pages::verification(&entries, &sources, &rows::missed_in_lab_book(root)?),
        ),
        (root.join("docs/papers/comparison.md"), papers),
    ]);
    Ok(made)
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
