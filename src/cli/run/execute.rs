//! Solves a scene with a pool that is ready, and completes the output folder.

use super::cells::CellWriter;
use super::closing_lines::closing_lines;
use super::control::ControlledRun;
use super::event_log::EventLog;
use super::failure::{failure, write_failure_case};
use super::folder::OutputFolder;
use super::grains::{GrainWriter, SnapshotRecorder};
use super::observers::ObserverChain;
use super::packings::packings_under_the_law;
use super::plot;
use super::progress::ProgressDisplay;
use super::resume::{Continued, HostFigures, RunDescription};
use super::shortcuts::Allowed;
use super::summary::{SummaryInputs, summary};
use crate::engines::EngineAssignment;
use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use macro_solver::checkpoint::{Archive, CheckpointFigures, CheckpointFile, PeriodicCheckpoints};
use macro_solver::material::difference::{DifferenceCounts, DifferenceTangents};
use macro_solver::material::error_estimate::{ErrorEstimator, ReplicaFigures, SamplePlan};
use macro_solver::observer::{Observer, Outcome, Run};
use macro_solver::output::{
    EarlierFiles, EnergyLedger, OutputError, RecordPlan, Recorder, Summary, write_atomically,
};
use macro_solver::pool::{Interrupt, Pool};
use macro_solver::problem::Procedure;
use macro_solver::solve::solve_with_checkpoints;
use page::Controls;
use protocol::Observables;
use protocol::transport::MacroPort;
use rve_server::definition::SolverName;
use scene_reader::Scene;
use std::time::Instant;

/// The circumstances of a run.
pub(super) struct RunContext<'a> {
    /// The engines and their points.
    pub(super) assignment: &'a EngineAssignment,
    /// Points that are solved once more to estimate the error.
    pub(super) replicas: SamplePlan,
    /// Workers that serve when the run begins.
    pub(super) workers: usize,
    /// When the channels were opened, before the first worker was started.
    pub(super) begun: Instant,
    /// Whether to print nothing but errors.
    pub(super) quiet: bool,
    /// Description of the run in its checkpoints.
    pub(super) description: &'a RunDescription,
    /// Where to continue; `None`: from the start.
    pub(super) continued: Option<Continued>,
    /// Ends the run when it is raised.
    pub(super) interrupt: Interrupt,
    /// Observes the solver after the recorders.
    pub(super) observer: &'a mut dyn Observer,
    /// What happened between hosts, by name; empty for a run that does not listen.
    pub(super) hosts: &'a dyn Fn() -> HostFigures,
}

/// Result of the solver, with what was recorded on the way.
struct Solved {
    run: Run,
    recorder: Recorder,
    energy: EnergyLedger,
    differences: DifferenceCounts,
    replicas: ReplicaFigures,
    checkpoints: CheckpointFigures,
    /// Wall time, s; that of earlier processes of the run included.
    wall_s: f64,
}

