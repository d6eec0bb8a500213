//! `grainspan study STUDY.toml`: ensembles of packings, seeds x sizes x recipes, each along the paths of some element tests. Mean and
//! scatter of chosen quantities, and how the scatter falls with the number of grains.

mod curve;
mod ensemble;
mod expected;
mod mean_curves;
mod pictures;
mod statistics;
mod tables;

use super::commit::commit_of;
use super::comparison::{comparison_csv, comparison_text};
use crate::exit::{Exit, Failure};
use crate::folder_lock::{lock_folder, refuse_folder_of_a_run};
use crate::machine::Machine;
use crate::side_by_side::cores;
use crate::stderr::tell;
use crate::stdout::print;
use crate::workers::SignalWatch;
use ensemble::{Remark, Results, Subject};
use macro_solver::output::{OutputError, write_atomically};
use scene_reader::{Document, Kind, Study, read_study};
use serde::Serialize;
use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Arguments of `grainspan study`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan study scenes/studies/cell-size.toml   over the number of grains
  grainspan study scenes/studies/cell-size.toml --size small
  grainspan study scenes/studies/critical-state.toml --jobs 2 --out out/critical
  grainspan study scenes/studies/cell-size.toml --set seeds=32 \\
      --set grains=[50,100,200,400,800]

Files in the output folder, NAME being that of the study:
  NAME.csv             numbers of the study against those that its file expects
  NAME-statistics.csv  samples, failed samples, mean, standard deviation of every quantity, recipe, test and size
  NAME-powers.csv      the power of the number of grains in the standard deviation, with its interval of 95 % confidence
  NAME-curves.csv      mean curves: every measure over the strain, with the standard deviation of the samples
  NAME-samples.csv     the value of every sample, and why one is missing
  NAME-*.svg, NAME.json pictures; failed samples by name, machine, date and commit

Tables and pictures have the same bytes for any number of jobs. Exit code 1: samples failed; all files are written. The
first Ctrl-C ends a study with the packings that have ended (exit code 130), a second one, half a second later or more, at
once.")]
pub(crate) struct Arguments {
    /// Study: recipes, sizes, seeds, element tests and quantities; see docs/guide/ensembles.md
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// Folder for tables and pictures [default: out/study/NAME, with --size out/study/NAME-SIZE]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// One of the sizes that the file names in `[sizes]` [default: the file as it stands]
    #[arg(long, value_name = "NAME")]
    size: Option<String>,
    /// Override a key of the study
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Packings that are made and tested at the same time [default: one per core]
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Print nothing on standard error but warnings and errors
    #[arg(long)]
    quiet: bool,
}

/// Makes the samples, and writes tables and pictures.
///
/// # Errors
/// A study that is not sound (exit code 2, nothing is written); samples that failed (exit code 1, everything is written); a stop that
/// was requested (exit code 130, with what had ended).
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let document = Document::read_in_size(&arguments.study, arguments.size.as_deref(), &arguments.overrides)?;
    crate::exit::warn(&document);
    document.expect(Kind::Study)?;
    let study = read_study(&document)?;
    ensemble::check(&study)?;
    let out = arguments.out.clone().unwrap_or_else(|| default_folder(&study.name, arguments.size.as_deref()));
    refuse_folder_of_a_run("--out", &out)?;
    std::fs::create_dir_all(&out).map_err(|source| OutputError::write(&out, source))?;
    let _lock = lock_folder(&out, "--out", "study", "wait for its end, or name another folder")?;
    let total = ensemble::places(&study).len();
    let interrupt = SignalWatch::flag("packings that have ended are written")?;
    let keep_going = || !interrupt.is_raised();
    let results = ensemble::run(&study, arguments.jobs.unwrap_or_else(cores), &keep_going, &|done, sample| {
        if !arguments.quiet {
            let place = sample.place;
            let recipe = &study.recipes[place.recipe].name;
            tell(format_args!("{done} of {total}: {recipe}, {} grains, seed {}", place.grains, place.seed));
        }
    });
    let remarks = results.remarks();
    tell_one_of_each_kind(&remarks, arguments.quiet);
    let failures = results.failures();
    if interrupt.is_raised() && results.samples.iter().all(|sample| sample.paths.is_err()) {
        let text = format!("interrupted before a packing had ended; {} is as it was", out.display());
        return Err(Failure::new(Exit::Interrupted, text));
    }
    deliver(&results, &failures, &remarks, arguments, &out)?;
    if !arguments.quiet {
        tell(format_args!("written to {}", out.display()));
    }
    let exit = if interrupt.is_raised() { Exit::Interrupted } else { Exit::NotConverged };
    match failures.is_empty() {
        true => Ok(Exit::Done),
        false => Err(Failure::new(
            exit,
            format!(
                "{} of {total} samples have no value of a quantity, or a path that stopped early; they are counted as failed:\n{}",
                failed_samples(&results),
                failures.join("\n")
            ),
        )),
    }
}

/// Tells the first remark of each kind, and how many there are; all of them stand in the study's JSON file.
fn tell_one_of_each_kind(remarks: &[Remark], quiet: bool) {
    for subject in Subject::ALL {
        let label = if subject == Subject::FirstSegment { "note" } else { "warning" };
        let mut of_kind = remarks.iter().filter(|remark| remark.subject == subject);
        let Some(first) = of_kind.next().filter(|_| !(quiet && label == "note")) else { continue };
        let others = match of_kind.count() {
            0 => String::new(),
            count => format!(" ({count} more of this kind)"),
        };
        tell(format_args!("{label}: {}{others}", first.text));
    }
}

