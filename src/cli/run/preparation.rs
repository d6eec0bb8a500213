//! Cells brought to the stress of their Gauss points before the run, with progress for people.

use super::super::waiting_progress::WaitingProgress;
use crate::exit::Failure;
use crate::stderr::tell;
use macro_solver::pool::Interrupt;
use scene_reader::Scene;
use std::time::Instant;

/// Prepares the cells if `[initial_stress] prepare` asks for it. If `interrupt` is raised meanwhile it ends early, with the scene as it was.
///
/// # Errors
/// A stress that the grains of a point cannot carry.
pub(super) fn prepare_cells(scene: &mut Scene, quiet: bool, interrupt: &Interrupt) -> Result<(), Failure> {
    let Some(planned) = scene.preparation() else { return Ok(()) };
    let begun = Instant::now();
    let progress_line = WaitingProgress::start(quiet);
    let is_done = scene.prepare_cells(&|done| {
        progress_line.set(format!("cell {done} of {} brought to its stress", planned.cells));
        !interrupt.is_raised()
    })?;
    drop(progress_line);
    if !is_done {
        return Ok(());
    }
    let (cells, [lowest, highest], seconds) =
        (planned.cells, planned.vertical_pressure, begun.elapsed().as_secs_f64());
    if !quiet {
        tell(format_args!(
            "{cells} cells brought to vertical pressures of {lowest:.3e} to {highest:.3e} Pa in {seconds:.1} s"
        ));
    }
    Ok(())
}
