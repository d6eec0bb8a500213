//! Starts the pool of a run.

use super::folder::OutputFolder;
use crate::cli::exit::{Exit, Failure};
use crate::scene::Scene;
use std::num::NonZeroUsize;

pub(super) fn run(_: &Scene, _: &OutputFolder, _: NonZeroUsize, _: bool) -> Result<Exit, Failure> {
    Err(Failure::new(Exit::WorkersLost, "transport missing"))
}
