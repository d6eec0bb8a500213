//! Cost of one DEM step when cells are solved one by one and side by side in lanes, for a packing file in 2D or 3D.
//!
//! `grainspan bench micro lane_cost PACKING.json [CELLS] [hertz]` strains CELLS copies
//! (default 32) of the cell by up to 1e-3 at default accuracy, each in another direction, and prints the instruction set, microseconds
//! of processor time per step and cell, and particle-steps per second. Both give the same bits; the program checks it.
//! Linear contacts have k_n = 2e8 R1 R2 / (R1 + R2), Hertz contacts the constants of glass.

#![expect(clippy::print_stdout, reason = "a program for people")]

use super::processor_time;
use anyhow::Context;
use protocol::{RveSolver, Tensor2, TrialOptions, TrialRequest};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::solver::kernel::backend::Backend;
use rve_server::space::{Discs, Spheres};

fn measure<S: SolverFor>(packing: PackingFile<S>, cells: usize, contact: ContactTable) -> anyhow::Result<()> {
    let grains = packing.grains.len();
    let mut rve = GrainRve::new(&GrainDefinition { packing, contact, options: RveOptions::default() })?;
    let mut state = Vec::new();
    rve.snapshot(&mut state);
    let questions: Vec<TrialRequest<'_>> = (0..cells)
        .map(|cell| {
            let phase = cell as f64;
            let mut target = Tensor2::ZERO;
            for (place, value) in target.0.iter_mut().enumerate() {
                let is_inside = place / 3 < S::DIMENSION && place % 3 < S::DIMENSION;
                *value = if is_inside { 1e-3 * (phase + 1.7 * place as f64).sin() } else { 0.0 };
            }
            TrialRequest { state: &state, target, options: TrialOptions::default() }
        })
        .collect();
    let mut fingerprints = Vec::new();
    for (name, uses_lanes) in
        [("one by one", false), ("side by side", true), ("one by one", false), ("side by side", true)]
    {
        rve.use_lanes(uses_lanes);
        let begin = processor_time();
        let answers = rve.solve_batch(&questions);
        let spent = processor_time() - begin;
        let mut steps = 0;
        let mut fingerprint = Vec::new();
        for answer in answers {
            let (answer, state) = answer?;
            steps += answer.cost.force_evaluations;
            fingerprint.push(state);
        }
        fingerprints.push(fingerprint);
        let per_step = spent / steps as f64;
        println!(
            "{name:>12}, {}: {cells} cells of {grains} grains, {steps} steps, {:.2} us per step and cell, {:.1} M particle-steps per second",
            Backend::best().name(),
            per_step * 1e6,
            grains as f64 / per_step * 1e-6,
        );
    }
    println!(
        "bits are {}",
        if fingerprints.windows(2).all(|two| two[0] == two[1]) { "the same" } else { "NOT the same" }
    );
    Ok(())
}

/// See the head of this file.
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let path = arguments.first().context("usage: lane_cost PACKING.json [CELLS] [hertz]")?;
    let cells = arguments.get(1).map_or(Ok(32), |text| text.parse())?;
    let mut contact =
        ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    if arguments.get(2).is_some_and(|word| word == "hertz") {
        contact =
            toml::from_str("law = \"hertz_mindlin\"\nshear_modulus = 29e9\npoisson_ratio = 0.2\nfriction = 0.5")?;
    }
    match PackingFile::<Discs>::read(path.as_ref()) {
        Ok(discs) => measure(discs, cells, contact),
        Err(_) => measure(PackingFile::<Spheres>::read(path.as_ref())?, cells, contact),
    }
}
