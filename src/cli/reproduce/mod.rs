//! `grainspan reproduce [NAME]`: the published figures of the three papers. One command runs what a figure needs, draws it with the
//! paper's numbers over ours, and writes the differences.

mod curve;
mod error;
mod field;
mod figure;
mod figures;
mod inputs;
mod journal;
mod prelude;
mod results;
mod runner;

use super::commit::commit_of;
use super::comparison::{comparison_csv, comparison_text};
use crate::exit::{Exit, Failure};
use crate::folder_lock::refuse_folder_of_a_run;
use crate::machine::Machine;
use crate::stderr::tell;
use crate::stdout::print;
use crate::workers::SignalWatch;
use error::ReproduceError;
use figure::{Figure, Outcome, Size};
use inputs::Inputs;
use macro_solver::output::write_atomically;
use macro_solver::pool::Interrupt;
use results::{Origin, Results};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Arguments of `grainspan reproduce`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan reproduce                           all figures with run times
  grainspan reproduce liu2018-friction --size small          minutes
  grainspan reproduce liu2018-friction --size paper --workers 8
  grainspan reproduce all --size small

Runs that an earlier call has finished are used again, and one that was interrupted is continued.")]
pub(crate) struct Arguments {
    /// Figure; `all` for every one of them; without it the list
    #[arg(value_name = "NAME")]
    name: Option<String>,
    /// List the figures
    #[arg(long, conflicts_with = "name")]
    list: bool,
    /// Size of the calculation: the same physics on two cores within minutes, or the parameters of the paper
    #[arg(long, value_enum, default_value_t = Size::Small)]
    size: Size,
    /// Folder for runs, pictures and tables [default: out/reproduce/NAME-SIZE]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Worker processes of each run [default: one per core]
    #[arg(long, value_name = "N")]
    workers: Option<NonZeroUsize>,
    /// Folder that holds `scenes` and `packings` [default: found from here and from the program]
    #[arg(long, value_name = "DIR")]
    inputs: Option<PathBuf>,
    /// Program that makes the runs, for example another build [default: this one]
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Run everything again, whatever earlier calls have left
    #[arg(long)]
    fresh: bool,
    /// Draw from what earlier calls have left; run nothing
    #[arg(long, conflicts_with = "fresh")]
    draw_only: bool,
}

/// Lists the figures, or makes one or all of them.
///
/// # Errors
/// No such figure, inputs that are not found, a run that failed, a place that cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let Some(name) = arguments.name.as_deref().filter(|_| !arguments.list) else {
        print(list().as_bytes())?;
        return Ok(Exit::Done);
    };
    let chosen = chosen(name)?;
    if chosen.len() > 1 && arguments.out.is_some() {
        let problem =
            "--out holds one figure; leave it out with `all`: every figure then has its folder in out/reproduce";
        return Err(Failure::new(Exit::BadInput, problem));
    }
    let inputs = Inputs::find(arguments.inputs.as_deref())?;
    let interrupt =
        SignalWatch::flag("the run under way ends in good order, and the same command goes on from there")?;
    let count = chosen.len();
    let mut failed: Option<Exit> = None;
    for figure in chosen {
        match make(figure, arguments, &inputs, &interrupt) {
            Ok(()) => {}
            // The others may still be made, and one figure alone says why it was not.
            Err(failure) if count > 1 && failure.exit != Exit::Interrupted => {
                tell(format_args!("{}: {}", figure.name, failure.message));
                failed.get_or_insert(failure.exit);
            }
            Err(failure) => return Err(failure),
        }
    }
    match failed {
        None => Ok(Exit::Done),
        Some(exit) => Err(Failure::new(exit, "not every figure could be made; see above")),
    }
}

/// What the generated pages need of a figure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Summary {
    /// Its name.
    pub(super) name: &'static str,
    /// Paper and figure.
    pub(super) source: &'static str,
    /// Entries of the verification catalogue, each with a part of the quantities that belong to it.
    pub(super) entries: &'static [(&'static str, &'static str)],
}

/// All figures, in the order of the list.
pub(super) fn summaries() -> Vec<Summary> {
    let summary = |figure: &&Figure| Summary { name: figure.name, source: figure.source, entries: figure.entries };
    figures::ALL.iter().map(summary).collect()
}

fn chosen(name: &str) -> Result<Vec<&'static Figure>, ReproduceError> {
    if name == "all" {
        return Ok(figures::ALL.to_vec());
    }
    figures::ALL
        .iter()
        .find(|figure| figure.name == name)
        .map(|figure| vec![*figure])
        .ok_or_else(|| ReproduceError::NoFigure(name.to_owned()))
}

/// All figures, a row each.
fn list() -> String {
    let mut text = format!("{:<26} {:<34} {:>8} {:>8}  {}\n", "name", "source", "small", "paper", "what it shows");
    for figure in figures::ALL {
        writeln!(
            text,
            "{:<26} {:<34} {:>8} {:>8}  {}",
            figure.name, figure.source, figure.run_time.0, figure.run_time.1, figure.shows
        )
        .expect("writing to a String cannot fail");
    }
    text.push_str(
        "\nRun times are estimates for two cores; `grainspan reproduce NAME --size small|paper` makes a figure.\n",
    );
    text
}

