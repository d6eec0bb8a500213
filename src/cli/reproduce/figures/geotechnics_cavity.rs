//! Expansion of a cylindrical cavity, against the ring that yields everywhere. L-3.

use super::geotechnics::{bound, cavity_pressure, strength, strength_run};
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "geotechnics-cavity",
    source: "closed form",
    shows: "pressure in an expanding cavity over the pressure outside, radii 1 : 4",
    run_time: ("1 min", "1 h"),
    entries: &[("L-3", "")],
    runs,
    evaluate,
};

const RADIUS: f64 = 0.1;

fn runs(size: Size) -> Vec<Run> {
    vec![strength_run(size), Run::new("cavity", "scenes/geotechnics/cavity.toml", Command::Stopping, size)]
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let strength = strength(results.run("strength")?)?;
    let table = results.run("cavity")?.table()?;
    // The mean of the component along x over a quarter is 2 / pi of the growth of the radius.
    let growth: Vec<f64> =
        table.column("growth")?.iter().map(|way| way * std::f64::consts::FRAC_PI_2 / RADIUS).collect();
    let curve: Curve = growth.iter().zip(table.column("load")?).map(|(x, load)| [*x, 1.0 + load]).collect();
    let top = peak(&curve)?;
    let mut chart = Chart::new(
        "Expansion of a cavity, radii 1 : 4",
        ("growth over radius", Scale::Linear),
        ("pressure inside over outside", Scale::Linear),
    );
    let end = curve.last().map_or(0.0, |point| point[0]);
    chart.curve("cavity", curve);
    let law = |sine: f64| cavity_pressure(sine, 4.0);
    for (name, sine) in [("peak", strength.peak), ("10 to 20 % strain", strength.late)] {
        chart.reference(
            &format!("yielding everywhere, strength of the cell: {name}"),
            [[0.0, law(sine)], [end, law(sine)]],
        );
    }
    let comparisons = vec![
        bound("largest pressure inside over outside", "ring that yields everywhere", &strength, law, top[1], 0.1),
        Comparison::reported("growth there, over the radius", "-", top[0]),
    ];
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}
