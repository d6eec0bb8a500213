//! [Liu2015] Figs. 10 to 14: simple shear of a layer with a weak row, local, nonlocal and all grains at once. J-5.

use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::{Finished, Table};
use macro_solver::output::LayerBand;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-shear-layer",
    source: "[Liu2015] Figs. 10 to 14",
    shows: "simple shear of a layer with a weak row: stress, porosity, contacts, rotations, band, local, nonlocal and all grains",
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

/// Radius of the averages, m: the one that reaches the next row.
const RADIUS: f64 = 13.5e-3;

/// Shear angle of Fig. 14.
const OF_ROWS: f64 = 0.12;

/// Shear angles between which the paper has the stress fall, and from the second of which on the porosity stays as it is.
const SOFTENING: [f64; 2] = [0.06, 0.08];

/// Ratio that the rotation of the grains in the band over that outside exceeds, J-5.
const ROTATES_MORE: f64 = 2.0;

fn runs(size: Size) -> Vec<Run> {
    let scene = "scenes/liu2015/shear-layer.toml";
    // Below the distance of the rows nothing is averaged.
    let local = Run::new("local", scene, Command::Stopping, size).set("nonlocal.enabled=false");
    let nonlocal = Run::new("nonlocal", scene, Command::Stopping, size).set(format!("nonlocal.radius={RADIUS}"));
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

/// Values of a profile at a step over the heights of the rows, m.
fn rows_at(profile: &Table, step: f64) -> Result<Curve, ReproduceError> {
    let steps = profile.column("step")?;
    let rows = profile.curve("coordinate", "value")?;
    Ok(steps.iter().zip(rows).filter(|(at, _)| **at == step).map(|(_, row)| row).collect())
}

/// The step of a profile whose shear angle is nearest to one; NaN without steps.
fn step_at(profile: &Table, angles: &[[f64; 2]], angle: f64) -> Result<f64, ReproduceError> {
    let away = |step: f64| (value_at(angles, step) - angle).abs();
    let steps = profile.column("step")?.into_iter().filter(|step| away(*step).is_finite());
    Ok(steps.min_by(|one, other| away(*one).total_cmp(&away(*other))).unwrap_or(f64::NAN))
}

/// Means of the sizes of the values of the rows in the band and of those outside it; the band are the rows that grow more than half as
/// fast as the fastest.
fn in_band_and_outside(values: &[[f64; 2]], growth: &[[f64; 2]]) -> [f64; 2] {
    let most = growth.iter().map(|row| row[1]).fold(f64::NEG_INFINITY, f64::max);
    let mean = |of_band: bool| {
        let rows = values.iter().zip(growth).filter(|(_, growth)| (growth[1] > 0.5 * most) == of_band);
        let chosen: Vec<f64> = rows.map(|(row, _)| row[1].abs()).collect();
        chosen.iter().sum::<f64>() / chosen.len() as f64
    };
    [mean(true), mean(false)]
}

/// Sizes of the mean rotations of the grains in the rows of the band and in those outside it over the shear angle, rad.
fn rotations(run: &Finished, angles: &[[f64; 2]], growth: &[[f64; 2]]) -> Result<[Curve; 2], ReproduceError> {
    let profile = run.table_of("profiles/rotation.csv")?;
    let mut steps = profile.column("step")?;
    steps.dedup();
    let [mut inside, mut outside]: [Curve; 2] = Default::default();
    for step in steps {
        let means = in_band_and_outside(&rows_at(&profile, step)?, growth);
        let angle = value_at(angles, step);
        inside.push([angle, means[0]]);
        outside.push([angle, means[1]]);
    }
    Ok([inside, outside])
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
    rotations: Chart,
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
            voids: over_angle(12, "porosity"),
            contacts: over_angle(13, "coordination number"),
            rows: Chart::new(
                "[Liu2015] Fig. 14a: rows of the layer at a shear angle of 12 %",
                ("porosity", Scale::Linear),
                ("height, mm", Scale::Linear),
            ),
            rotations: Chart::new(
                "[Liu2015] Fig. 14b: grains of the cells in the band and outside it",
                ("shear angle of the layer", Scale::Linear),
                ("size of the mean rotation of the grains about z, rad", Scale::Linear),
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
            ("rotations", self.rotations),
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
    comparisons.extend(fall_of_stress(name, &shear)?);
    comparisons.push(band_width(format!("{name}: width of the band at the end"), band));
    comparisons.push(width_over_length(name, band));
    comparisons.push(Comparison::reported(
        format!("{name}: width of the band at the end, as probes have it"),
        "mm",
        1e3 * fitted(&growth),
    ));
    comparisons.push(void_ratio_grows(name, &over(table.column("void_ratio")?, 1.0)));
    let porosity = over(table.column("porosity")?, 1.0);
    comparisons.push(plateau_of_porosity(name, &porosity));
    let residual = table.column("energy_residual")?.iter().map(|value| value.abs()).fold(0.0, f64::max);
    comparisons.push(Comparison::reported(format!("{name}: residual of the energy balance"), "-", residual));
    let forces: Vec<f64> = table.column("top_force")?.iter().map(|force| force / AREA / 1e3).collect();
    charts.stress.curve(&format!("{name}, mean of the cells"), shear.clone());
    charts.stress.curve(&format!("{name}, force on the head"), over(forces, 1.0));
    charts.mean.curve(name, over(table.column("mean_pressure")?, 1e-3));
    charts.voids.curve(name, porosity);
    charts.contacts.curve(name, over(table.column("coordination_number")?, 1.0));
    let steps = table.column("step")?;
    let angles: Curve = steps.into_iter().zip(&angle).map(|(step, angle)| [step, *angle]).collect();
    let profile = run.table_of("profiles/porosity.csv")?;
    let rows = rows_at(&profile, step_at(&profile, &angles, OF_ROWS)?)?;
    charts.rows.curve(name, rows.into_iter().map(|[height, value]| [value, 1e3 * height]));
    let [inside, outside] = rotations(run, &angles, &growth)?;
    comparisons.extend(rotation_in_band(name, &inside, &outside));
    charts.rotations.curve(&format!("{name}, in the band"), inside);
    charts.rotations.curve(&format!("{name}, outside"), outside);
    let last = Fields::steps(run).last().copied().unwrap_or(0);
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
    comparisons.extend(fall_of_stress(name, &grains.shear)?);
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
    let porosity: Curve = grains.void.iter().map(|[angle, void]| [*angle, void / (1.0 + void)]).collect();
    comparisons.push(plateau_of_porosity(name, &porosity));
    charts.layers.curve(name, layers_of_grains(run)?);
    charts.stress.curve(&format!("{name}, force on the walls"), grains.shear);
    charts.mean.curve(name, grains.pressure);
    charts.voids.curve(name, porosity);
    charts.contacts.curve(name, grains.contacts);
    Ok(())
}

fn largest(name: &str, shear: &[[f64; 2]]) -> Result<Comparison, ReproduceError> {
    Ok(Comparison::reported(format!("{name}: largest shear stress"), "kPa", peak(shear)?[1]))
}

/// How much of the largest shear stress is lost until the last fifth of the run, and where half of that is lost first. The paper gives the
/// shear angles of the fall, and no size of it.
fn fall_of_stress(name: &str, shear: &[[f64; 2]]) -> Result<[Comparison; 2], ReproduceError> {
    let (top, end) = (peak(shear)?, shear[shear.len() - 1]);
    let late = mean_between(shear, 0.8 * end[0], end[0]);
    let drop = format!("{name}: drop from the largest shear stress to the last fifth of the run, over the largest");
    Ok([
        Comparison::reported(drop, "-", 1.0 - late / top[1]),
        Comparison::new(
            format!("{name}: shear angle at which half of this drop is passed first"),
            "-",
            Theirs::Between(SOFTENING[0], SOFTENING[1]),
            "[Liu2015] section 3.4",
            crossing(shear, 0.5 * (top[1] + late), top[0]),
            Tolerance::Absolute(0.0),
        ),
    ])
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

/// Of a width in m over the length that sets it in J-5: without averages the height of a row, with them their diameter.
fn width_over_length(name: &str, width: f64) -> Comparison {
    let (length, size, theirs) = match name {
        "nonlocal" => ("2 R of the averages", 2.0 * RADIUS, Theirs::Value(1.0)),
        _ => ("a row", ROW, Theirs::Between(1.0, 1.5)),
    };
    let what = format!("{name}: width of the band over {length}");
    Comparison::new(what, "-", theirs, "band of J-5", width / size, Tolerance::Relative(0.2))
}

/// Reported without a tolerance: neither the paper nor J-5 says how level a plateau is.
fn plateau_of_porosity(name: &str, porosity: &[[f64; 2]]) -> Comparison {
    let (first, end) = (porosity[0], porosity[porosity.len() - 1]);
    let softened = value_at(porosity, SOFTENING[1]);
    Comparison::new(
        format!("{name}: growth of the porosity past a shear angle of 8 %, over that until then"),
        "-",
        Theirs::Value(0.0),
        "[Liu2015] section 3.4: constant",
        (end[1] - softened) / (softened - first[1]),
        Tolerance::Nothing,
    )
}

/// At the shear angle of Fig. 14, or at the end of a run that does not reach it.
fn rotation_in_band(name: &str, inside: &[[f64; 2]], outside: &[[f64; 2]]) -> [Comparison; 2] {
    let until =
        |curve: &[[f64; 2]]| curve.iter().rfind(|point| point[0] <= OF_ROWS).map_or(f64::NAN, |point| point[1]);
    let ratio = until(inside) / until(outside);
    let what = format!("{name}: rotation in the band over that outside");
    [
        Comparison::reported(what.clone(), "-", ratio),
        Comparison::holds(format!("{what} is more than 2"), "band of J-5", ratio > ROTATES_MORE),
    ]
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
    use super::*;

    #[test]
    fn the_width_is_taken_at_half_of_the_largest_value() {
        assert!((width(&[[0.0, 0.0], [1.0, 0.0], [2.0, 2.0], [3.0, 2.0], [4.0, 0.0]]) - 2.0).abs() < 1e-12);
        assert_eq!(width(&[[0.0, 1.0], [1.0, 1.0]]), 1.0);
    }

    #[test]
    fn rows_that_shear_less_than_half_as_fast_as_the_fastest_are_outside_the_band() {
        let growth = [[0.0, 0.1], [1.0, 0.2], [2.0, 1.0], [3.0, 0.6]];
        let rotations = [[0.0, -0.1], [1.0, 0.3], [2.0, -4.0], [3.0, -2.0]];
        assert_eq!(in_band_and_outside(&rotations, &growth), [3.0, 0.2]);
    }

    #[test]
    fn the_rotations_are_compared_at_the_angle_of_the_figure() {
        let inside = [[0.0, 0.0], [0.11, 0.6], [0.15, 0.9]];
        let outside = [[0.0, 0.0], [0.11, 0.2], [0.15, 0.1]];
        let [ratio, more] = rotation_in_band("local", &inside, &outside);
        assert_eq!(ratio, Comparison::reported("local: rotation in the band over that outside", "-", 0.6 / 0.2));
        assert_eq!(more, Comparison::holds(more.quantity().to_owned(), "band of J-5", true));
    }

    #[test]
    fn the_fall_of_the_stress_is_where_half_of_it_is_lost() {
        let shear = [[0.0, 0.0], [0.02, 4.0], [0.06, 4.0], [0.08, 2.0], [0.18, 2.0], [0.2, 2.0]];
        let [drop, angle] = fall_of_stress("local", &shear).unwrap();
        assert_eq!(drop, Comparison::reported(drop.quantity().to_owned(), "-", 0.5));
        let half = crossing(&shear, 3.0, 0.06);
        assert!((half - 0.07).abs() < 1e-12);
        let theirs = Theirs::Between(0.06, 0.08);
        let (what, source) = (angle.quantity().to_owned(), "[Liu2015] section 3.4");
        assert_eq!(angle, Comparison::new(what, "-", theirs, source, half, Tolerance::Absolute(0.0)));
    }
}