/// A quick look in a small size leaves the tables of the whole study as they are.
fn default_folder(name: &str, size: Option<&str>) -> PathBuf {
    Path::new("out/study").join(size.map_or_else(|| name.to_owned(), |size| format!("{name}-{size}")))
}

/// Number of packings that are named among the failures.
fn failed_samples(results: &Results<'_>) -> usize {
    let fails = |sample: &&ensemble::Sample| match &sample.paths {
        Err(_) => true,
        Ok(paths) => paths.iter().enumerate().any(|(test, path)| {
            let missing = |quantity| results.value(sample, test, quantity).is_err();
            path.stopped.is_some() || (0..results.study.quantities.len()).any(missing)
        }),
    };
    results.samples.iter().filter(fails).count()
}

/// What a study was made with, and what its tables leave out.
#[derive(Serialize)]
struct Provenance<'a> {
    study: &'a str,
    /// The arguments that repeat it.
    command: String,
    /// Entries of the verification catalogue, each with its rows of the comparison.
    entries: BTreeMap<String, Vec<String>>,
    samples: usize,
    failed_samples: usize,
    failures: &'a [String],
    /// Warnings about packings, and remarks on the starts of their paths.
    remarks: Vec<&'a str>,
    /// Rows of all paths with a shortcut or a degradation.
    fallbacks: Vec<Fallback>,
    commit_of_inputs: Option<String>,
    /// Tables and pictures beside this file: the next study of the name removes those that it does not write again.
    files: Vec<String>,
    machine: Machine,
}

#[derive(Serialize)]
struct Fallback {
    what: &'static str,
    rows: u64,
    paths: usize,
}

fn deliver(
    results: &Results<'_>,
    failures: &[String],
    remarks: &[Remark],
    arguments: &Arguments,
    out: &Path,
) -> Result<(), Failure> {
    let study: &Study = results.study;
    let provenance_file = out.join(format!("{}.json", study.name));
    remove_earlier(&provenance_file)?;
    let mut files = Vec::new();
    let mut write = |part: &str, bytes: &[u8]| {
        files.push(format!("{}{part}", study.name));
        write_atomically(&out.join(&files[files.len() - 1]), bytes)
    };
    write("-samples.csv", &tables::samples_csv(results)?)?;
    write("-statistics.csv", &tables::statistics_csv(results)?)?;
    write("-curves.csv", &tables::curves_csv(results)?)?;
    if study.sizes().len() > 1 {
        write("-powers.csv", &tables::powers_csv(results)?)?;
    }
    let (compared, entries) = expected::compared(results);
    if !compared.is_empty() {
        write(".csv", &comparison_csv(&compared)?)?;
    }
    for (part, chart) in pictures::charts(results) {
        match chart.to_svg() {
            Ok(svg) => write(&format!("-{part}.svg"), svg.as_bytes())?,
            // Without one good sample there is nothing to draw; the tables say so.
            Err(error) => tell(format_args!("warning: no picture {}-{part}.svg: {error}", study.name)),
        }
    }
    let fallbacks: Vec<Fallback> =
        results.fallbacks().into_iter().map(|(what, rows, paths)| Fallback { what, rows, paths }).collect();
    print(tables::text(results).as_bytes())?;
    if !compared.is_empty() {
        print(format!("\n{}", comparison_text(&compared)).as_bytes())?;
    }
    for Fallback { what, rows, paths } in &fallbacks {
        print(format!("{what}: {rows} rows of {paths} paths\n").as_bytes())?;
    }
    let folder = arguments.study.parent().filter(|folder| !folder.as_os_str().is_empty());
    let provenance = Provenance {
        study: &study.name,
        command: command(arguments),
        entries,
        samples: results.samples.len(),
        failed_samples: failed_samples(results),
        failures,
        remarks: remarks.iter().map(|remark| remark.text.as_str()).collect(),
        fallbacks,
        commit_of_inputs: commit_of(folder.unwrap_or(Path::new("."))),
        files,
        machine: Machine::here(),
    };
    let text = serde_json::to_string_pretty(&provenance).map_err(|error| Failure::new(Exit::BadInput, error))?;
    Ok(write_atomically(&provenance_file, (text + "\n").as_bytes())?)
}

/// Takes away what an earlier study of this name has left, as its own file lists it: this one may not write all of it again.
fn remove_earlier(provenance: &Path) -> Result<(), Failure> {
    let refused = |reason: &dyn std::fmt::Display| {
        let text = format!(
            "{} of an earlier study cannot be read ({reason}), so that its figures are not known: remove it, or give another --out",
            provenance.display()
        );
        Failure::new(Exit::BadInput, text)
    };
    let earlier: serde_json::Value = match std::fs::read(provenance) {
        Ok(text) => serde_json::from_slice(&text).map_err(|error| refused(&error))?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(refused(&error)),
    };
    for name in earlier["files"].as_array().into_iter().flatten().filter_map(serde_json::Value::as_str) {
        // A name alone: never a file of another folder.
        let Some(name) = Path::new(name).file_name() else { continue };
        let path = provenance.with_file_name(name);
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(OutputError::write(&path, source).into());
            }
            _ => {}
        }
    }
    Ok(())
}

/// The command that repeats the study, without the folder of its output and the number of jobs, which change nothing.
fn command(arguments: &Arguments) -> String {
    let mut text = format!("grainspan study {}", arguments.study.display());
    if let Some(size) = &arguments.size {
        text += &format!(" --size {size}");
    }
    for setting in &arguments.overrides {
        text += &format!(" --set {setting}");
    }
    text
}

#[cfg(test)]
mod tests;
