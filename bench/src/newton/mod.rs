//! How many evaluations each strategy needs: on one element over several packings, and on the biaxial test of
//! [Argilaga2018] with all eight operators (T-10). What committed iterates save.
//!
//! Evaluations are counted twice: as the solver requests them, and as workers compute them, which is less where several points
//! have bitwise equal trials.

mod biaxial;
pub(super) mod case;
mod committed_iterates;
mod element;
mod strategies;

use super::report::Report;
use crate::effort::Effort;
use biaxial::Grains;

/// Parts that `--only` may name, besides strategies and operators.
const PARTS: [&str; 4] = ["element", "biaxial", "mixed", "committed-iterates"];

/// Measures the parts that were chosen, or all.
///
/// # Errors
/// A packing cannot be made, workers are lost, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    if effort.includes("element", &PARTS) {
        element::run(effort, report)?;
    }
    if effort.includes("biaxial", &PARTS) {
        biaxial::run(Grains::Alike, effort, report)?;
    }
    if effort.includes("mixed", &PARTS) {
        biaxial::run(Grains::Mixed, effort, report)?;
    }
    if effort.includes("committed-iterates", &PARTS) {
        committed_iterates::run(effort, report)?;
    }
    Ok(())
}
