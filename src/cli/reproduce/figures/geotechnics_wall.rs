//! Smooth retaining wall, active and passive, against Rankine. L-1.

use super::geotechnics::{bound, passive, strength, strength_run};
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "geotechnics-wall",
    source: "Rankine; Guo and Zhao (2016)",
    shows: "pressure on a smooth wall that moves away from the ground and into it, over the surcharge",
    run_time: ("1 min", "5 h"),
    entries: &[("L-1", "pressure over surcharge")],
    runs,
    evaluate,
};

const HEIGHT: f64 = 0.17;

fn runs(size: Size) -> Vec<Run> {
    vec![
        strength_run(size).set("packing=\"../../packings/discs-400-dense.json\"").set("contact.modulus=6e7"),
        Run::new("active", "scenes/geotechnics/wall-active.toml", Command::Stopping, size),
        Run::new("passive", "scenes/geotechnics/wall-passive.toml", Command::Stopping, size),
    ]
}

/// Pressure over that at the start, which is the surcharge, over the way of the wall in heights.
fn pressure(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table()?;
    let force = table.column("wall_force")?;
    let way = table.column("wall_displacement")?;
    Ok(way.iter().zip(&force).map(|(way, own)| [way.abs() / HEIGHT, own / force[0]]).collect())
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let strength = strength(results.run("strength")?)?;
    let x = ("way of the wall over its height", Scale::Linear);
    let mut charts = Vec::new();
    let mut comparisons = vec![
        Comparison::reported("friction angle of the cell, peak", "degrees", strength.peak.asin().to_degrees()),
        Comparison::reported("friction angle of the cell, 10 to 20 %", "degrees", strength.late.asin().to_degrees()),
    ];
    let active = pressure(results.run("active")?)?;
    let least = trough(&active)?;
    comparisons.push(bound(
        "active pressure over surcharge",
        "Rankine",
        &strength,
        |sine| 1.0 / passive(sine),
        least[1],
        0.1,
    ));
    comparisons.push(Comparison::reported("way of the wall at the least pressure, over its height", "-", least[0]));
    let pushed = pressure(results.run("passive")?)?;
    let most = peak(&pushed)?;
    comparisons.push(bound("passive pressure over surcharge", "Rankine", &strength, passive, most[1], 0.1));
    comparisons.push(Comparison::reported("way of the wall at the largest pressure, over its height", "-", most[0]));
    for (part, title, curve, law) in [
        ("active", "Smooth wall, active", active, (|sine| 1.0 / passive(sine)) as fn(f64) -> f64),
        ("passive", "Smooth wall, passive", pushed, passive as fn(f64) -> f64),
    ] {
        let end = curve.last().map_or(0.0, |point| point[0]);
        let mut chart = Chart::new(title, x, ("pressure over surcharge", Scale::Linear));
        chart.curve("wall", curve);
        for (name, sine) in [("peak", strength.peak), ("10 to 20 % strain", strength.late)] {
            let level = law(sine);
            chart.reference(&format!("Rankine, strength of the cell: {name}"), [[0.0, level], [end, level]]);
        }
        charts.push((part, chart));
    }
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}
