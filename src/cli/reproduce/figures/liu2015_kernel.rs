//! Erratum: the kernel of [Liu2015] appendix A is unstable on fine meshes. Shown by a run that is allowed, and by its refusal.
//! K-4.

use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-kernel",
    source: "erratum to [Liu2015] App. A",
    shows: "the printed kernel at 2.7 elements radius: refused, and unstable where it is allowed; Wendland's kernel",
    run_time: ("1 min", "1 h"),
    entries: &[("K-4", "")],
    runs,
    evaluate,
};

const SCENE: &str = "scenes/liu2015/biaxial.toml";

fn runs(size: Size) -> Vec<Run> {
    let run = |name: &str, kernel: &str| {
        Run::new(name, SCENE, Command::Refused(&["unstable"]), size)
            .set("mesh.elements=[4, 8, 1]")
            .set("nonlocal.radius=27e-3")
            .set(format!("nonlocal.kernel={kernel}"))
            .set("loading.duration=2e-3")
            .set("dynamics.output_interval=2e-5")
            .set("output.fields_every=0")
            .set("solver.hourglass_coefficient=0.005")
    };
    vec![
        run("bell-refused", "bell"),
        run("bell", "bell").set("nonlocal.allow_unstable=true"),
        run("wendland", "wendland"),
    ]
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut chart = Chart::new(
        "[Liu2015] appendix A: kernels at a radius of 2.7 elements",
        ("time, ms", Scale::Linear),
        ("force on the head, N", Scale::Logarithmic),
    );
    for (name, label) in [("wendland", "Wendland"), ("bell", "bell, as printed")] {
        let curve = results.run(name)?.table()?.curve("time", "top_force")?;
        chart.curve(label, curve.into_iter().map(|[time, force]| [1e3 * time, -force]));
    }
    let refused = results.run("bell-refused")?.stopped().is_some_and(|said| said.contains("unstable"));
    let ended = |name: &str| -> Result<f64, ReproduceError> {
        Ok(results.run(name)?.table()?.column("time")?.last().copied().unwrap_or(0.0) / 2e-3)
    };
    let source = "linear stability, K-4";
    let comparisons = vec![
        Comparison::holds("the printed kernel is refused", source, refused),
        Comparison::holds("it stops early where it is allowed", source, results.run("bell")?.stopped().is_some()),
        Comparison::reported("share of the run that it reaches", "-", ended("bell")?),
        Comparison::holds("Wendland's kernel reaches the end", source, results.run("wendland")?.stopped().is_none()),
    ];
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}
