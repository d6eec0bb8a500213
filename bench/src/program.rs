//! The program of this repository as its users start it: whole runs of scenes, with their times and curves.

use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Clock ticks per second in the process files of Linux.
const TICKS: f64 = 100.0;

/// Time that a command took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cost {
    /// From start to end, s.
    pub(crate) wall: f64,
    /// Processor time of the command and of all processes that it waited for, s.
    pub(crate) processor: f64,
}

/// Runs a command to its end, with its output in `log`.
///
/// # Errors
/// It cannot be started, or does not end with 0; the error has the last lines of its output.
pub(crate) fn timed(command: &mut Command, log: &Path) -> anyhow::Result<Cost> {
    let file = fs::File::create(log).with_context(|| format!("making {}", log.display()))?;
    let errors = file.try_clone()?;
    let before = children_seconds()?;
    let begin = Instant::now();
    let status = command.stdin(Stdio::null()).stdout(file).stderr(errors).status();
    let status = status.with_context(|| format!("starting {}", command.get_program().display()))?;
    let cost = Cost { wall: begin.elapsed().as_secs_f64(), processor: children_seconds()? - before };
    if !status.success() {
        let said = fs::read_to_string(log).unwrap_or_default();
        let last: Vec<&str> = said.lines().rev().take(5).collect();
        let last: Vec<&str> = last.into_iter().rev().collect();
        bail!("{} ended with {status}: {}", command.get_program().display(), last.join(" / "));
    }
    Ok(cost)
}

/// Processor time of the children that have ended, s.
fn children_seconds() -> anyhow::Result<f64> {
    let stat = fs::read_to_string("/proc/self/stat").context("processor times of this process")?;
    // Fields 16 and 17; the name in field 2 may hold blanks, so they are counted from its bracket.
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|text| text.parse::<f64>().ok());
    let (user, system) = ticks(13).zip(ticks(14)).context("an unknown form of /proc/self/stat")?;
    Ok((user + system) / TICKS)
}

/// A run that has ended.
#[derive(Clone, Debug)]
pub(crate) struct ProgramRun {
    /// Start of the program to its end, workers included.
    pub(crate) cost: Cost,
    /// `summary.json`.
    pub(crate) summary: serde_json::Value,
    /// Columns of `history.csv` that hold numbers.
    columns: BTreeMap<String, Vec<f64>>,
}

impl ProgramRun {
    /// A column of `history.csv`; entries that are not numbers are NaN.
    ///
    /// # Errors
    /// There is none of that name.
    pub(crate) fn column(&self, name: &str) -> anyhow::Result<&[f64]> {
        self.columns.get(name).map(Vec::as_slice).with_context(|| format!("history.csv has no column {name}"))
    }
}

/// The program next to this one.
///
/// # Errors
/// It has not been built.
pub(crate) fn program() -> anyhow::Result<PathBuf> {
    let path = std::env::current_exe().context("the path of this program is unknown")?.with_file_name("grainspan");
    if !path.is_file() {
        bail!("{} is missing: build it with `cargo build --release --workspace`", path.display());
    }
    Ok(path)
}

/// Workers of a run, whatever the cores: other programs are measured with as many processes, and figures of several machines compare.
pub(crate) const WORKERS: usize = 2;

/// Runs a scene with some `--set KEY=VALUE` and [`WORKERS`] workers, into `folder`, whose content it replaces.
///
/// # Errors
/// The run fails or leaves no results.
pub(crate) fn run_scene(scene: &Path, settings: &[String], folder: &Path) -> anyhow::Result<ProgramRun> {
    let mut command = run_command(&program()?, scene, settings, folder);
    let cost = timed(&mut command, &folder.with_extension("log"))?;
    let (summary, history) = results(folder)?;
    let numbers = |rows: Vec<String>| rows.iter().map(|entry| entry.parse().unwrap_or(f64::NAN)).collect();
    let columns = history.into_iter().map(|(head, rows)| (head, numbers(rows))).collect();
    Ok(ProgramRun { cost, summary, columns })
}

