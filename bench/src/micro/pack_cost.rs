//! Cost of a preparation, stage by stage: `grainspan bench micro pack_cost RECIPE.toml [number of grains] [trace] [OUT.json]`. Prints increments and processor time of every stage, the report's figures, and
//! with `trace` every increment.

use super::processor_time::processor_time;
use anyhow::Context;
use rve_server::definition::Packing;
use rve_server::preparation::{PackingRecipe, generate_any};
use std::collections::BTreeMap;

/// See the head of this file.
#[expect(clippy::print_stdout, reason = "a program for people")]
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let path = arguments.first().context("usage: pack_cost RECIPE.toml [NUMBER] [trace] [OUT.json]")?;
    let mut recipe = PackingRecipe::from_toml(&std::fs::read_to_string(path)?)?;
    if let Some(number) = arguments.get(1) {
        recipe.number = number.parse()?;
    }
    let traces = arguments.iter().any(|word| word == "trace");
    let (begin, mut last) = (processor_time(), processor_time());
    let mut stages: BTreeMap<&'static str, (u32, f64)> = BTreeMap::new();
    let (packing, report) = generate_any(&recipe, &mut |progress| {
        let now = processor_time();
        let stage = stages.entry(progress.stage).or_default();
        (stage.0, stage.1, last) = (stage.0 + 1, stage.1 + now - last, now);
        if traces {
            println!(
                "{} {:>11} {:>4}: {:6.2} s, solid fraction {:.5}, pressure {:.4e}, stress error {:.2e}, unbalanced force {:.1e}",
                progress.attempt,
                progress.stage,
                progress.increment,
                now - begin,
                progress.solid_fraction,
                progress.pressure,
                progress.stress_error,
                progress.unbalanced_force_ratio
            );
        }
    })?;
    for (stage, (increments, seconds)) in &stages {
        println!("{stage:>12}: {increments} increments, {seconds:.1} s of processor time");
    }
    println!(
        "{} grains, {} force evaluations, {:.1} s; void ratio {:.4}, {:.3} contacts a grain ({:.3} without rattlers), \
         fabric anisotropy {:.3}",
        report.grains,
        report.force_evaluations,
        processor_time() - begin,
        report.void_ratio,
        report.coordination_number,
        report.coordination_number_no_rattlers,
        report.fabric_anisotropy
    );
    if let Some(out) = arguments.iter().find(|word| word.ends_with(".json")) {
        let text = match &packing {
            Packing::Discs(packing) => packing.to_json(),
            Packing::Spheres(packing) => packing.to_json(),
        };
        std::fs::write(out, text)?;
    }
    Ok(())
}
