//! [Liu2015] Figs. 16 to 19: plane strain compression on three meshes, local and nonlocal. J-6, J-7.

use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-biaxial",
    source: "[Liu2015] Figs. 16 to 19",
    shows: "plane strain compression on three meshes: stress ratio and shear band, local and nonlocal",
    run_time: ("15 min", "15 h"),
    entries: &[("J-6", "width of the band on"), ("J-6", "spread"), ("J-7", "inclination of the band")],
    runs,
    evaluate,
};

const MESHES: [(usize, usize); 3] = [(4, 8), (6, 12), (8, 16)];

/// Width of the body, m.
const WIDTH: f64 = 0.04;

/// Share of the variance of the strain from which on a fitted band counts as one.
const CLEAR: f64 = 0.5;

/// Compression over which stress ratios are averaged before they are compared: cells and waves scatter them.
const WINDOW: f64 = 4e-3;

/// Compression from which on bands are looked for: past the peak. Before it waves and the weak corner are fitted.
const PAST_PEAK: f64 = 0.01;

/// Compression that a run has to reach to be drawn.
const SHORTEST: f64 = 0.02;

/// Name of a run. On the coarsest mesh the points are farther apart than the radius: averages change nothing, and one run serves for both.
fn name(kind: &str, mesh: (usize, usize)) -> String {
    let kind = if mesh == MESHES[0] { "local" } else { kind };
    format!("{kind}-{}x{}", mesh.0, mesh.1)
}

fn runs(size: Size) -> Vec<Run> {
    let run = |kind: &str, mesh: (usize, usize)| {
        let run = Run::new(name(kind, mesh), "scenes/liu2015/biaxial.toml", Command::Stopping, size)
            .set(format!("mesh.elements=[{}, {}, 1]", mesh.0, mesh.1));
        // Below the distance of the points nothing is averaged.
        if kind == "local" { run.set("nonlocal.enabled=false") } else { run }
    };
    let nonlocal = MESHES[1..].iter().map(|mesh| run("nonlocal", *mesh));
    MESHES.map(|mesh| run("local", mesh)).into_iter().chain(nonlocal).collect()
}

/// What the run of one mesh says.
struct MeshResult {
    mesh: (usize, usize),
    label: String,
    /// Size of a brick, mm.
    brick: f64,
    /// Stress ratio of the body over compression, and its running mean.
    ratio: Curve,
    mean_ratio: Curve,
    /// Change of volume over compression.
    volume: Curve,
    /// Width, mm, and inclination, degrees, of the band over compression, where there is a clear one.
    width: Curve,
    inclination: Curve,
    /// Compressive strain of the elements at the last step that all runs have written.
    field: Panel,
}

