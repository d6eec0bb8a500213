//! [Liu2015] Fig. 6: one element against its own cell, in plane strain compression and simple shear. J-3.

use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-element",
    source: "[Liu2015] Figs. 5, 6",
    shows: "one brick against its own cell: plane strain compression and simple shear at 416 kPa",
    run_time: ("20 s", "5 min"),
    entries: &[("J-3", "")],
    runs,
    evaluate,
};

fn runs(size: Size) -> Vec<Run> {
    vec![
        Run::new("biaxial", "scenes/liu2015/element-biaxial.toml", Command::Stopping, size),
        Run::new("biaxial-cell", "scenes/liu2015/cell-biaxial.toml", Command::Element(None), size),
        Run::new("shear", "scenes/liu2015/element-shear.toml", Command::Stopping, size),
        Run::new("shear-cell", "scenes/liu2015/cell-shear.toml", Command::Element(None), size),
    ]
}

/// Ratio of the principal stresses in the plane is `1 + q / 416 kPa`; this is q in kPa.
fn deviator(yy: &[f64], xx: &[f64]) -> Vec<f64> {
    yy.iter().zip(xx).map(|(yy, xx)| (xx - yy) / 1e3).collect()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut biaxial = Chart::new(
        "[Liu2015] Fig. 6a: plane strain compression",
        ("axial compression", Scale::Linear),
        ("s11 - s22, kPa", Scale::Linear),
    );
    let body = results.run("biaxial")?.table()?;
    let ours = crate::cli::reproduce::curve::curve(
        &body.column("axial_compression")?,
        &deviator(&body.column("sigma_yy")?, &body.column("sigma_xx")?),
    );
    let cell = results.run("biaxial-cell")?.table()?;
    let compression: Vec<f64> = cell.column("F_yy")?.iter().map(|stretch| 1.0 - stretch).collect();
    let alone = crate::cli::reproduce::curve::curve(
        &compression,
        &deviator(&cell.column("sigma_yy")?, &cell.column("sigma_xx")?),
    );
    let mut comparisons = vec![agreement("plane strain compression", &ours, &alone)];
    comparisons.push(Comparison::reported("largest s11 - s22", "kPa", peak(&ours)?[1]));
    biaxial.curve("one element", ours);
    biaxial.reference("its cell alone", alone);

    let mut shear = Chart::new(
        "[Liu2015] Fig. 6b: simple shear",
        ("shear angle", Scale::Linear),
        ("shear stress, kPa", Scale::Linear),
    );
    let in_kpa = |curve: Curve| -> Curve { curve.into_iter().map(|[x, y]| [x, y / 1e3]).collect() };
    let ours = in_kpa(results.run("shear")?.table()?.curve("shear_displacement", "shear_stress")?);
    let ours: Curve = ours.into_iter().map(|[x, y]| [x / 0.01, y]).collect();
    let alone = in_kpa(results.run("shear-cell")?.table()?.curve("F_xy", "sigma_xy")?);
    comparisons.push(agreement("simple shear", &ours, &alone));
    comparisons.push(Comparison::reported("largest shear stress", "kPa", peak(&ours)?[1]));
    shear.curve("one element", ours);
    shear.reference("its cell alone", alone);
    Ok(Outcome {
        charts: vec![("biaxial", biaxial), ("shear", shear)],
        comparisons,
        notes: results.notes(),
        ..Outcome::default()
    })
}

/// Share of the path of the cell that its element has to reach to be compared with it.
const COMPARED: f64 = 0.95;

/// Largest difference of two curves, over the largest value; not met by an element that stops on its way.
fn agreement(test: &str, element: &[[f64; 2]], cell: &[[f64; 2]]) -> Comparison {
    let scale = cell.iter().map(|point| point[1].abs()).fold(0.0, f64::max);
    let differences = element.iter().map(|point| (point[1] - value_at(cell, point[0])).abs() / scale);
    let largest = differences.filter(|value| value.is_finite()).fold(0.0, f64::max);
    let end = |curve: &[[f64; 2]]| curve.last().map_or(0.0, |point| point[0]);
    let largest = if end(element) >= COMPARED * end(cell) && end(cell) > 0.0 { largest } else { f64::NAN };
    Comparison::new(
        format!("largest difference of element and cell, {test}, over the largest stress"),
        "-",
        Theirs::Value(0.0),
        "[Liu2015] section 3.2: almost identical; band of J-3",
        largest,
        Tolerance::Absolute(0.01),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::comparison::comparison_csv;

    #[test]
    fn an_element_that_stops_on_its_way_does_not_agree() {
        let cell = [[0.0, 0.0], [0.1, 2.0], [0.2, 2.0]];
        let met = |element: &[[f64; 2]]| {
            let table = comparison_csv(&[agreement("test", element, &cell)]).unwrap();
            String::from_utf8(table).unwrap().trim_end().rsplit(',').next().unwrap().to_owned()
        };
        assert_eq!(met(&cell), "yes");
        assert_eq!(met(&[[0.0, 0.0], [0.1, 2.1], [0.2, 2.0]]), "no");
        assert_eq!(met(&cell[..1]), "no");
        assert_eq!(met(&cell[..2]), "no");
    }
}
