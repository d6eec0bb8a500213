//! `grainspan status [RUN]`: live runs of this user, their progress and their workers.

use crate::exit::{Exit, Failure};
use crate::stdout::print;
use crate::workers::{RunProgress, WorkerProcess, workers_of};
use macro_solver::pool::WorkerReport;
use page::{Controls, PAUSED};
use protocol::transport::shared_memory::{RunDirectory, RunListing};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::{SystemTime, UNIX_EPOCH};

/// Workers that are shown line by line unless one run is requested.
const MOST_LINES: usize = 16;

/// Arguments of `grainspan status`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example:\n  grainspan status\n  grainspan status biaxial-4711-5f3c")]
pub(crate) struct Arguments {
    /// Show this run only, with every worker
    #[arg(value_name = "RUN")]
    run: Option<String>,
}

/// Prints one paragraph per live run.
///
/// # Errors
/// The requested run is not alive; standard output cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let listed = RunDirectory::list().map_err(|error| Failure::new(Exit::BadInput, error))?;
    let wanted = |listing: &RunListing| arguments.run.as_ref().is_none_or(|run| *run == listing.name);
    let (alive, dead): (Vec<_>, Vec<_>) = listed.into_iter().filter(wanted).partition(|listing| listing.alive);
    if let (Some(run), true) = (&arguments.run, alive.is_empty()) {
        return Err(Failure::new(
            Exit::BadInput,
            format!("no run named '{run}' is alive; `grainspan status` lists those that are"),
        ));
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let mut text = String::new();
    for listing in &alive {
        let progress = listing.record.as_ref().and_then(RunProgress::of);
        let reports = progress.as_ref().map_or(&[][..], |progress| &progress.workers);
        let known: Vec<u32> = reports.iter().map(|report| report.pid).collect();
        let workers = workers_of(&listing.name, &known);
        let pid = listing.record.as_ref().map(|record| record.pid);
        let most_lines = if arguments.run.is_some() { usize::MAX } else { MOST_LINES };
        text.push_str(&paragraph(&listing.name, pid, progress.as_ref(), &workers, most_lines, now));
    }
    if alive.is_empty() {
        text.push_str("No run is alive.\n");
    }
    if !dead.is_empty() {
        let names: Vec<_> = dead.iter().map(|listing| listing.name.as_str()).collect();
        writeln!(text, "Ended without cleaning up: {}; `grainspan clean` removes their remains.", names.join(", "))
            .expect("writing to a String cannot fail");
    }
    print(text.as_bytes())?;
    Ok(Exit::Done)
}

/// One run for people; `now` in s since 1970. More workers than `most_lines` are summarised.
fn paragraph(
    name: &str,
    pid: Option<u32>,
    progress: Option<&RunProgress>,
    workers: &[WorkerProcess],
    most_lines: usize,
    now: u64,
) -> String {
    let mut text = format!("{name}\n");
    let mut line = |label: &str, value: String| {
        writeln!(text, "  {label:<9} {value}").expect("writing to a String cannot fail");
    };
    let is_paused = progress.is_some_and(|known| Controls::of(&known.output).has(PAUSED));
    let process = pid.map_or_else(|| "starting".to_owned(), |pid| pid.to_string());
    match progress {
        Some(known) => {
            line("scene", known.scene.display().to_string());
            line("output", known.output.display().to_string());
            if is_paused {
                line("paused", format!("`grainspan ctl {} resume` lets it go on", known.output.display()));
            }
            line("process", format!("{process}, for {}", duration(now.saturating_sub(known.begun))));
            let percent = 100.0 * known.load;
            let (step, evaluations) = (known.step, known.evaluations);
            line("progress", format!("{percent:.1} % of the load, step {step}, {evaluations} evaluations"));
        }
        None => line("process", process),
    }
    let mut reports = progress.map_or_else(Vec::new, |known| known.workers.clone());
    if is_paused {
        // The last reports are those of the step before, whose jobs are done.
        reports.iter_mut().for_each(|report| report.point = None);
    }
    if workers.len() > most_lines {
        line("workers", totals(workers, &reports));
    } else {
        for worker in workers {
            let used = duration(worker.ticks / WorkerProcess::TICKS_PER_SECOND);
            let unknown = if is_paused { "" } else { ", has not joined" };
            let done = report_of(worker, &reports).map_or(unknown.to_owned(), work);
            line("worker", format!("{}, {}, {used} of processor time{done}", worker.pid, state(worker)));
        }
    }
    if workers.is_empty() {
        line("worker", "none".to_owned());
    }
    text
}