/// Solves the scene with the pool, records it, and closes the pool and the folder.
///
/// # Errors
/// The run did not reach its end, or something could not be written; what was accepted before is in the folder.
pub(super) fn execute<P: MacroPort>(
    scene: &Scene,
    mut pool: Pool<P>,
    folder: &OutputFolder,
    context: RunContext<'_>,
) -> Result<Exit, Failure> {
    let (assignment, workers, quiet, description) =
        (context.assignment, context.workers, context.quiet, context.description);
    let other_build = context.continued.as_ref().is_some_and(|continued| continued.other_build);
    let hosts = context.hosts;
    let packings = packings_under_the_law(scene);
    let solved = solve(scene, &mut pool, folder, context)?;
    let statistics = pool.statistics();
    let hint = pool.quarantined().map(|case| write_failure_case(case, folder));
    pool.close();
    let outside = assignment.engines.iter().map(|assigned| &assigned.engine).filter(|engine| !engine.is_built_in());
    let outside: Vec<&str> = outside.map(|engine| engine.name.as_str()).collect();
    let failure = failure(scene, &solved.run, hint.as_deref(), &outside);
    log_end(failure.as_ref());
    let first = scene.problem.stages.first();
    let starts_in_motion = first.is_some_and(|stage| matches!(stage.procedure, Procedure::Dynamic(_)));
    let inputs = SummaryInputs {
        reason: failure.as_ref().map(|failure| failure.message.clone()),
        gauss_points: scene.problem.point_count(),
        workers,
        wall_s: solved.wall_s,
        starts_in_motion,
        engines: assignment.description(),
        differences: solved.differences,
        replicas: solved.replicas,
        error: scene.problem.error_control.map(|control| control.error),
        energy: solved.energy.entries(scene.problem.observables.contains(Observables::ENERGY)),
        dynamics: solved.energy.dynamics(),
        contents: description.contents.clone(),
        checkpoints: solved.checkpoints.clone(),
        other_build,
        allowed: allowed(scene),
        hosts: hosts(),
        prepared: scene.prepared,
        packings,
    };
    let summary = summary(&solved.run, &statistics, inputs);
    let written = write_results(scene, &solved, &summary, folder);
    if !quiet {
        let force_evaluations = solved.run.statistics.cost.force_evaluations;
        let place = folder.path().display().to_string();
        tell(closing_lines(&summary, &solved.run, force_evaluations, starts_in_motion, &place).trim_end());
    }
    // The failure of the run itself matters more than that of a file.
    if let Some(failure) = failure {
        return Err(failure);
    }
    written?;
    // Only now: a run that is killed before its summary is complete can still be continued.
    CheckpointFile::in_folder(folder.path()).remove().map_err(|error| Failure::new(Exit::BadInput, error))?;
    Ok(Exit::Done)
}

/// The shortcuts that a scene allows.
fn allowed(scene: &Scene) -> Allowed {
    let stages = &scene.problem.stages;
    Allowed {
        unchanged_targets: stages.iter().all(|stage| stage.strategy.keep_unchanged),
        duplicate_trials: scene.pool.shares_duplicates,
        zero_increments: !scene.definition().options().relax_zero_increments,
        tolerance: scene.definition().options().tolerance(),
        lanes: scene.pool.lanes,
        event_driven: scene.definition().options().solver == SolverName::EventDriven,
        stagnated_steps: stages.iter().any(|stage| stage.tolerances.accept_stagnated()),
    }
}

