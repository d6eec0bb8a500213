//! [Liu2015] Figs. 16 to 19: plane strain compression on three meshes, local and nonlocal. J-6.

use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-biaxial",
    source: "[Liu2015] Figs. 16 to 19",
    shows: "plane strain compression on three meshes: local curves part past the peak, nonlocal ones less",
    run_time: ("15 min", "days"),
    runs,
    evaluate,
};

const MESHES: [(usize, usize); 3] = [(4, 8), (6, 12), (8, 16)];
const KINDS: [&str; 2] = ["local", "nonlocal"];

fn name(kind: &str, (across, up): (usize, usize)) -> String {
    format!("{kind}-{across}x{up}")
}

fn runs(size: Size) -> Vec<Run> {
    let run = |kind: &str, mesh: (usize, usize)| {
        let run = Run::new(name(kind, mesh), "scenes/liu2015/biaxial.toml", Command::Stopping, size)
            .set(format!("mesh.elements=[{}, {}, 1]", mesh.0, mesh.1));
        // Below the distance of the points nothing is averaged.
        if kind == "local" { run.set("nonlocal.radius=1e-3") } else { run }
    };
    KINDS.iter().flat_map(|kind| MESHES.map(|mesh| run(kind, mesh))).collect()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut charts = Vec::new();
    let mut comparisons = Vec::new();
    let mut spreads = Vec::new();
    for (kind, part, title) in [
        ("local", "local", "[Liu2015] Fig. 16: local, three meshes"),
        ("nonlocal", "nonlocal", "[Liu2015] Fig. 18: nonlocal, three meshes"),
    ] {
        let (x, y) = ("axial compression", "force on the head, N");
        let mut chart = Chart::new(title, (x, Scale::Linear), (y, Scale::Linear));
        let mut curves: Vec<Curve> = Vec::new();
        for mesh in MESHES {
            let curve = results.run(&name(kind, mesh))?.table()?.curve("axial_compression", "top_force")?;
            let curve: Curve = curve.into_iter().map(|[x, y]| [x, -y]).collect();
            let label = format!("{} x {} bricks", mesh.0, mesh.1);
            comparisons.push(Comparison::reported(format!("{kind}, {label}: largest force"), "N", peak(&curve)?[1]));
            chart.curve(&label, curve.clone());
            curves.push(curve);
        }
        let top = peak(&curves[2])?;
        let early = spread(&curves, 0.0, 0.6 * top[0]) / top[1];
        let late = spread(&curves, top[0], 0.06) / top[1];
        comparisons.push(Comparison::reported(
            format!("{kind}: spread of the meshes before the peak, over the peak"),
            "-",
            early,
        ));
        comparisons.push(match kind {
            "nonlocal" => Comparison::new(
                "nonlocal: spread of the meshes past the peak, over the peak",
                "-",
                Theirs::Value(0.0),
                "[Liu2015] section 3.5: nearly identical; band of J-6",
                late,
                Tolerance::Absolute(0.05),
            ),
            _ => Comparison::reported("local: spread of the meshes past the peak, over the peak", "-", late),
        });
        spreads.push(late);
        charts.push((part, chart));
    }
    comparisons.push(Comparison::holds(
        "the spread past the peak is larger without averages",
        "[Liu2015] section 3.5",
        spreads[0] > spreads[1],
    ));
    Ok(Outcome { charts, comparisons, notes: results.notes() })
}

/// Mean over a range of strain of the difference between the highest and the lowest curve.
fn spread(curves: &[Curve], from: f64, to: f64) -> f64 {
    let at = |share: u32| {
        let strain = from + (to - from) * f64::from(share) / 50.0;
        let values = curves.iter().map(|curve| value_at(curve, strain)).filter(|value| value.is_finite());
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let widths: Vec<f64> = (1..50).map(at).map(|(low, high)| high - low).filter(|width| width.is_finite()).collect();
    widths.iter().sum::<f64>() / widths.len() as f64
}
