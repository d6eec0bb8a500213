//! Cost of a preparation, stage by stage: `grainspan bench micro pack_cost RECIPE.toml [NUMBER] [trace] [OUT.json]`; without `NUMBER` as many
//! grains as the recipe says. Prints increments and processor time of every stage, the report's figures, and with `trace` every increment.

use super::processor_time::processor_time;
use anyhow::{Context, bail};
use rve_server::definition::Packing;
use rve_server::preparation::{PackingRecipe, generate_any};
use std::collections::BTreeMap;

const USAGE: &str = "usage: pack_cost RECIPE.toml [NUMBER] [trace] [OUT.json]";

/// What follows the recipe, in any order.
#[derive(Debug, Default, PartialEq, Eq)]
struct Wanted {
    number: Option<usize>,
    traces: bool,
    out: Option<String>,
}

impl Wanted {
    fn read(arguments: &[String]) -> anyhow::Result<Self> {
        let mut wanted = Self::default();
        for argument in arguments {
            match argument.as_str() {
                "trace" => wanted.traces = true,
                file if file.ends_with(".json") => wanted.out = Some(file.to_owned()),
                number => match number.parse() {
                    Ok(number) => wanted.number = Some(number),
                    Err(_) => {
                        bail!("`{argument}` is no number of grains, no `trace` and no file of packings; {USAGE}")
                    }
                },
            }
        }
        Ok(wanted)
    }
}

/// See the head of this file.
#[expect(clippy::print_stdout, reason = "a program for people")]
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let (path, rest) = arguments.split_first().context(USAGE)?;
    let Wanted { number, traces, out } = Wanted::read(rest)?;
    let mut recipe = PackingRecipe::from_toml(&std::fs::read_to_string(path)?)?;
    recipe.number = number.unwrap_or(recipe.number);
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
    if let Some(out) = out {
        let text = match &packing {
            Packing::Discs(packing) => packing.to_json(),
            Packing::Spheres(packing) => packing.to_json(),
        };
        std::fs::write(out, text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `trace` without a number was read as one.
    #[test]
    fn the_number_of_grains_may_be_left_out() {
        let read = |words: &[&str]| Wanted::read(&words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>());
        assert_eq!(read(&[]).unwrap(), Wanted::default());
        assert_eq!(read(&["trace"]).unwrap(), Wanted { traces: true, ..Wanted::default() });
        let all = Wanted { number: Some(200), traces: true, out: Some("a.json".into()) };
        assert_eq!(read(&["200", "trace", "a.json"]).unwrap(), all);
        assert!(read(&["tracing"]).unwrap_err().to_string().contains("usage: pack_cost"));
    }
}
