//! [Argilaga2018] Fig. 7 and Table 1: iterations and time of the biaxial test, by operator. Part of J-2 and T-10.

use crate::cli::reproduce::journal::{attempt, iterates};
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-iterations",
    source: "[Argilaga2018] Fig. 7, Table 1",
    shows: "iterations per step before and after the peak, and time to 2 %, by tangent operator",
    run_time: ("5 min", "days"),
    runs,
    evaluate,
};

/// The paper's name, ours, and the speeds of Table 1 before and after the peak relative to DEMQO; NaN where there is none.
const KINDS: [(&str, &str, [f64; 2]); 8] = [
    ("CTO", "consistent", [0.20, f64::NAN]),
    ("AEO", "elastic_average", [0.20, 0.80]),
    ("DEMQO", "quasi_static", [1.0, 1.0]),
    ("PSTLO", "truss_like", [1.0, 1.0]),
    ("UKO", "kruyt", [0.50, 0.67]),
    ("UCKO", "kruyt_calibrated", [0.67, 1.0]),
    ("UCKO-2DOF", "kruyt_twice_calibrated", [0.86, 0.80]),
    ("KAO", "kruyt_augmented", [0.67, 0.67]),
];

fn runs(size: Size) -> Vec<Run> {
    let run = |(_, kind, _): (&str, &'static str, [f64; 2])| {
        Run::new(kind, "scenes/argilaga2018/biaxial.toml", Command::Stopping, size)
            .set(format!("solver.tangent={kind}"))
            .set("solver.tangent_update=always")
            .set("solver.secant.enabled=false")
            .set("solver.quasi_newton_pairs=0")
            .set("output.fields_every=0")
    };
    KINDS.map(run).into()
}

/// Mean iterations of the accepted attempts at steps before and after a step.
fn iterations(run: &Finished, divide: f64) -> Result<[f64; 2], ReproduceError> {
    let all = iterates(run)?;
    let table = run.table()?;
    let (steps, strain) = (table.column("step")?, table.column("axial_compression")?);
    let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
    for (step, strain) in steps.iter().zip(strain).filter(|(step, _)| **step > 0.0) {
        let side = usize::from(strain > divide);
        sums[side] += attempt(&all, *step as u64).len() as f64;
        counts[side] += 1.0;
    }
    Ok([sums[0] / counts[0], sums[1] / counts[1]])
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let (x, y) = ("axial compression", "stress ratio");
    let mut stress = Chart::new("[Argilaga2018] Fig. 4: biaxial test", (x, Scale::Linear), (y, Scale::Linear));
    let mut cost = Chart::new(
        "[Argilaga2018] Fig. 7: evaluations of the cells over the test",
        (x, Scale::Linear),
        ("evaluations per point, probes of operators left out", Scale::Linear),
    );
    let reference = results.run("quasi_static")?;
    let divide = peak(&reference.table()?.curve("axial_compression", "stress_ratio")?)?[0];
    let base = iterations(reference, divide)?;
    let time = results.run("consistent")?.wall_s();
    let mut comparisons = vec![Comparison::reported("compression at the peak, which divides the steps", "-", divide)];
    let mut ours_before = Vec::new();
    for (name, kind, theirs) in KINDS {
        let run = results.run(kind)?;
        let table = run.table()?;
        let counts = iterations(run, divide)?;
        for (side, label) in [(0, "before"), (1, "after")] {
            comparisons.push(Comparison::reported(
                format!("{name}: iterations a step {label} the peak"),
                "-",
                counts[side],
            ));
            if theirs[side].is_finite() && kind != "quasi_static" && !(side == 0 && theirs[0] == 0.2) {
                comparisons.push(Comparison::new(
                    format!("{name}: iterations of DEMQO over those of {name}, {label} the peak"),
                    "-",
                    Theirs::Value(theirs[side]),
                    "[Argilaga2018] Table 1",
                    base[side] / counts[side],
                    Tolerance::Absolute(0.2),
                ));
            }
        }
        comparisons.push(Comparison::reported(
            format!("{name}: time to the end over that of CTO"),
            "%",
            100.0 * run.wall_s() / time,
        ));
        ours_before.push((kind, counts[0]));
        stress.curve(name, table.curve("axial_compression", "stress_ratio")?);
        cost.curve(name, table.curve("axial_compression", "evaluations")?);
    }
    let of = |kind: &str| ours_before.iter().find(|(name, _)| *name == kind).map_or(f64::NAN, |(_, count)| *count);
    comparisons.push(Comparison::holds(
        "before the peak PSTLO needs as few iterations as DEMQO, UKO the most",
        "[Argilaga2018] Table 1",
        (of("truss_like") - of("quasi_static")).abs() <= 1.0 && of("kruyt") >= of("kruyt_twice_calibrated"),
    ));
    comparisons.push(Comparison::new(
        "time of PSTLO over that of DEMQO (erratum: the paper solves dense equations)",
        "-",
        Theirs::Value(3.0),
        "[Argilaga2018] Fig. 7: three times any other",
        results.run("truss_like")?.wall_s() / reference.wall_s(),
        Tolerance::Nothing,
    ));
    Ok(Outcome { charts: vec![("", stress), ("cost", cost)], comparisons, notes: results.notes() })
}
