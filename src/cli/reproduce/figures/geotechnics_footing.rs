//! Strip footing on weightless ground with surcharge, against Prandtl. L-2.

use super::geotechnics::{bound, strength, strength_run, surcharge_factor};
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "geotechnics-footing",
    source: "Prandtl; Guo and Zhao (2016)",
    shows: "load on a rough strip footing over the surcharge, over the settlement",
    run_time: ("1 min", "3 h"),
    entries: &[("L-2", "")],
    runs,
    evaluate,
};

const HALF_WIDTH: f64 = 0.05;

fn runs(size: Size) -> Vec<Run> {
    vec![strength_run(size), Run::new("footing", "scenes/geotechnics/footing.toml", Command::Stopping, size)]
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let strength = strength(results.run("strength")?)?;
    let table = results.run("footing")?.table()?;
    let force = table.column("footing_force")?;
    let settled = table.column("settlement")?;
    let curve: Curve =
        settled.iter().zip(&force).map(|(way, own)| [way.abs() / HALF_WIDTH, own / force[0]]).collect();
    let top = peak(&curve)?;
    let mut chart = Chart::new(
        "Strip footing with surcharge, weightless ground",
        ("settlement over half width", Scale::Linear),
        ("load over surcharge", Scale::Linear),
    );
    let end = curve.last().map_or(0.0, |point| point[0]);
    chart.curve("footing", curve);
    let law = surcharge_factor;
    for (name, sine) in [("peak", strength.peak), ("10 to 20 % strain", strength.late)] {
        chart.reference(&format!("Prandtl, strength of the cell: {name}"), [[0.0, law(sine)], [end, law(sine)]]);
    }
    let comparisons = vec![
        bound("largest load over surcharge", "Prandtl", &strength, law, top[1], 0.2),
        Comparison::reported("settlement there, over the half width", "-", top[0]),
    ];
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}
