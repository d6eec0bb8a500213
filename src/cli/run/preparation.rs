//! Cells brought to the stress of their Gauss points before the run, with progress for people.

use super::super::waiting_progress::WaitingProgress;
use crate::exit::{Exit, Failure};
use crate::side_by_side::cores;
use crate::stderr::tell;
use macro_solver::pool::Interrupt;
use rayon::ThreadPoolBuilder;
use scene_reader::Scene;
use std::time::Instant;

/// Prepares the cells if `[initial_stress] prepare` asks for it, on as many cores as the run has workers at most. If `interrupt` is raised
/// meanwhile it ends early, with the scene as it was.
///
/// # Errors
/// A stress that the grains of a point cannot carry; the system refuses threads.
pub(super) fn prepare_cells(
    scene: &mut Scene,
    workers: Option<usize>,
    quiet: bool,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let Some(planned) = scene.preparation() else { return Ok(()) };
    let begun = Instant::now();
    let progress_line = WaitingProgress::start(quiet);
    let cores = cores().get();
    let threads =
        ThreadPoolBuilder::new().num_threads(workers.map_or(cores, |workers| workers.clamp(1, cores))).build();
    let threads = threads.map_err(|error| {
        Failure::new(Exit::BadInput, format!("could not start threads that prepare cells: {error}"))
    })?;
    let is_done = threads.install(|| {
        scene.prepare_cells(&|done| {
            progress_line.set(format!("cell {done} of {} brought to its stress", planned.cells));
            !interrupt.is_raised()
        })
    })?;
    drop(progress_line);
    if !is_done {
        return Ok(());
    }
    let (cells, [lowest, highest], seconds) =
        (planned.cells, planned.vertical_pressure, begun.elapsed().as_secs_f64());
    if let Some(prepared) = &mut scene.prepared {
        prepared.seconds = seconds;
    }
    if !quiet {
        tell(format_args!(
            "{cells} cells brought to vertical pressures of {lowest:.3e} to {highest:.3e} Pa in {seconds:.1} s"
        ));
    }
    Ok(())
}