/// Runs what is missing, draws the figure and writes its tables.
fn make(figure: &Figure, arguments: &Arguments, inputs: &Inputs, interrupt: &Interrupt) -> Result<(), Failure> {
    let default = || Path::new("out/reproduce").join(format!("{}-{}", figure.name, arguments.size.keyword()));
    let out = arguments.out.clone().unwrap_or_else(default);
    refuse_folder_of_a_run("--out", &out)?;
    tell(format_args!("{}: {} ({})", figure.name, figure.shows, figure.source));
    let results = runner::run_all(figure, inputs, &out, arguments, interrupt)?;
    let outcome = (figure.evaluate)(&results, arguments.size)?;
    deliver(figure, arguments.size, inputs, &out, (&outcome, &results))?;
    print(comparison_text(&outcome.comparisons).as_bytes())?;
    for note in &outcome.notes {
        print(format!("note: {note}\n").as_bytes())?;
    }
    tell(format_args!("written to {}", out.display()));
    Ok(())
}

/// What a figure was made with.
#[derive(Serialize)]
struct Provenance<'a> {
    figure: &'a str,
    source: &'a str,
    size: &'a str,
    /// Of the evaluation of the runs and the pictures.
    commit_of_inputs: Option<String>,
    notes: &'a [String],
    machine: Machine,
    /// What each run was made with, which an earlier call may have done.
    runs: BTreeMap<&'a str, Option<&'a Origin>>,
}

fn deliver(
    figure: &Figure,
    size: Size,
    inputs: &Inputs,
    out: &Path,
    (outcome, results): (&Outcome, &Results),
) -> Result<(), Failure> {
    let file = |part: &str| {
        out.join(if part.is_empty() { format!("{}.svg", figure.name) } else { format!("{}-{part}.svg", figure.name) })
    };
    for (part, chart) in &outcome.charts {
        let text = chart.to_svg().map_err(ReproduceError::Chart)?;
        write_atomically(&file(part), text.as_bytes())?;
    }
    for (part, map) in &outcome.maps {
        write_atomically(&file(part), map.to_svg().as_bytes())?;
    }
    for (part, text) in &outcome.drawn {
        write_atomically(&file(part), text.as_bytes())?;
    }
    write_atomically(&out.join(format!("{}.csv", figure.name)), &comparison_csv(&outcome.comparisons)?)?;
    let provenance = Provenance {
        figure: figure.name,
        source: figure.source,
        size: size.keyword(),
        commit_of_inputs: commit_of(inputs.folder()),
        notes: &outcome.notes,
        machine: Machine::here(),
        runs: results.origins().collect(),
    };
    let text = serde_json::to_string_pretty(&provenance).map_err(|error| Failure::new(Exit::BadInput, error))?;
    Ok(write_atomically(&out.join(format!("{}.json", figure.name)), (text + "\n").as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::reproduce::figure::Command;
    use rve_server::programs::specimen::SpecimenTest;
    use scene_reader::{Document, Scene, read_element_test};

    #[test]
    fn figures_have_names_of_their_own_and_runs_whose_inputs_ship() {
        let inputs = Inputs::find(Some(Path::new(env!("CARGO_MANIFEST_DIR")))).unwrap();
        let mut names = std::collections::BTreeSet::new();
        for figure in figures::ALL {
            assert!(names.insert(figure.name), "two figures are called {}", figure.name);
            for size in [Size::Small, Size::Paper] {
                let runs = (figure.runs)(size);
                assert!(!runs.is_empty(), "{} runs nothing", figure.name);
                let mut of_runs = std::collections::BTreeSet::new();
                for run in runs {
                    assert!(inputs.file(run.input).is_file(), "{}: there is no {}", figure.name, run.input);
                    assert!(of_runs.insert(run.name.clone()), "{}: two runs are called {}", figure.name, run.name);
                }
            }
        }
    }

    /// A key that a scene no longer takes is found here, and not after hours of other figures.
    #[test]
    fn runs_of_figures_are_read_without_a_defect() {
        let inputs = Inputs::find(Some(Path::new(env!("CARGO_MANIFEST_DIR")))).unwrap();
        let mut read = std::collections::BTreeSet::new();
        for figure in figures::ALL {
            for run in [Size::Small, Size::Paper].into_iter().flat_map(|size| (figure.runs)(size)) {
                let is_new = read.insert((run.input, run.size, run.settings.clone()));
                if !is_new || matches!(run.command, Command::Refused(_)) {
                    continue;
                }
                let path = inputs.file(run.input);
                let document = || Document::read_in_size(&path, run.size, &run.settings);
                let defect = match run.command {
                    Command::Element(_) | Command::Contacts(_) => {
                        document().and_then(|document| read_element_test(&document).map(drop)).err()
                    }
                    Command::Specimen => {
                        document().and_then(|document| document.deserialize::<SpecimenTest>().map(drop)).err()
                    }
                    Command::Scene | Command::Stopping | Command::Refused(_) => {
                        Scene::load_in_size(&path, run.size, &run.settings).map(drop).err()
                    }
                };
                assert!(defect.is_none(), "{}, run {}: {}", figure.name, run.name, defect.unwrap());
            }
        }
    }

    #[test]
    fn a_name_that_no_figure_has_is_refused_with_the_remedy() {
        let problem = chosen("nothing").unwrap_err().to_string();
        assert!(problem.contains("nothing") && problem.contains("grainspan reproduce"), "{problem}");
        assert!(list().lines().count() > figures::ALL.len());
    }
}
