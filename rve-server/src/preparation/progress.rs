//! Progress reports of a preparation, and its cost so far.

use std::cell::{Cell, RefCell};

/// How far a preparation has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackingProgress {
    /// Packings made before this one in a search.
    pub attempt: u32,
    /// Stage of the preparation.
    pub stage: &'static str,
    /// Increments done in this stage.
    pub increment: u32,
    /// Solid volume over cell volume.
    pub solid_fraction: f64,
    /// Mean pressure, Pa, compression positive.
    pub pressure: f64,
    /// Largest deviation of a stress component from the target over the target pressure.
    pub stress_error: f64,
    /// Unbalanced force over mean normal force.
    pub unbalanced_force_ratio: f64,
}

/// What is told of a preparation on the way, shared by all compactions that belong to it.
pub(crate) struct ProgressLog<'a> {
    listener: RefCell<&'a mut dyn FnMut(&PackingProgress)>,
    force_evaluations: Cell<u64>,
    attempt: Cell<u32>,
}

impl<'a> ProgressLog<'a> {
    pub(crate) fn new(listener: &'a mut dyn FnMut(&PackingProgress)) -> Self {
        Self { listener: RefCell::new(listener), force_evaluations: Cell::new(0), attempt: Cell::new(0) }
    }

    /// Another packing of a search begins.
    pub(crate) fn next_attempt(&self) {
        self.attempt.set(self.attempt.get() + 1);
    }

    pub(crate) fn spend(&self, force_evaluations: u64) {
        self.force_evaluations.set(self.force_evaluations.get() + force_evaluations);
    }

    /// DEM steps spent so far.
    pub(crate) fn spent(&self) -> u64 {
        self.force_evaluations.get()
    }

    pub(crate) fn report(&self, progress: PackingProgress) {
        (self.listener.borrow_mut())(&PackingProgress { attempt: self.attempt.get(), ..progress });
    }
}