/// What a run has left in its folder: `summary.json`, and the columns of `history.csv` in their order, as they are written.
///
/// # Errors
/// One of the two is missing or damaged.
fn results(folder: &Path) -> anyhow::Result<(serde_json::Value, Vec<(String, Vec<String>)>)> {
    let summary = fs::read(folder.join("summary.json")).context("the summary of the run")?;
    let mut reader = csv::Reader::from_path(folder.join("history.csv")).context("the history of the run")?;
    let mut columns: Vec<(String, Vec<String>)> =
        reader.headers()?.iter().map(|head| (head.to_owned(), Vec::new())).collect();
    for record in reader.records() {
        for ((_, rows), entry) in columns.iter_mut().zip(&record?) {
            rows.push(entry.to_owned());
        }
    }
    Ok((serde_json::from_slice(&summary)?, columns))
}

/// A run that has ended, well or not.
#[derive(Clone, Debug)]
pub(crate) struct EndedRun {
    /// Exit code: 0, or 1 where a step did not converge.
    pub(crate) code: i32,
    /// `summary.json`.
    pub(crate) summary: serde_json::Value,
    /// Columns of `history.csv` in their order, as they are written.
    pub(crate) columns: Vec<(String, Vec<String>)>,
}

impl EndedRun {
    /// Steps in its history.
    pub(crate) fn steps(&self) -> usize {
        self.columns.first().map_or(0, |(_, rows)| rows.len())
    }
}

/// A scene that is refused before its first step.
#[derive(Clone, Debug, thiserror::Error)]
#[error("the scene is refused: {0}")]
pub(crate) struct Refusal(String);

/// Runs a scene as [`run_scene`] does, and takes a step that did not converge for an end too.
///
/// # Errors
/// A [`Refusal`], another end of the run, or no results.
pub(crate) fn run_to_its_end(scene: &Path, settings: &[&str], folder: &Path) -> anyhow::Result<EndedRun> {
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let output = run_command(&program()?, scene, &settings, folder).stdin(Stdio::null()).output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    let code = match output.status.code() {
        Some(code @ (0 | 1)) => code,
        Some(2) => return Err(Refusal(said.trim().to_owned()).into()),
        _ => bail!("the run ended with {}: {said}", output.status),
    };
    let (summary, columns) = results(folder)?;
    Ok(EndedRun { code, summary, columns })
}

fn run_command(program: &Path, scene: &Path, settings: &[String], folder: &Path) -> Command {
    let mut command = Command::new(program);
    command.arg("run").arg(scene).arg("--out").arg(folder).args(["--workers", &WORKERS.to_string()]);
    command.args(settings.iter().flat_map(|setting| ["--set", setting]));
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run has one worker per core unless it is told: it was compared with two processes of another code.
    #[test]
    fn a_scene_runs_with_two_workers_on_any_machine() {
        let settings = ["rve.error=1e-2".to_owned(), "loading.increments=1".to_owned()];
        let command = run_command(Path::new("grainspan"), Path::new("a.toml"), &settings, Path::new("out"));
        let words: Vec<&str> = command.get_args().map(|word| word.to_str().unwrap()).collect();
        let expected = "run a.toml --out out --workers 2 --set rve.error=1e-2 --set loading.increments=1"
            .split(' ')
            .collect::<Vec<_>>();
        assert_eq!(words, expected);
    }

    #[test]
    fn processor_time_of_a_command_is_counted_and_a_failure_is_quoted() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log");
        let busy = "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done";
        let cost = timed(Command::new("sh").args(["-c", busy]), &log).unwrap();
        assert!(cost.processor > 0.0 && cost.processor < cost.wall + 0.1, "{cost:?}");
        let failed = timed(Command::new("sh").args(["-c", "echo it broke; exit 3"]), &log).unwrap_err();
        assert!(failed.to_string().contains("it broke"), "{failed}");
    }
}
