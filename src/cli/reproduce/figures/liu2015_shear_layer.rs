//! [Liu2015] Figs. 10 to 14: simple shear of a layer with a weak row, local, nonlocal and all grains at once. J-5.

use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;
use macro_solver::output::LayerBand;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-shear-layer",
    source: "[Liu2015] Figs. 10 to 14",
    shows: "simple shear of a layer with a weak row: stress, porosity, contacts, width of the band, local, nonlocal and all grains",
    run_time: ("6 min", "8 h"),
    entries: &[("J-5", "")],
    runs,
    evaluate,
};

/// Height of the layer and of a row of elements, m.
const HEIGHT: f64 = 0.118;
const ROW: f64 = HEIGHT / 12.0;

/// Area of the top, m2.
const AREA: f64 = 0.0506 * 0.0127;

fn runs(size: Size) -> Vec<Run> {
    let scene = "scenes/liu2015/shear-layer.toml";
    // Below the distance of the rows nothing is averaged.
    let local = Run::new("local", scene, Command::Stopping, size).set("nonlocal.enabled=false");
    let nonlocal = Run::new("nonlocal", scene, Command::Stopping, size).set("nonlocal.radius=13.5e-3");
    let grains = Run::new("grains", "scenes/liu2015/grains-shear-layer.toml", Command::Specimen, size);
    vec![local, nonlocal, grains]
}

/// Width of the zone that shears more than half as fast as the fastest row, m, with straight lines between the rows.
fn width(profile: &[[f64; 2]]) -> f64 {
    let most = profile.iter().map(|point| point[1]).fold(f64::NEG_INFINITY, f64::max);
    let above = |from: &[f64; 2], to: &[f64; 2]| {
        let (low, high) = (from[1].min(to[1]), from[1].max(to[1]));
        let share = if high <= 0.5 * most {
            0.0
        } else if low >= 0.5 * most {
            1.0
        } else {
            (high - 0.5 * most) / (high - low)
        };
        share * (to[0] - from[0])
    };
    profile.windows(2).map(|pair| above(&pair[0], &pair[1])).sum()
}

/// Full width at half height of the Gaussian ridge that fits the growth of the rows, m; NaN where none fits.
fn fitted(profile: &[[f64; 2]]) -> f64 {
    let layers: Vec<[f64; 3]> = profile.iter().map(|[height, value]| [*height, 1.0, *value]).collect();
    LayerBand::across(&layers).map_or(f64::NAN, |band| band.width)
}

/// Width of the band of grains, m, and share of the growth that it explains: medians of the rows between 10 and 14 % of shear.
fn band_of_grains(run: &Finished) -> Result<[f64; 2], ReproduceError> {
    let shear = run.table()?.curve("step", "shear_xy")?;
    let table = run.table_of("layers/band.csv")?;
    let median = |column: &str| -> Result<f64, ReproduceError> {
        let rows = table.curve("step", column)?;
        let is_late = |row: &&[f64; 2]| (0.1..=0.14).contains(&value_at(&shear, row[0])) && row[1].is_finite();
        Ok(median_of(rows.iter().filter(is_late).map(|row| row[1]).collect()))
    };
    Ok([median("band_width")?, median("band_quality")?])
}

/// Shear strain of the layers of grains in the last row over their height, which is taken from the outermost interfaces.
fn layers_of_grains(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table_of("layers/profile.csv")?;
    let (step, strain) = (table.column("step")?, table.column("shear_strain")?);
    let heights = table.column("coordinate")?;
    let last = step.last().copied().unwrap_or(f64::NAN);
    let end: Curve =
        (0..step.len()).filter(|row| step[*row] == last).map(|row| [strain[row], heights[row]]).collect();
    let (low, high) = match end[..] {
        [[_, low], [_, next], .., [_, high]] => (low - (next - low), high + (next - low)),
        _ => (0.0, 1.0),
    };
    Ok(end.into_iter().map(|[strain, height]| [strain, (height - low) / (high - low)]).collect())
}

/// Growth of the shear angle of each row over the last two fields.
fn growth(run: &Finished) -> Result<Vec<[f64; 2]>, ReproduceError> {
    let steps = Fields::steps(run);
    let [.., before, last] = steps[..] else {
        return Err(ReproduceError::NotFound(format!("{} has fewer than two fields", run.folder().display())));
    };
    let rows = |step: usize| Fields::read(run, step)?.profile("shear_strain", 1);
    let (before, last) = (rows(before)?, rows(last)?);
    Ok(last.iter().zip(&before).map(|(last, before)| [last[0], last[1] - before[1]]).collect())
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut charts = Charts::new();
    let mut comparisons = Vec::new();
    let mut multiscale = Vec::new();
    for name in ["local", "nonlocal"] {
        multiscale.push((name, cells(name, results.run(name)?, &mut charts, &mut comparisons)?));
    }
    all_grains(results.run("grains")?, &multiscale, &mut charts, &mut comparisons)?;
    Ok(Outcome { charts: charts.in_order(), comparisons, notes: results.notes(), ..Outcome::default() })
}

