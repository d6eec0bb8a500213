//! What people ask of a run while it goes on (`grainspan ctl`, the page): carried out between two steps, when the step is complete and
//! its state is known to the checkpoints. No result depends on it.

use super::cells::CellWriter;
use macro_solver::checkpoint::{Archive, CheckpointStore, PeriodicCheckpoints, Progress};
use macro_solver::pool::Interrupt;
use page::{Action, Controls, NO_CHECKPOINTS, NOT_SAVED, PAUSED, PageError};
use std::thread::sleep;
use std::time::Duration;

/// Between two looks at the requests while the run is paused.
const PAUSE: Duration = Duration::from_millis(50);

/// Checkpoints of a run that looks at its requests after every step.
pub(super) struct ControlledRun<'a> {
    pub(super) checkpoints: PeriodicCheckpoints<'a>,
    pub(super) cells: CellWriter<'a>,
    controls: Controls,
    interrupt: Interrupt,
}

/// A run that has no workers, and so completes no step, ends at once if it has been asked to stop.
pub(super) fn stop_without_workers(controls: &Controls, interrupt: &Interrupt) {
    if controls.asks(Action::Stop) {
        tracing::info!(event = "stop_requested");
        interrupt.raise();
        if let Err(error) = controls.done(Action::Stop.keyword()) {
            tracing::warn!(%error, "a request to the run could not be carried out");
        }
    }
}

impl<'a> ControlledRun<'a> {
    /// A run that begins; requests made since its folder was taken wait for its first step. `keeps_checkpoints` as the scene says.
    pub(super) fn new(
        checkpoints: PeriodicCheckpoints<'a>,
        cells: CellWriter<'a>,
        controls: Controls,
        interrupt: Interrupt,
        keeps_checkpoints: bool,
    ) -> Self {
        if !keeps_checkpoints && let Err(error) = controls.put(NO_CHECKPOINTS) {
            tracing::warn!(%error, "requests to this run find no folder");
        }
        Self { checkpoints, cells, controls, interrupt }
    }

    /// Saves the state of a run that ends before it is complete; a complete one needs none.
    pub(super) fn end(&mut self, is_complete: bool) -> Result<(), PageError> {
        if is_complete { self.controls.done(NOT_SAVED) } else { self.save() }
    }

    /// Saves the state that was collected last. Whoever asked for it learns of a failure from a file.
    fn save(&mut self) -> Result<(), PageError> {
        match self.checkpoints.flush() {
            Ok(()) => self.controls.done(NOT_SAVED),
            Err(reason) => self.controls.put_text(NOT_SAVED, &reason),
        }
    }

    /// Carries out everything that has been requested; returns when the run may go on. A request whose file cannot be removed is carried out
    /// all the same, and the first such error returned at the end.
    fn carry_out(&mut self, progress: Progress, fill: &mut dyn FnMut(&mut Archive)) -> Result<(), PageError> {
        let step = progress.step;
        let (mut is_paused, mut told) = (false, Ok(()));
        loop {
            for point in self.controls.cells() {
                self.cells.write(point);
                told = told.and(self.controls.cell_done(point));
            }
            if self.controls.asks(Action::Checkpoint) {
                self.checkpoints.collect_latest(progress, fill);
                told = told.and(self.save());
                told = told.and(self.controls.done(Action::Checkpoint.keyword()));
                tracing::info!(event = "checkpoint_requested", step);
            }
            if self.controls.asks(Action::Stop) {
                told = told.and(self.controls.done(Action::Pause.keyword()));
                told = told.and(self.controls.done(Action::Stop.keyword()));
                tracing::info!(event = "stop_requested", step);
                self.interrupt.raise();
            }
            if !self.controls.asks(Action::Pause) || self.interrupt.is_raised() {
                break;
            }
            if !is_paused {
                is_paused = true;
                self.checkpoints.collect_latest(progress, fill);
                told = told.and(self.save());
                tracing::info!(event = "paused", step);
                told = told.and(self.controls.put(PAUSED));
            }
            sleep(PAUSE);
        }
        if self.interrupt.is_raised() {
            self.checkpoints.collect_latest(progress, fill);
        }
        if is_paused {
            tracing::info!(event = "resumed", step);
            told = told.and(self.controls.done(PAUSED));
        }
        told
    }
}

impl CheckpointStore for ControlledRun<'_> {
    fn earlier(&mut self) -> Option<Archive> {
        self.checkpoints.earlier()
    }

    fn save_step(&mut self, progress: Progress, fill: &mut dyn FnMut(&mut Archive)) {
        self.checkpoints.save_step(progress, fill);
        self.cells.accept(progress.step);
        if let Err(error) = self.carry_out(progress, fill) {
            tracing::warn!(%error, "a request to the run could not be carried out");
        }
    }
}