fn mesh_result(run: &Finished, mesh: (usize, usize), step: usize) -> Result<MeshResult, ReproduceError> {
    let table = run.table()?;
    let over = |column: &str| table.curve("axial_compression", column);
    let quality = table.column("band_quality")?;
    let clear = |curve: Curve, factor: f64| -> Curve {
        let rows = curve.into_iter().zip(&quality);
        rows.filter(|([x, _], quality)| *x >= PAST_PEAK && **quality >= CLEAR)
            .map(|([x, y], _)| [x, factor * y.abs()])
            .collect()
    };
    let ratio = over("stress_ratio")?;
    let label = format!("{} x {} bricks", mesh.0, mesh.1);
    let patches = match Fields::steps(run).contains(&step) {
        true => {
            let fields = Fields::read(run, step)?;
            // The Green-Lagrange strain as a change of length, compression positive.
            let strains = fields.element_values("strain")?;
            let compressions = strains.chunks_exact(9).map(|strain| 1.0 - (1.0 + 2.0 * strain[4]).max(0.0).sqrt());
            fields.outlines()?.into_iter().zip(compressions).collect()
        }
        false => Vec::new(),
    };
    Ok(MeshResult {
        mesh,
        brick: 1e3 * WIDTH / mesh.0 as f64,
        mean_ratio: running_mean(&ratio, WINDOW),
        ratio,
        volume: over("volume_change")?,
        width: clear(over("band_width")?, 1e3),
        inclination: clear(over("band_inclination")?, 1.0),
        field: Panel { name: label.clone(), patches },
        label,
    })
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let x = ("axial compression", Scale::Linear);
    let mut outcome = Outcome { notes: results.notes(), ..Outcome::default() };
    let mut widths = Chart::new("[Liu2015] section 3.5: shear band", x, ("width of the band, mm", Scale::Linear));
    let mut spreads = Vec::new();
    let step = last_common_step(results)?;
    let table = results.run(&name("local", MESHES[0]))?.table()?;
    let compression = value_at(&table.curve("step", "axial_compression")?, step as f64);
    for (kind, parts, figures) in
        [("local", ["local", "local-map"], ["16", "17"]), ("nonlocal", ["nonlocal", "nonlocal-map"], ["18", "19"])]
    {
        let meshes = MESHES.map(|mesh| mesh_result(results.run(&name(kind, mesh))?, mesh, step));
        let mut meshes = meshes.into_iter().collect::<Result<Vec<MeshResult>, ReproduceError>>()?;
        meshes.retain(|mesh| {
            let kept = reach(&mesh.ratio) >= SHORTEST;
            if !kept {
                outcome
                    .notes
                    .push(format!("{kind}, {}: left out, it has reached too little compression", mesh.label));
            }
            kept
        });
        let title = format!("[Liu2015] Fig. {}: {kind}, three meshes", figures[0]);
        let mut chart = Chart::new(&title, x, ("stress ratio", Scale::Linear));
        // The coarsest mesh has one run for both kinds.
        let own: Vec<&MeshResult> = meshes.iter().filter(|mesh| kind == "local" || mesh.mesh != MESHES[0]).collect();
        for mesh in &own {
            widths.curve(&format!("{kind}, {}", mesh.label), mesh.width.clone());
        }
        for mesh in &meshes {
            chart.curve(&mesh.label, mesh.ratio.clone());
        }
        outcome.charts.push((parts[0], chart));
        if meshes.is_empty() {
            continue;
        }
        let end = meshes.iter().map(|mesh| reach(&mesh.ratio)).fold(f64::INFINITY, f64::min);
        outcome.maps.push((
            parts[1],
            Map {
                title: format!("[Liu2015] Fig. {}: {kind}, three meshes", figures[1]),
                quantity: format!("compressive strain at {:.1} % compression", 100.0 * compression),
                panels: meshes.iter().map(|mesh| mesh.field.clone()).collect(),
            },
        ));
        outcome.comparisons.extend(of_meshes(kind, &own, end)?);
        let [before, past] = apart(&meshes, end)?;
        spreads.push(past);
        let label = format!("{kind}: spread of the meshes");
        outcome.comparisons.push(Comparison::reported(
            format!("{label} before the peak, over the peak"),
            "-",
            before,
        ));
        let label = format!("{label} past the peak, over the peak");
        outcome.comparisons.push(match kind {
            "nonlocal" => Comparison::new(
                label,
                "-",
                Theirs::Value(0.0),
                "[Liu2015] section 3.5: nearly identical; band of J-6",
                past,
                Tolerance::Absolute(0.05),
            ),
            _ => Comparison::reported(label, "-", past),
        });
        let late = |mesh: &MeshResult| mean_between(&mesh.width, 0.8 * end, end);
        if meshes.len() < MESHES.len() {
            continue;
        }
        outcome.comparisons.push(Comparison::new(
            format!("{kind}: width of the band on {} over that on {}", meshes[1].label, meshes[2].label),
            "-",
            Theirs::Value(if kind == "local" { meshes[1].brick / meshes[2].brick } else { 1.0 }),
            "[Liu2015] section 3.5: the bricks without averages, similar with them; band of J-6",
            late(&meshes[1]) / late(&meshes[2]),
            Tolerance::Absolute(0.15),
        ));
    }
    if outcome.notes.iter().all(|note| !note.contains("left out")) {
        outcome.comparisons.push(Comparison::holds(
            "the spread past the peak is larger without averages",
            "[Liu2015] section 3.5",
            spreads[0] > spreads[1],
        ));
    }
    outcome.charts.push(("band", widths));
    Ok(outcome)
}

/// Compression that a run has reached.
fn reach(curve: &[[f64; 2]]) -> f64 {
    curve.last().map_or(0.0, |row| row[0])
}

/// The last step whose fields every run that is drawn has written: a run may have stopped early.
fn last_common_step(results: &Results) -> Result<usize, ReproduceError> {
    let mut common: Option<Vec<usize>> = None;
    for run in runs(Size::Small) {
        let run = results.run(&run.name)?;
        if reach(&run.table()?.curve("axial_compression", "stress_ratio")?) < SHORTEST {
            continue;
        }
        let steps = Fields::steps(run);
        common = Some(match common {
            None => steps,
            Some(common) => common.into_iter().filter(|step| steps.contains(step)).collect(),
        });
    }
    let last = common.and_then(|steps| steps.last().copied());
    last.ok_or_else(|| ReproduceError::NotFound("the runs have no fields of the same step".to_owned()))
}