/// The pictures of the figure.
struct Charts {
    stress: Chart,
    mean: Chart,
    voids: Chart,
    contacts: Chart,
    rows: Chart,
    layers: Chart,
}

impl Charts {
    fn new() -> Self {
        let over_angle = |number: u32, what: &str| {
            let title = format!("[Liu2015] Fig. {number}: layer in simple shear");
            Chart::new(&title, ("shear angle of the layer", Scale::Linear), (what, Scale::Linear))
        };
        Self {
            stress: over_angle(10, "shear stress, kPa"),
            mean: over_angle(11, "mean pressure, kPa"),
            voids: over_angle(12, "mean void ratio"),
            contacts: over_angle(13, "contacts per grain"),
            rows: Chart::new(
                "[Liu2015] Fig. 14: rows of the layer at the end",
                ("void ratio", Scale::Linear),
                ("height, mm", Scale::Linear),
            ),
            layers: Chart::new(
                "[Liu2015] section 3.4: where the layer shears, at the end",
                ("shear strain", Scale::Linear),
                ("height over that of the layer", Scale::Linear),
            ),
        }
    }

    fn in_order(self) -> Vec<(&'static str, Chart)> {
        vec![
            ("", self.stress),
            ("mean-pressure", self.mean),
            ("voids", self.voids),
            ("contacts", self.contacts),
            ("profile", self.rows),
            ("layers", self.layers),
        ]
    }
}

/// Adds what the run of cells has; returns its shear stress over the angle, kPa.
fn cells(
    name: &str,
    run: &Finished,
    charts: &mut Charts,
    comparisons: &mut Vec<Comparison>,
) -> Result<Curve, ReproduceError> {
    let table = run.table()?;
    let angle: Vec<f64> = table.column("shear_displacement")?.iter().map(|way| way / HEIGHT).collect();
    let over = |values: Vec<f64>, factor: f64| -> Curve {
        angle.iter().zip(values).map(|(x, y)| [*x, factor * y]).collect()
    };
    let shear = over(table.column("shear_stress")?, 1e-3);
    let growth = growth(run)?;
    let band = width(&growth);
    comparisons.push(largest(name, &shear)?);
    comparisons.push(drop_past_the_largest(name, &shear)?);
    comparisons.push(band_width(format!("{name}: width of the band at the end"), band));
    comparisons.push(Comparison::reported(format!("{name}: width of the band over a row"), "-", band / ROW));
    comparisons.push(Comparison::reported(
        format!("{name}: width of the band at the end, as probes have it"),
        "mm",
        1e3 * fitted(&growth),
    ));
    let void = over(table.column("void_ratio")?, 1.0);
    comparisons.push(void_ratio_grows(name, &void));
    let residual = table.column("energy_residual")?.iter().map(|value| value.abs()).fold(0.0, f64::max);
    comparisons.push(Comparison::reported(format!("{name}: residual of the energy balance"), "-", residual));
    let forces: Vec<f64> = table.column("top_force")?.iter().map(|force| force / AREA / 1e3).collect();
    charts.stress.curve(&format!("{name}, mean of the cells"), shear.clone());
    charts.stress.curve(&format!("{name}, force on the head"), over(forces, 1.0));
    charts.mean.curve(name, over(table.column("mean_pressure")?, 1e-3));
    charts.voids.curve(name, void);
    charts.contacts.curve(name, over(table.column("coordination_number")?, 1.0));
    let last = Fields::steps(run).last().copied().unwrap_or(0);
    let profile = Fields::read(run, last)?.profile("void_ratio", 1)?;
    charts.rows.curve(name, profile.into_iter().map(|[height, value]| [value, 1e3 * height]));
    let sheared = Fields::read(run, last)?.profile("shear_strain", 1)?;
    charts.layers.curve(name, sheared.into_iter().map(|[height, value]| [value, height / HEIGHT]));
    Ok(shear)
}