/// Many workers in one line: states, processor time, completed jobs, and the longest current job.
fn totals(workers: &[WorkerProcess], reports: &[WorkerReport]) -> String {
    let mut states: BTreeMap<&str, usize> = BTreeMap::new();
    workers.iter().for_each(|worker| *states.entry(state(worker)).or_default() += 1);
    let mut parts: Vec<String> = states.into_iter().map(|(state, count)| format!("{count} {state}")).collect();
    let joined: Vec<&WorkerReport> = workers.iter().filter_map(|worker| report_of(worker, reports)).collect();
    if joined.len() < workers.len() {
        parts.push(format!("{} have not joined", workers.len() - joined.len()));
    }
    let ticks: u64 = workers.iter().map(|worker| worker.ticks).sum();
    parts.push(format!("{} of processor time", duration(ticks / WorkerProcess::TICKS_PER_SECOND)));
    let jobs: u64 = joined.iter().map(|report| report.jobs).sum();
    parts.push(format!("{jobs} jobs"));
    let at_work = joined.iter().filter_map(|report| Some((report.since_s, report.pid, report.point?)));
    if let Some((seconds, pid, point)) = at_work.max_by(|one, other| one.0.total_cmp(&other.0)) {
        parts.push(format!("longest current job: {pid}, Gauss point {point} for {seconds:.1} s"));
    }
    format!("{}: {}", workers.len(), parts.join(", "))
}

fn report_of<'a>(worker: &WorkerProcess, reports: &'a [WorkerReport]) -> Option<&'a WorkerReport> {
    reports.iter().find(|report| report.pid == worker.pid)
}

/// The kernel's letter of a state in words.
fn state(worker: &WorkerProcess) -> &'static str {
    match worker.state {
        'R' => "computing",
        'S' | 'D' => "waiting",
        'T' | 't' => "stopped",
        _ => "ending",
    }
}

/// Completed jobs of a worker and its current one.
fn work(report: &WorkerReport) -> String {
    let doing = match report.point {
        Some(point) => format!(", Gauss point {point} for {:.1} s", report.since_s),
        None => String::new(),
    };
    format!(", {} jobs in {:.1} s{doing}", report.jobs, report.busy_s)
}

/// Hours, minutes and seconds.
fn duration(seconds: u64) -> String {
    format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_described_with_its_workers() {
        let progress = RunProgress {
            begun: 1000,
            scene: "a.toml".into(),
            output: "out/a".into(),
            step: 3,
            load: 0.125,
            evaluations: 42,
            time: BTreeMap::new(),
            fallbacks: BTreeMap::new(),
            workers: vec![WorkerReport { pid: 8, jobs: 5, busy_s: 1.5, point: Some(3), ..WorkerReport::default() }],
        };
        let worker = |pid| WorkerProcess { pid, state: 'T', ticks: 6200 };
        let expected = "a-1\n  scene     a.toml\n  output    out/a\n  process   7, for 1:01:05\n  progress  12.5 % of the \
                        load, step 3, 42 evaluations\n  worker    8, stopped, 0:01:02 of processor time, 5 jobs in 1.5 s, Gauss \
                        point 3 for 0.0 s\n  worker    9, stopped, 0:01:02 of processor time, has not joined\n";
        assert_eq!(paragraph("a-1", Some(7), Some(&progress), &[worker(8), worker(9)], 2, 4665), expected);
        assert_eq!(paragraph("b", None, None, &[], 16, 0), "b\n  process   starting\n  worker    none\n");
    }
    #[test]
    fn many_workers_are_summarised() {
        let report =
            |pid, since_s| WorkerReport { pid, jobs: 10, point: Some(3), since_s, ..WorkerReport::default() };
        let progress = RunProgress {
            workers: vec![report(8, 0.5), report(9, 2.5)],
            ..RunProgress::new(std::path::Path::new("/a.toml"), std::path::Path::new("/out"))
        };
        let worker = |pid, state| WorkerProcess { pid, state, ticks: 3000 };
        let workers = [worker(8, 'R'), worker(9, 'R'), worker(10, 'S')];
        let text = paragraph("a-1", Some(7), Some(&progress), &workers, 2, progress.begun);
        let expected = "  workers   3: 2 computing, 1 waiting, 1 have not joined, 0:01:30 of processor time, 20 jobs, longest \
                        current job: 9, Gauss point 3 for 2.5 s\n";
        assert!(text.ends_with(expected), "{text}");
    }
}