/// Stress ratio and band of each mesh; the end is the last fifth of the run.
fn of_meshes(kind: &str, meshes: &[&MeshResult], end: f64) -> Result<Vec<Comparison>, ReproduceError> {
    let mut rows = Vec::new();
    for mesh in meshes {
        let label = format!("{kind}, {}", mesh.label);
        let late = |curve: &[[f64; 2]]| mean_between(curve, 0.8 * end, end);
        let top = peak(&mesh.mean_ratio)?;
        rows.push(Comparison::reported(format!("{label}: largest stress ratio"), "-", top[1]));
        rows.push(Comparison::reported(
            format!("{label}: stress ratio at the end over the largest"),
            "-",
            late(&mesh.ratio) / top[1],
        ));
        rows.push(Comparison::reported(format!("{label}: width of the band at the end"), "mm", late(&mesh.width)));
        rows.push(Comparison::reported(
            format!("{label}: width of the band over a brick"),
            "-",
            late(&mesh.width) / mesh.brick,
        ));
        let [roscoe, coulomb] = angles(mesh)?;
        rows.push(Comparison::new(
            format!("{label}: inclination of the band at the end"),
            "degrees",
            Theirs::Between(roscoe, coulomb),
            "angles of Roscoe and Coulomb of the body at its peak, J-7",
            late(&mesh.inclination),
            Tolerance::Absolute(3.0),
        ));
    }
    Ok(rows)
}

/// Roscoe's and Coulomb's inclination of a band from the direction of the lateral pressure, degrees: 45 degrees and half the angle of
/// dilatancy, past the peak, or half that of friction, at the peak.
fn angles(mesh: &MeshResult) -> Result<[f64; 2], ReproduceError> {
    let ratio = peak(&mesh.mean_ratio)?[1];
    let volume = |strain: f64| value_at(&mesh.volume, strain);
    let dilation = (volume(0.015) - volume(0.005)) / 0.01;
    let sines = [dilation / (2.0 + dilation), (ratio - 1.0) / (ratio + 1.0)];
    Ok(sines.map(|sine| 45.0 + 0.5 * sine.asin().to_degrees()))
}

/// Spread of the mean stress ratios of the meshes before and past the peak of the finest, over that peak.
fn apart(meshes: &[MeshResult], end: f64) -> Result<[f64; 2], ReproduceError> {
    let curves: Vec<&Curve> = meshes.iter().map(|mesh| &mesh.mean_ratio).collect();
    let top = peak(curves[curves.len() - 1])?;
    Ok([spread(&curves, 0.0, 0.6 * top[0]) / top[1], spread(&curves, top[0], end - 0.5 * WINDOW) / top[1]])
}

/// The mean over a range of abscissas around each point.
fn running_mean(curve: &[[f64; 2]], window: f64) -> Curve {
    curve.iter().map(|[x, _]| [*x, mean_between(curve, x - 0.5 * window, x + 0.5 * window)]).collect()
}

/// Mean over a range of strain of the difference between the highest and the lowest curve.
fn spread(curves: &[&Curve], from: f64, to: f64) -> f64 {
    let at = |share: u32| {
        let strain = from + (to - from) * f64::from(share) / 50.0;
        let values = curves.iter().map(|curve| value_at(curve, strain)).filter(|value| value.is_finite());
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let widths: Vec<f64> = (1..50).map(at).map(|(low, high)| high - low).filter(|width| width.is_finite()).collect();
    widths.iter().sum::<f64>() / widths.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averages_reach_half_a_window_to_both_sides() {
        let curve: Curve = (0..11).map(|i| [f64::from(i), if i % 2 == 0 { 1.0 } else { 3.0 }]).collect();
        let mean = running_mean(&curve, 2.0);
        assert!((mean[4][1] - 7.0 / 3.0).abs() < 1e-12 && (mean[5][1] - 5.0 / 3.0).abs() < 1e-12);
        assert!((mean[0][1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_spread_is_that_of_the_outermost_curves() {
        let level = |y: f64| -> Curve { vec![[0.0, y], [1.0, y]] };
        let [one, two, three] = [level(1.0), level(1.5), level(3.0)];
        assert!((spread(&[&one, &two, &three], 0.0, 1.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_coarsest_mesh_runs_once() {
        let names: Vec<String> = runs(Size::Small).into_iter().map(|run| run.name).collect();
        assert_eq!(names, ["local-4x8", "local-6x12", "local-8x16", "nonlocal-6x12", "nonlocal-8x16"]);
    }
}