/// Adds what the run of all grains has, next to the shear stresses of those of cells.
fn all_grains(
    run: &Finished,
    multiscale: &[(&str, Curve)],
    charts: &mut Charts,
    comparisons: &mut Vec<Comparison>,
) -> Result<(), ReproduceError> {
    let name = "all grains";
    let [width, quality] = band_of_grains(run)?;
    comparisons.push(band_width(format!("{name}: width of the band, 10 to 14 % of shear"), width));
    comparisons.push(Comparison::reported(
        format!("{name}: share of the growth of the layers that the band explains"),
        "-",
        quality,
    ));
    let grains = Grains::read(run)?;
    comparisons.push(largest(name, &grains.shear)?);
    comparisons.push(Comparison::reported(
        format!("{name}: shear angle at the largest shear stress"),
        "-",
        peak(&grains.shear)?[0],
    ));
    comparisons.push(drop_past_the_largest(name, &grains.shear)?);
    let end = grains.shear[grains.shear.len() - 1][0];
    for (name, shear) in multiscale {
        // Both at the same angles, where both have rows.
        let last = end.min(shear[shear.len() - 1][0]);
        let mean = |curve: &Curve| mean_between(curve, 0.2 * last, last);
        comparisons.push(Comparison::reported(
            format!("{name}: mean shear stress past a fifth of the run, over that of all grains"),
            "-",
            mean(shear) / mean(&grains.shear),
        ));
    }
    comparisons.push(void_ratio_grows(name, &grains.void));
    charts.layers.curve(name, layers_of_grains(run)?);
    charts.stress.curve(&format!("{name}, force on the walls"), grains.shear);
    charts.mean.curve(name, grains.pressure);
    charts.voids.curve(name, grains.void);
    charts.contacts.curve(name, grains.contacts);
    Ok(())
}

fn largest(name: &str, shear: &[[f64; 2]]) -> Result<Comparison, ReproduceError> {
    Ok(Comparison::reported(format!("{name}: largest shear stress"), "kPa", peak(shear)?[1]))
}

fn drop_past_the_largest(name: &str, shear: &[[f64; 2]]) -> Result<Comparison, ReproduceError> {
    let (top, end) = (peak(shear)?, shear[shear.len() - 1]);
    let late = mean_between(shear, 0.8 * end[0], end[0]);
    Ok(Comparison::new(
        format!("{name}: drop from the largest shear stress to the last fifth of the run, over the largest"),
        "-",
        Theirs::Between(0.06, 0.08),
        "[Liu2015] section 3.4",
        1.0 - late / top[1],
        Tolerance::Absolute(0.05),
    ))
}

/// Of a width in m.
fn band_width(what: String, width: f64) -> Comparison {
    Comparison::new(
        what,
        "mm",
        Theirs::Between(13.0, 16.0),
        "[Liu2015] section 3.4, at 12 %",
        1e3 * width,
        Tolerance::Relative(0.2),
    )
}

fn void_ratio_grows(name: &str, void: &[[f64; 2]]) -> Comparison {
    let what = format!("{name}: void ratio grows over the run");
    Comparison::holds(what, "[Liu2015] section 3.4", void[void.len() - 1][1] > void[0][1])
}

/// Curves of the layer of grains over its shear angle.
struct Grains {
    /// Shear stress of the glued layers, kPa.
    shear: Curve,
    /// Mean pressure of the contacts, kPa.
    pressure: Curve,
    void: Curve,
    contacts: Curve,
}

impl Grains {
    fn read(run: &Finished) -> Result<Self, ReproduceError> {
        let table = run.table()?.stage("shear")?;
        let curve = |column: &str, factor: f64| -> Result<Curve, ReproduceError> {
            Ok(table.curve("shear_xy", column)?.into_iter().map(|[x, y]| [x, factor * y]).collect())
        };
        let [xx, yy, zz] = ["sigma_xx", "sigma_yy", "sigma_zz"].map(|column| curve(column, -1e-3 / 3.0));
        let pressure = xx?.into_iter().zip(yy?).zip(zz?).map(|((xx, yy), zz)| [xx[0], xx[1] + yy[1] + zz[1]]);
        Ok(Self {
            shear: curve("wall_sigma_xy", 1e-3)?,
            pressure: pressure.collect(),
            void: curve("void_ratio", 1.0)?,
            contacts: curve("coordination_number", 1.0)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::width;

    #[test]
    fn the_width_is_taken_at_half_of_the_largest_value() {
        assert!((width(&[[0.0, 0.0], [1.0, 0.0], [2.0, 2.0], [3.0, 2.0], [4.0, 0.0]]) - 2.0).abs() < 1e-12);
        assert_eq!(width(&[[0.0, 1.0], [1.0, 1.0]]), 1.0);
    }
}
