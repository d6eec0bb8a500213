//! `run.jsonl`: one JSON object per event, written by `tracing`.

use macro_solver::observer::{
    Convergence, CutBack, FieldsView, IterationReport, Observer, Run, Stabilised, StepReport, StopRequest,
};
use macro_solver::output::OutputError;
use macro_solver::problem::{Problem, Stage};
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Mutex;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

/// Starts the event log of this process: everything from DEBUG on (the transport library from WARN on) goes to the file; a run
/// that is continued appends to the same file.
///
/// # Errors
/// The file cannot be made.
pub(super) fn open(path: &Path) -> Result<(), OutputError> {
    let failed = |source| OutputError::write(path, source);
    let mut file = OpenOptions::new().create(true).append(true).read(true).open(path).map_err(failed)?;
    end_last_line(&mut file).map_err(failed)?;
    let targets = Targets::new().with_default(LevelFilter::DEBUG).with_target("iceoryx2", LevelFilter::WARN);
    let layer = tracing_subscriber::fmt::layer()
        .json()
        .flatten_event(true)
        .with_current_span(false)
        .with_span_list(false)
        .with_writer(Mutex::new(file))
        .with_filter(targets);
    // A second run in one process would keep the first log; the binary starts one run.
    let _ = tracing_subscriber::registry().with(layer).try_init();
    Ok(())
}

/// Ends a line that a process before this one could not finish, so that it costs no other event.
fn end_last_line(file: &mut File) -> std::io::Result<()> {
    if file.seek(SeekFrom::End(0))? == 0 {
        return Ok(());
    }
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    if last == *b"\n" { Ok(()) } else { file.write_all(b"\n") }
}

/// Writes the events of the solver into the log.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EventLog;

impl Observer for EventLog {
    fn started(&mut self, problem: &Problem) -> Result<(), StopRequest> {
        tracing::info!(
            event = "started",
            elements = problem.mesh.elements.len(),
            gauss_points = problem.point_count(),
            stages = problem.stages.len(),
        );
        Ok(())
    }

    fn stage_started(&mut self, number: usize, stage: &Stage) {
        tracing::info!(
            event = "stage",
            stage = number,
            name = stage.name,
            duration = stage.duration,
            increments = stage.control.increments,
            tangent = stage.strategy.tangent.keyword(),
        );
    }

    fn iterated(&mut self, report: &IterationReport) {
        tracing::debug!(
            event = "iteration",
            step = report.step,
            load = report.load,
            iteration = report.iteration,
            evaluations = report.evaluations,
            force_ratio = report.force_ratio,
            displacement_ratio = report.displacement_ratio,
            rejected = report.rejected,
            // The former name, for one version.
            turned_down = report.rejected,
        );
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        tracing::info!(
            event = "step",
            step = report.step,
            stage = report.stage,
            time = report.time,
            load = report.load,
            share = report.share,
            iterations = report.iterations,
            evaluations = report.evaluations,
            skipped = report.skipped,
            cut_backs = report.cut_backs,
            stabilisation_increments = report.stabilisation_increments,
            committed_iterates = report.committed_iterates,
            // The former name, for one version.
            creep = report.stabilisation_increments,
            force_ratio = report.force_ratio,
            displacement_ratio = report.displacement_ratio,
            stagnated = report.convergence == Convergence::Stagnated,
            noisy_correction = report.convergence == Convergence::Noise,
            not_equilibrated = report.flags.not_equilibrated,
            largest_unbalanced = largest_unbalanced(fields),
            tangent_fallback = report.flags.tangent_fallback,
            force_evaluations = fields.statistics.cost.force_evaluations,
        );
        if report.step == 0 {
            tracing::info!(
                event = "initial_stress",
                imbalance = fields.statistics.initial_imbalance,
                deviation = fields.statistics.initial_deviation,
            );
        }
        Ok(())
    }

    fn cut_back(&mut self, event: &CutBack) {
        tracing::warn!(
            event = "cut_back",
            step = event.step,
            load = event.load,
            from = event.from,
            to = event.to,
            iterations = event.cost.iterations,
            evaluations = event.cost.evaluations,
            force_evaluations = event.cost.force_evaluations,
            reason = event.reason,
        );
    }

    fn stabilised(&mut self, event: &Stabilised) {
        tracing::warn!(
            event = "stabilised",
            step = event.step,
            load = event.load,
            increments = event.increments,
            evaluations = event.evaluations,
            failed_evaluations = event.failed.evaluations,
            failed_force_evaluations = event.failed.force_evaluations,
            largest_imbalance = event.largest_imbalance,
            work = event.work,
            reason = event.reason,
        );
    }

    fn iterates_committed(&mut self, event: &Stabilised) {
        tracing::info!(
            event = "committed_iterates",
            step = event.step,
            load = event.load,
            increments = event.increments,
            evaluations = event.evaluations,
            largest_imbalance = event.largest_imbalance,
            work = event.work,
            reason = event.reason,
        );
    }

    fn finished(&mut self, run: &Run) {
        tracing::info!(
            event = "finished",
            outcome = ?run.outcome,
            stage = run.stage,
            load = run.load,
            steps = run.statistics.steps,
            iterations = run.statistics.iterations,
            evaluations = run.statistics.evaluations,
        );
    }
}

/// Equilibrium criterion of the grains in the accepted result of the worst point.
fn largest_unbalanced(fields: &FieldsView<'_>) -> f64 {
    fields.points.iter().map(|point| point.scalars.unbalanced_force_ratio).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_was_cut_is_ended_before_the_log_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.jsonl");
        for (before, after) in [("", ""), ("{}\n", "{}\n"), ("{}\n{\"ev", "{}\n{\"ev\n")] {
            std::fs::write(&path, before).unwrap();
            let mut file = OpenOptions::new().append(true).read(true).open(&path).unwrap();
            end_last_line(&mut file).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), after);
        }
    }
}
