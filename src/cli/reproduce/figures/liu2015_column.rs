//! [Liu2015] Fig. 8: shear wave in a column of bricks; loops of shear and compression of element 9, porosity and contacts. J-4.

use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-column",
    source: "[Liu2015] Figs. 7, 8",
    shows: "shear wave of 10 kHz in a column: loops of shear and compression, porosity and contacts of element 9",
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

/// Compression along the column, of a Green-Lagrange strain, row by row. Nothing strains across the column, so that its volume changes
/// as the length along it does: `1 - sqrt(det(I + 2 E))`. Shear leaves the volume as it is, but stretches the lines along the column.
fn compression(strain: &[f64]) -> f64 {
    let [along, sheared_y, sheared_z] = [strain[0], strain[1], strain[2]];
    1.0 - (1.0 + 2.0 * along - (2.0 * sheared_y).powi(2) - (2.0 * sheared_z).powi(2)).max(0.0).sqrt()
}

/// A picture of loops, the halves of the run apart.
fn halves(title: &str, x: &str, y: &str, loops: &[[f64; 2]]) -> Chart {
    let begun = loops.len() / 2;
    let mut chart = Chart::new(title, (x, Scale::Linear), (y, Scale::Linear));
    chart.curve("first half of the run", loops[..begun].iter().copied());
    chart.curve("second half", loops[begun..].iter().copied());
    chart
}

/// What the element that the paper plots does over the run.
#[derive(Default)]
struct Element {
    /// Shear stress, kPa, over the shear angle.
    shear: Curve,
    /// Compressive stress over compression, both along the column, kPa.
    compression: Curve,
    /// Shear stress, kPa, over time, s.
    stress: Curve,
    /// Porosity and coordination number over time, ms.
    porosity: Curve,
    contacts: Curve,
}

impl Element {
    fn read(run: &Finished) -> Result<Self, ReproduceError> {
        let mut element = Self::default();
        for [step, time] in run.table()?.curve("step", "time")? {
            let fields = Fields::read(run, step as usize)?;
            let of_element = |name: &str| -> Result<Vec<f64>, ReproduceError> {
                Ok(fields.element_values(name)?[9 * ELEMENT..9 * (ELEMENT + 1)].to_vec())
            };
            let (stress, strain) = (of_element("stress")?, of_element("strain")?);
            let void_ratio = fields.element_values("void_ratio")?[ELEMENT];
            // The tensor component is half the shear angle.
            element.shear.push([2.0 * strain[1], stress[1] / 1e3]);
            element.compression.push([compression(&strain), -stress[0] / 1e3]);
            element.stress.push([time, stress[1] / 1e3]);
            element.porosity.push([1e3 * time, void_ratio / (1.0 + void_ratio)]);
            element.contacts.push([1e3 * time, fields.element_values("coordination_number")?[ELEMENT]]);
        }
        Ok(element)
    }
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let run = results.run("column")?;
    let table = run.table()?;
    let Element { shear, compression, stress, porosity, contacts } = Element::read(run)?;
    let last = stress.last().map_or(0.0, |point| point[0]);
    let amplitude = stress.iter().map(|point| point[1].abs()).fold(0.0, f64::max);
    let in_last_period = stress.iter().filter(|point| point[0] > last - PERIOD);
    let open =
        in_last_period.map(|point| (point[1] - value_at(&stress, point[0] - PERIOD)).abs()).fold(0.0, f64::max);
    let begun = stress.iter().position(|point| point[0] >= last - PERIOD).unwrap_or(0);
    let taken = work(&shear[begun..]);
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
        Comparison::reported("largest compressive stress along the column", "kPa", peak(&compression)?[1]),
        Comparison::reported("smallest compressive stress along the column", "kPa", trough(&compression)?[1]),
        Comparison::reported("work of the shear stress over the last period", "kJ/m3", taken),
        Comparison::holds("the shear stress loses work over the last period", "[Liu2015] section 3.3", taken > 0.0),
        Comparison::reported("change of porosity over the run", "-", end - first),
        Comparison::holds("contacts fall below the initial number", "[Liu2015] Fig. 8", fewer),
    ];
    let shear_loops = halves("[Liu2015] Fig. 8a: element 9, shear", "shear angle", "shear stress, kPa", &shear);
    let compressive_loops = halves(
        "[Liu2015] Fig. 8a: element 9, compression",
        "compression along the column",
        "compressive stress along the column, kPa",
        &compression,
    );
    let over_time = |what: &str, curve: Curve| {
        let x = ("time, ms", Scale::Linear);
        let mut chart = Chart::new("[Liu2015] Fig. 8b: element 9", x, (what, Scale::Linear));
        chart.curve(what, curve);
        chart
    };
    let charts = vec![
        ("", shear_loops),
        ("compression", compressive_loops),
        ("porosity", over_time("porosity", porosity)),
        ("contacts", over_time("coordination number", contacts)),
    ];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strain of a deformation with the columns along y and z unchanged.
    #[test]
    fn shear_does_not_count_as_compression() {
        let (stretch, angle) = (0.99, 0.3);
        let along = 0.5 * (stretch * stretch + angle * angle - 1.0);
        let strain = [along, 0.5 * angle, 0.0, 0.5 * angle, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((compression(&strain) - 0.01).abs() < 1e-12);
    }
}
