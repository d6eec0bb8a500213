//! From a pool that is ready to a finished output folder.

use super::closing::{Circumstances, summary, text};
use super::energy::EnergyLedger;
use super::folder::OutputFolder;
use super::grains::{GrainWriter, SnapshotTap};
use super::journal::Journal;
use super::observers::Chain;
use super::plot;
use super::progress::Progress;
use super::resume::{Continued, RunNote};
use crate::cli::exit::{Exit, Failure};
use crate::cli::start_state::{self, Carried};
use crate::engines::Crew;
use crate::scene::Scene;
use macro_solver::checkpoint::{Archive, CheckpointFigures, CheckpointFile, PeriodicKeeper, FailureCase};
use macro_solver::difference::DifferenceTangents;
use macro_solver::implicit::solve_kept;
use macro_solver::observer::{Observer, Outcome, Run};
use macro_solver::output::{Recorder, write_atomically};
use macro_solver::pool::Pool;
use protocol::transport::MacroPort;
use std::time::Instant;

/// How a run is to be made.
pub(super) struct Manner<'a> {
    /// Who solves what.
    pub(super) crew: &'a Crew,
    /// Workers asked for.
    pub(super) workers: usize,
    /// When the first worker was started.
    pub(super) begun: Instant,
    /// Whether to say nothing but errors.
    pub(super) quiet: bool,
    /// What checkpoints say about the run.
    pub(super) note: &'a RunNote,
    /// Where to continue; `None`: from the start.
    pub(super) continued: Option<Continued>,
    /// Listens beside the recorders.
    pub(super) beside: &'a mut dyn Observer,
}

/// Solves the scene with the pool, records it, and closes the pool and the folder.
///
/// # Errors
/// The run did not reach its end, or something could not be written; what was accepted before is in the folder.
pub(super) fn drive<P: MacroPort>(
    scene: &Scene,
    mut pool: Pool<P>,
    folder: &OutputFolder,
    manner: Manner<'_>,
) -> Result<Exit, Failure> {
    let mut recorder = Recorder::create(folder.path(), scene.record.clone())?;
    let mut progress = Progress::new(manner.quiet);
    let mut ledger = EnergyLedger::default();
    let mut journal = Journal;
    let drawn: Vec<usize> = scene.grains.iter().copied().filter(|&point| manner.crew.is_built_in(point)).collect();
    if drawn.len() < scene.grains.len() {
        tracing::warn!("grains are drawn only where this program's own engine solves them");
    }
    let (mut tap, snapshots) = SnapshotTap::new(&mut pool, &drawn);
    let mut grains = GrainWriter::create(folder.path(), &scene.materials, &scene.record, snapshots)
        .map_err(|request| Failure::new(Exit::BadInput, request))?;
    // The recorders come first: what a person has been told is on the disk.
    let mut observers =
        Chain(vec![&mut recorder, &mut grains, &mut ledger, &mut journal, manner.beside, &mut progress]);
    let (begun, note) = (manner.begun, manner.note);
    let other_build = manner.continued.as_ref().is_some_and(|continued| continued.other_build);
    let wall_before = manner.continued.as_ref().map_or(0.0, |continued| continued.note.wall_s);
    let wall_s = || wall_before + begun.elapsed().as_secs_f64();
    let file = CheckpointFile::in_folder(folder.path());
    let about = |archive: &mut Archive, mark, figures: &CheckpointFigures| note.put(archive, mark, wall_s(), figures);
    let (earlier, figures) = manner.continued.map_or((None, CheckpointFigures::default()), |continued| {
        let figures = continued.note.figures;
        (Some(continued.archive), CheckpointFigures { resumed: figures.resumed + 1, ..figures })
    });
    let mut keeper = PeriodicKeeper::new(file.clone(), scene.checkpoint, earlier, figures, about);
    let mut material = DifferenceTangents::new(&mut tap, scene.engines.difference, manner.crew.differences());
    let run = solve_kept(&scene.problem, &mut material, &mut observers, &mut keeper);
    let differences = material.counts();
    if !matches!(run.outcome, Outcome::Completed) {
        keeper.flush();
    }
    let figures = keeper.figures().clone();
    let wall_s = wall_s();
    let statistics = pool.statistics();
    let quarantined = pool.quarantined().map(|case| set_aside(case, folder));
    pool.close();
    let failure = failure(scene, &run, quarantined.as_deref());
    if let Some(failure) = &failure {
        match failure.exit {
            Exit::Interrupted => tracing::info!(event = "ended", reason = failure.message),
            _ => tracing::error!(event = "ended", reason = failure.message),
        }
    }
    let about = Circumstances {
        reason: failure.as_ref().map(|failure| failure.message.clone()),
        gauss_points: scene.problem.point_count(),
        workers: manner.workers,
        wall_s,
        engines: manner.crew.description(),
        differences,
        energy: ledger.entries(),
        dynamics: ledger.dynamics(),
        definition: note.definition.clone(),
        checkpoints: figures,
        other_build,
    };
    let summary = summary(&run, &statistics, about);
    // What went wrong with the run itself matters more than a summary that found no room any more.
    let written = summary.write(&folder.path().join("summary.json")).map_err(Failure::from);
    let written = written.and_then(|()| draw(scene, &recorder, folder));
    if !manner.quiet {
        let place = folder.path().display().to_string();
        eprint!("{}", text(&summary, &run.outcome, run.statistics.cost.force_evaluations, &place));
    }
    match failure {
        Some(failure) => Err(failure),
        None => {
            written?;
            // Only now: a run that is killed before its summary is complete can still be continued.
            file.remove().map_err(|error| Failure::new(Exit::BadInput, error))?;
            Ok(Exit::Done)
        }
    }
}

