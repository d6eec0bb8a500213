//! [Liu2015] Fig. 8: shear wave in a column of bricks; stress and strain of element 9, porosity and contacts. J-4.

use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-column",
    source: "[Liu2015] Figs. 7, 8",
    shows: "shear wave of 10 kHz in a column: stress-strain loops, porosity and contacts of element 9",
    run_time: ("10 s", "4 min"),
    entries: &[("J-4", "")],
    runs,
    evaluate,
};

/// The element that the paper plots, from 0.
const ELEMENT: usize = 8;

/// Period of the driven end, s.
const PERIOD: f64 = 1e-4;

fn runs(size: Size) -> Vec<Run> {
    vec![Run::new("column", "scenes/liu2015/column.toml", Command::Scene, size)]
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let run = results.run("column")?;
    let table = run.table()?;
    let (time, steps) = (table.column("time")?, table.column("step")?);
    let mut loops: Curve = Vec::new();
    let (mut stress, mut porosity, mut contacts): (Curve, Curve, Curve) = Default::default();
    for (row, time) in time.iter().enumerate() {
        let fields = Fields::read(run, steps[row] as usize)?;
        let shear = fields.element_values("stress")?[9 * ELEMENT + 1] / 1e3;
        // The tensor component is half the shear angle.
        let angle = 2.0 * fields.element_values("strain")?[9 * ELEMENT + 1];
        let void_ratio = fields.element_values("void_ratio")?[ELEMENT];
        loops.push([angle, shear]);
        stress.push([*time, shear]);
        porosity.push([1e3 * time, void_ratio / (1.0 + void_ratio)]);
        contacts.push([1e3 * time, fields.element_values("coordination_number")?[ELEMENT]]);
    }
    let last = time.last().copied().unwrap_or(0.0);
    let amplitude = stress.iter().map(|point| point[1].abs()).fold(0.0, f64::max);
    let in_last_period = stress.iter().filter(|point| point[0] > last - PERIOD);
    let open =
        in_last_period.map(|point| (point[1] - value_at(&stress, point[0] - PERIOD)).abs()).fold(0.0, f64::max);
    let residual = table.column("energy_residual")?.iter().map(|value| value.abs()).fold(0.0, f64::max);
    let source = "band of J-4";
    let (first, end) = (porosity[0][1], porosity[porosity.len() - 1][1]);
    let fewer = contacts[contacts.len() - 1][1] < contacts[0][1];
    let comparisons = vec![
        Comparison::new(
            "largest change of the shear stress from one period to the next, last period, over the amplitude",
            "-",
            Theirs::Value(0.0),
            source,
            open / amplitude,
            Tolerance::Absolute(0.05),
        ),
        Comparison::new(
            "residual of the energy balance",
            "-",
            Theirs::Value(0.0),
            source,
            residual,
            Tolerance::Absolute(0.01),
        ),
        Comparison::reported("amplitude of the shear stress", "kPa", amplitude),
        Comparison::reported("change of porosity over the run", "-", end - first),
        Comparison::holds("contacts fall below the initial number", "[Liu2015] Fig. 8", fewer),
    ];
    let begun = loops.len() / 2;
    let mut first_picture = Chart::new(
        "[Liu2015] Fig. 8a: element 9",
        ("shear angle", Scale::Linear),
        ("shear stress, kPa", Scale::Linear),
    );
    first_picture.curve("first half of the run", loops[..begun].iter().copied());
    first_picture.curve("second half", loops[begun..].iter().copied());
    let milliseconds = ("time, ms", Scale::Linear);
    let mut second = Chart::new("[Liu2015] Fig. 8c: element 9", milliseconds, ("porosity", Scale::Linear));
    second.curve("porosity", porosity);
    let mut third = Chart::new("[Liu2015] Fig. 8d: element 9", milliseconds, ("contacts per grain", Scale::Linear));
    third.curve("contacts per grain", contacts);
    let charts = vec![("", first_picture), ("porosity", second), ("contacts", third)];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}
