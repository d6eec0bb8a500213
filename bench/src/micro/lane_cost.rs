//! Cost of one DEM step when cells are solved one by one and side by side in lanes, for a packing file in 2D or 3D.
//!
//! `grainspan bench micro lane_cost PACKING.json [CELLS] [hertz] [strain=S] [per_step=D] [tolerance=T]` strains CELLS copies
//! (default 32) of the cell by up to S (default 1e-3) at default accuracy or the one given, each in another direction, and prints the
//! instruction set, microseconds of processor time per step and cell, and particle-steps per second. Both give the same bits; the
//! program checks it. With few steps a trial (`per_step=1e-5`) it shows what a trial costs besides its steps.
//! Linear contacts have k_n = 2e8 R1 R2 / (R1 + R2), Hertz contacts the constants of glass.

#![expect(clippy::print_stdout, reason = "a program for people")]

use super::processor_time::processor_time;
use anyhow::Context;
use protocol::{RveSolver, Tensor2, TrialOptions, TrialRequest};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::solver::kernel::backend::Backend;
use rve_server::space::{Discs, Spheres};

/// What is measured besides the packing.
struct Wanted {
    cells: usize,
    contact: ContactTable,
    /// Largest component of the strains.
    strain: f64,
    options: RveOptions,
}

fn measure<S: SolverFor>(packing: PackingFile<S>, wanted: Wanted) -> anyhow::Result<()> {
    let Wanted { cells, contact, strain, options } = wanted;
    let grains = packing.grains.len();
    let mut rve = GrainRve::new(&GrainDefinition { packing, contact, options })?;
    let mut state = Vec::new();
    rve.snapshot(&mut state);
    let definition = rve.definition_id();
    let requests: Vec<TrialRequest<'_>> = (0..cells)
        .map(|cell| {
            let phase = cell as f64;
            let mut target = Tensor2::ZERO;
            for (place, value) in target.0.iter_mut().enumerate() {
                let is_inside = place / 3 < S::DIMENSION && place % 3 < S::DIMENSION;
                *value = if is_inside { strain * (phase + 1.7 * place as f64).sin() } else { 0.0 };
            }
            let options = TrialOptions::default();
            TrialRequest { definition, state: &state, target, options }
        })
        .collect();
    let mut fingerprints = Vec::new();
    for (name, uses_lanes) in
        [("one by one", false), ("side by side", true), ("one by one", false), ("side by side", true)]
    {
        rve.use_lanes(uses_lanes);
        let begin = processor_time();
        let answers = rve.solve_batch(&requests);
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
    const USAGE: &str = "usage: lane_cost PACKING.json [CELLS] [hertz] [strain=S] [per_step=D] [tolerance=T]";
    let path = arguments.first().context(USAGE)?;
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let mut wanted = Wanted { cells: 32, contact, strain: 1e-3, options: RveOptions::default() };
    for argument in &arguments[1..] {
        match argument.split_once('=') {
            Some(("strain", value)) => wanted.strain = value.parse().context(USAGE)?,
            Some(("per_step", value)) => wanted.options.strain_per_step = Some(value.parse().context(USAGE)?),
            Some(("tolerance", value)) => wanted.options.tolerance = Some(value.parse().context(USAGE)?),
            None if argument == "hertz" => {
                let glass = "law = \"hertz_mindlin\"\nshear_modulus = 29e9\npoisson_ratio = 0.2\nfriction = 0.5";
                wanted.contact = toml::from_str(glass)?;
            }
            _ => wanted.cells = argument.parse().context(USAGE)?,
        }
    }
    match PackingFile::<Discs>::read(path.as_ref()) {
        Ok(discs) => measure(discs, wanted),
        Err(_) => measure(PackingFile::<Spheres>::read(path.as_ref())?, wanted),
    }
}