/// Why a run did not reach its end, with the remedy; `None` for one that did.
fn failure(scene: &Scene, run: &Run, quarantined: Option<&str>) -> Option<Failure> {
    let stage = match &scene.problem.stages[..] {
        [_] => String::new(),
        stages => stages.get(run.stage).map_or(String::new(), |stage| format!(" of stage '{}'", stage.name)),
    };
    Some(match &run.outcome {
        Outcome::Completed => return None,
        Outcome::DidNotConverge { reason } => {
            let text = match no_start(scene, run) {
                Some(explained) => {
                    format!("the run found no equilibrium to start from{stage}: {reason}\n{explained}")
                }
                None => format!(
                    "the run did not converge beyond load {:.4}{stage}: {reason}\nhint: use more loading.increments, a smaller \
                     loading.smallest_increment, or look at the last fields; where a force cannot be carried, move a platen \
                     instead",
                    run.load
                ),
            };
            Failure::new(Exit::NotConverged, text)
        }
        Outcome::Unstable { step, time, time_step, reason } => Failure::new(
            Exit::NotConverged,
            format!(
                "the motion is unstable{stage}: at time step {step} (t = {time:.6e} s) {reason}\nhint: the step of {time_step:.3e} s is too \
                 large; leave dynamics.time_step out or lower dynamics.safety, and if the material stiffens set \
                 dynamics.tangent_every. A motion that does not grow is resolved by slower histories or damping, or let go \
                 with dynamics.longest_excess = 0"
            ),
        ),
        Outcome::Interrupted => Failure::new(
            Exit::Interrupted,
            format!(
                "interrupted at load {:.4}{stage}; everything up to the last accepted step is written{}",
                run.load,
                if scene.checkpoint.enabled { ", and --resume continues from there" } else { "" }
            ),
        ),
        Outcome::WorkersLost { reason } => {
            Failure::new(Exit::WorkersLost, format!("{reason}{}", quarantined.unwrap_or_default()))
        }
        Outcome::Stopped(request) => Failure::new(Exit::BadInput, request),
        Outcome::Refused(error) => Failure::new(Exit::BadInput, error),
    })
}

/// What to say about a run that failed in step 0, before anything was moved: more increments cannot help there. `None` for a
/// later failure, and where packing and loads match.
fn no_start(scene: &Scene, run: &Run) -> Option<String> {
    if run.statistics.steps > 0 || run.stage > 0 || run.load > 0.0 {
        return None;
    }
    let carried = Carried::by(scene.definition()).ok()?;
    let explained = match carried.remarks().first() {
        Some(remark) => remark.clone(),
        None => start_state::mismatch(scene, &carried)?,
    };
    Some(format!("{explained}\nhint: {}", start_state::REMEDY))
}

/// Writes the question that has ended too many workers; returns what to tell about it.
fn set_aside(case: &FailureCase, folder: &OutputFolder) -> String {
    let path = folder.path().join("quarantine.replay");
    match case.write(&path) {
        Ok(()) => format!(
            "\nhint: `grainspan element --replay {}` asks this question again, in one process that a debugger can watch",
            path.display()
        ),
        // The run has failed already; the reason why it cannot be looked into is worth a line, not another failure.
        Err(error) => format!("\nits question could not be written down: {error}"),
    }
}

fn draw(scene: &Scene, recorder: &Recorder, folder: &OutputFolder) -> Result<(), Failure> {
    let Some((x, y)) = &scene.plot else { return Ok(()) };
    let names: Vec<String> = scene.record.probes.iter().map(|probe| probe.name.clone()).collect();
    match plot::curve(recorder.rows(), &names, x, y) {
        Ok(Some(picture)) => Ok(write_atomically(&folder.path().join("history.svg"), picture.as_bytes())?),
        Ok(None) => Ok(()),
        Err(error) => {
            // A picture is a convenience: its numbers are in the history.
            tracing::warn!(%error, "history.svg could not be drawn");
            Ok(())
        }
    }
}
