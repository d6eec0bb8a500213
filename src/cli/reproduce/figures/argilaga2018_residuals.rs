//! [Argilaga2018] Figs. 3, 5 and 6: out-of-balance force from iteration to iteration, by operator and by size of the step. T-9, T-10.

use crate::cli::reproduce::journal::iterates;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-residuals",
    source: "[Argilaga2018] Figs. 3, 5, 6",
    shows: "out-of-balance force over iterations at the start and at 1.5 %, by operator, and of UKO by size of the step",
    run_time: ("3 min", "2 h"),
    entries: &[],
    runs,
    evaluate,
};

const SCENE: &str = "scenes/argilaga2018/residuals.toml";

const KINDS: [(&str, &str); 7] = [
    ("CTO", "consistent"),
    ("DEMQO", "quasi_static"),
    ("PSTLO", "truss_like"),
    ("UKO", "kruyt"),
    ("UCKO", "kruyt_calibrated"),
    ("UCKO-2DOF", "kruyt_twice_calibrated"),
    ("KAO", "kruyt_augmented"),
];

/// Step of UKO as a strain, and as a displacement of the head, m.
const STEPS: [(&str, &str); 4] = [("1e-3", "-1e-4"), ("1e-4", "-1e-5"), ("1e-5", "-1e-6"), ("1e-6", "-1e-7")];

fn runs(size: Size) -> Vec<Run> {
    let from_rest = |run: Run| run.set("stage.0.boundary.0.displacement.y=0").set("stage.0.loading.increments=1");
    let mut runs = Vec::new();
    for (_, kind) in KINDS {
        let run = |name: String| {
            Run::new(name, SCENE, Command::Stopping, size).set(format!("stage.1.solver.tangent={kind}"))
        };
        runs.push(from_rest(run(format!("start-{kind}"))));
        runs.push(run(format!("late-{kind}")));
    }
    for (strain, way) in STEPS {
        let run = Run::new(format!("step-{strain}"), SCENE, Command::Stopping, size)
            .set("stage.1.solver.tangent=kruyt")
            .set(format!("stage.1.boundary.0.displacement.y={way}"));
        runs.push(from_rest(run));
    }
    runs
}

/// Out-of-balance force over the reactions, iterate by iterate, of the first attempt at the last step of a run.
fn residuals(run: &Finished) -> Result<Curve, ReproduceError> {
    let all = iterates(run)?;
    let last = all.iter().map(|iterate| iterate.step).max().unwrap_or(0);
    let of_step = all.iter().filter(|iterate| iterate.step == last);
    let mut found: Curve = Vec::new();
    for iterate in of_step {
        if found.last().is_some_and(|point| point[0] >= iterate.iteration as f64) {
            break;
        }
        found.push([iterate.iteration as f64, iterate.force_ratio]);
    }
    Ok(found)
}

fn lowest(curve: &[[f64; 2]]) -> f64 {
    curve.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min)
}

/// Iterations until the out-of-balance force is below 1e-2; NaN if it never is.
fn to_tolerance(curve: &[[f64; 2]]) -> f64 {
    curve.iter().find(|point| point[1] < 1e-2).map_or(f64::NAN, |point| point[0])
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let (x, y) = (("iteration", Scale::Linear), ("out-of-balance force over reactions", Scale::Logarithmic));
    let mut charts = Vec::new();
    let mut comparisons = Vec::new();
    for (part, label, floor) in [("start", "first step", 3e-4), ("late", "at 1.5 %", 2e-4)] {
        let mut chart = Chart::new(&format!("[Argilaga2018] Fig. 6: {label}"), x, y);
        for (name, kind) in KINDS {
            let curve = residuals(results.run(&format!("{part}-{kind}"))?)?;
            comparisons.push(Comparison::reported(
                format!("{name}, {label}: iterations to 1e-2"),
                "-",
                to_tolerance(&curve),
            ));
            comparisons.push(Comparison::reported(
                format!("{name}, {label}: lowest in 15 iterations"),
                "-",
                lowest(&curve),
            ));
            chart.curve(name, curve);
        }
        chart.reference(
            &format!("[Argilaga2018]: floor of all operators, {floor:.0e}"),
            [[1.0, floor], [15.0, floor]],
        );
        charts.push((part, chart));
    }
    let mut chart = Chart::new("[Argilaga2018] Fig. 5: UKO by size of the step", x, y);
    for (strain, _) in STEPS {
        let curve = residuals(results.run(&format!("step-{strain}"))?)?;
        comparisons.push(Comparison::reported(
            format!("UKO, step {strain}: lowest in 15 iterations"),
            "-",
            lowest(&curve),
        ));
        chart.curve(&format!("UKO, step {strain}"), curve);
    }
    charts.push(("steps", chart));
    let notes = vec!["every run stops at its studied step, whose tolerance cannot be met".to_owned()];
    Ok(Outcome { charts, comparisons, notes, ..Outcome::default() })
}