/// Runs the solver with all observers and checkpoints.
///
/// # Errors
/// A recorder cannot make its files.
fn solve<P: MacroPort>(
    scene: &Scene,
    pool: &mut Pool<P>,
    folder: &OutputFolder,
    context: RunContext<'_>,
) -> Result<Solved, Failure> {
    let record = RecordPlan { accuracy: !context.replicas.is_empty(), ..scene.record.clone() };
    let earlier = if context.continued.is_some() { EarlierFiles::Keep } else { EarlierFiles::Replace };
    let mut recorder = Recorder::create(folder.path(), record, earlier)?;
    let solved_here: Vec<usize> =
        (0..scene.problem.point_count()).filter(|&point| context.assignment.is_built_in(point)).collect();
    let (mut material, snapshots) = SnapshotRecorder::new(pool, &solved_here);
    let continued = context.continued.as_ref().map(|continued| (continued.description.step, material.restored()));
    let cells = CellWriter::new(folder.path(), &scene.materials, snapshots.clone(), continued);
    let chosen = drawn_points(scene, context.assignment);
    let mut grains =
        GrainWriter::create(folder.path(), &scene.materials, &scene.record, &chosen, scene.grains_from, snapshots)
            .map_err(|request| Failure::new(Exit::BadInput, request))?;
    let (mut energy, mut event_log, mut progress) =
        (EnergyLedger::default(), EventLog, ProgressDisplay::new(context.quiet));
    // The recorders come first: what is displayed is already on the disk.
    let mut observers =
        ObserverChain(vec![&mut recorder, &mut grains, &mut energy, &mut event_log, context.observer, &mut progress]);
    let (begun, description) = (context.begun, context.description);
    let wall_before = context.continued.as_ref().map_or(0.0, |continued| continued.description.wall_s);
    let wall_s = || wall_before + begun.elapsed().as_secs_f64();
    let (earlier, figures) = context.continued.map_or((None, CheckpointFigures::default()), |continued| {
        let figures = continued.description.figures;
        (Some(continued.archive), CheckpointFigures { resumed: figures.resumed + 1, ..figures })
    });
    let hosts = context.hosts;
    let describe = |archive: &mut Archive, progress, figures: &CheckpointFigures| {
        description.put(archive, progress, wall_s(), figures, hosts());
    };
    let file = CheckpointFile::in_folder(folder.path());
    let checkpoints = PeriodicCheckpoints::new(file, scene.checkpoint, earlier, figures, describe);
    let (controls, keeps) = (Controls::of(folder.path()), scene.checkpoint.enabled);
    let mut controlled = ControlledRun::new(checkpoints, cells, controls, context.interrupt, keeps);
    let differences = context.assignment.differences();
    let mut material = DifferenceTangents::new(&mut material, scene.engines.difference, differences);
    let mut estimator = ErrorEstimator::new(&mut material, scene.materials.cell_dimension(), &context.replicas);
    let run = solve_with_checkpoints(&scene.problem, &mut estimator, &mut observers, &mut controlled);
    let replicas = estimator.figures();
    let differences = material.counts();
    if let Err(error) = controlled.end(matches!(run.outcome, Outcome::Completed)) {
        tracing::warn!(%error, "whoever asked for the end of the run is not told whether its state is saved");
    }
    if scene.cells {
        controlled.cells.write_all();
    }
    let (checkpoints, wall_s) = (controlled.checkpoints.figures().clone(), wall_s());
    Ok(Solved { run, recorder, energy, differences, replicas, checkpoints, wall_s })
}

/// The points whose grains are drawn: those of the scene that the built-in engine solves.
fn drawn_points(scene: &Scene, assignment: &EngineAssignment) -> Vec<usize> {
    let points: Vec<usize> = scene.grains.iter().copied().filter(|&point| assignment.is_built_in(point)).collect();
    if points.len() < scene.grains.len() {
        tracing::warn!("grains are drawn only at points that the engine `grains` solves");
    }
    points
}

/// Writes the reason of a run that did not reach its end into the event log.
fn log_end(failure: Option<&Failure>) {
    match failure {
        Some(failure) if failure.exit == Exit::Interrupted => {
            tracing::info!(event = "ended", reason = failure.message);
        }
        Some(failure) => tracing::error!(event = "ended", reason = failure.message),
        None => {}
    }
}

/// Writes the summary and the curve of the history.
fn write_results(
    scene: &Scene,
    solved: &Solved,
    summary: &Summary,
    folder: &OutputFolder,
) -> Result<(), OutputError> {
    summary.write(&folder.path().join("summary.json"))?;
    let Some((x, y)) = &scene.plot else { return Ok(()) };
    let dimension = scene.problem.mesh.dimension;
    let probes: Vec<(String, &str)> =
        scene.record.probes.iter().map(|probe| (probe.name.clone(), probe.quantity.unit(dimension))).collect();
    match plot::curve(solved.recorder.rows(), &probes, x, y) {
        Ok(Some(picture)) => write_atomically(&folder.path().join("history.svg"), picture.as_bytes()),
        Ok(None) => Ok(()),
        Err(error) => {
            // The picture is a convenience: its numbers are in the history.
            tracing::warn!(%error, "history.svg could not be drawn");
            Ok(())
        }
    }
}
