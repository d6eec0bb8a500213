//! `grainspan status [RUN]`: live runs of this user, their progress and their workers.

use super::exit::{Exit, Failure};
use super::stdout::print;
use crate::workers::{RunRecord, RunRegistry, WorkerProcess, workers_of};
use std::fmt::Write;
use std::time::{SystemTime, UNIX_EPOCH};

/// Arguments of `grainspan status`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example:\n  grainspan status\n  grainspan status biaxial-4711-5f3c09aa")]
pub(crate) struct Arguments {
    /// Show this run only
    #[arg(value_name = "RUN")]
    run: Option<String>,
}

/// Prints one paragraph per live run.
///
/// # Errors
/// The run asked for is not alive; standard output cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let registry = RunRegistry::of_this_user();
    let wanted = |record: &RunRecord| arguments.run.as_ref().is_none_or(|run| *run == record.run);
    let (alive, dead): (Vec<_>, Vec<_>) = registry.records().into_iter().filter(wanted).partition(RunRecord::is_alive);
    if let (Some(run), true) = (&arguments.run, alive.is_empty()) {
        return Err(Failure::new(
            Exit::BadInput,
            format!("no run named '{run}' is alive; `grainspan status` lists those that are"),
        ));
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let mut text = String::new();
    for record in &alive {
        text.push_str(&paragraph(record, &workers_of(&record.run), now));
    }
    if alive.is_empty() {
        text.push_str("No run is alive.\n");
    }
    if !dead.is_empty() {
        let names: Vec<_> = dead.iter().map(|record| record.run.as_str()).collect();
        writeln!(text, "Ended without cleaning up: {}; `grainspan clean` removes what they left.", names.join(", "))
            .expect("writing to a String cannot fail");
    }
    print(text.as_bytes())?;
    Ok(Exit::Done)
}

/// One run for people; `now` in s since 1970.
fn paragraph(record: &RunRecord, workers: &[WorkerProcess], now: u64) -> String {
    let progress = record.progress;
    let mut text = format!(
        "{}\n  scene     {}\n  output    {}\n  process   {}, for {}\n  progress  {:.1} % of the load, step {}, {} \
         evaluations\n",
        record.run,
        record.scene.display(),
        record.output.display(),
        record.pid,
        duration(now.saturating_sub(record.begun)),
        100.0 * progress.load,
        progress.step,
        progress.evaluations,
    );
    if workers.is_empty() {
        text.push_str("  workers   none\n");
    }
    for worker in workers {
        let state = match worker.state {
            'R' => "computing",
            'S' | 'D' => "waiting",
            'T' | 't' => "stopped",
            _ => "ending",
        };
        let line = format!(
            "  worker    {}, {state}, {} of processor time\n",
            worker.pid,
            duration(worker.ticks / WorkerProcess::TICKS_PER_SECOND)
        );
        text.push_str(&line);
    }
    text
}

/// Hours, minutes and seconds.
fn duration(seconds: u64) -> String {
    format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::Progress;
    use std::path::Path;

    #[test]
    fn a_run_is_described_with_its_workers() {
        let mut record = RunRecord::of_this_process("a-1", Path::new("a.toml"), Path::new("out/a"));
        (record.begun, record.pid) = (1000, 7);
        record.progress = Progress { step: 3, load: 0.125, evaluations: 42 };
        let worker = WorkerProcess { pid: 8, state: 'T', ticks: 6200 };
        let expected = "a-1\n  scene     a.toml\n  output    out/a\n  process   7, for 1:01:05\n  progress  12.5 % of the \
                        load, step 3, 42 evaluations\n  worker    8, stopped, 0:01:02 of processor time\n";
        assert_eq!(paragraph(&record, &[worker], 4665), expected);
    }
}
