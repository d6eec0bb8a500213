//! [Argilaga2018] Fig. 3: correction over the displacements of the step, iteration by iteration, of the first ten steps with CTO.

use crate::cli::reproduce::journal::{Iterate, attempt, iterates};
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-displacements",
    source: "[Argilaga2018] Fig. 3",
    shows: "UNORM/DNORM of every iterate of the first ten steps with CTO, within 0.2 % of compression",
    run_time: ("5 s", "3 min"),
    entries: &[],
    runs,
    evaluate,
};

/// Steps of the figure, and the limit PRECU of the paper.
const STEPS: u64 = 10;
const LIMIT: f64 = 5e-3;

/// To what the steps are iterated, to see how they go on below the limit; one that stagnates above it is accepted where it stands.
const TOLERANCE: f64 = 1e-5;

/// The only stage that is left: ten equal steps to a compression just below 0.2 %, with Newton's method as it stands in the paper.
fn runs(size: Size) -> Vec<Run> {
    let run = Run::new("cto", "scenes/argilaga2018/residuals.toml", Command::Stopping, size);
    let solver = "stage.1.solver.";
    vec![
        run.set("stage.0.boundary.0.displacement.y=0")
            .set("stage.0.loading.increments=1")
            .set("stage.1.boundary.0.displacement.y=-1.9e-4")
            .set(format!("stage.1.loading.increments={STEPS}"))
            .set("stage.1.loading.smallest_increment=0.1")
            .set(format!("{solver}tangent=consistent"))
            .set(format!("{solver}criteria=['correction_over_step']"))
            .set(format!("{solver}displacement_tolerance={TOLERANCE}"))
            .set(format!("{solver}force_tolerance=1e-2")),
    ]
}

/// Iterations of an attempt with the ratio of each, those without a correction left out.
fn ratios(attempt: &[Iterate]) -> Curve {
    let point = |iterate: &Iterate| Some([iterate.iteration as f64, iterate.displacement_ratio?]);
    attempt.iter().filter_map(point).collect()
}

/// Order of convergence from the last three ratios: `ln(r3 / r2) / ln(r2 / r1)`; NaN without three that fall.
fn order(ratios: &[[f64; 2]]) -> f64 {
    match ratios {
        [.., one, two, three] if one[1] > two[1] && two[1] > three[1] && three[1] > 0.0 => {
            (three[1] / two[1]).ln() / (two[1] / one[1]).ln()
        }
        _ => f64::NAN,
    }
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let run = results.run("cto")?;
    let all = iterates(run)?;
    let compression = run.table()?.curve("step", "axial_compression")?;
    let x = ("iteration", Scale::Linear);
    let mut chart = Chart::new(
        "[Argilaga2018] Fig. 3: the first ten steps with CTO",
        x,
        ("correction over the displacements of the step", Scale::Logarithmic),
    );
    let mut comparisons = Vec::new();
    // Step 0 is the state at rest, and step 1 the stage in which nothing moves.
    let steps: Vec<u64> = all.iter().map(|iterate| iterate.step).filter(|step| *step > 1).collect();
    let last = steps.iter().copied().max().unwrap_or(0).min(1 + STEPS);
    let (mut met, mut longest) = (0, 1.0_f64);
    for step in 2..=last {
        let curve = ratios(&attempt(&all, step));
        let strain = value_at(&compression, step as f64);
        let end = curve.last().map_or(f64::NAN, |point| point[1]);
        met += u64::from(end <= LIMIT);
        longest = curve.last().map_or(longest, |point| longest.max(point[0]));
        let label = format!("step {}, {:.3} %", step - 1, 100.0 * strain);
        let reached = curve.iter().find(|point| point[1] <= LIMIT).map_or(f64::NAN, |point| point[0]);
        comparisons.push(Comparison::reported(format!("{label}: iterations to the limit"), "-", reached));
        comparisons.push(Comparison::reported(format!("{label}: last ratio"), "-", end));
        comparisons.push(Comparison::reported(
            format!("{label}: order of the last two iterations"),
            "-",
            order(&curve),
        ));
        chart.curve(&label, curve);
    }
    chart.reference("[Argilaga2018]: limit PRECU, 5e-3", [[1.0, LIMIT], [longest, LIMIT]]);
    comparisons.push(Comparison::new(
        "steps of the ten that end below the limit",
        "-",
        Theirs::Value(10.0),
        "[Argilaga2018] Fig. 3",
        met as f64,
        Tolerance::Absolute(0.5),
    ));
    comparisons.push(Comparison::holds(
        "the ten steps lie below 0.2 % of compression",
        "[Argilaga2018] Fig. 3",
        last == 1 + STEPS && value_at(&compression, last as f64) < 2e-3,
    ));
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_squared_errors_is_two_and_of_tenths_one() {
        let curve = |ratios: [f64; 3]| -> Curve { ratios.iter().map(|ratio| [0.0, *ratio]).collect() };
        assert!((order(&curve([1e-1, 1e-2, 1e-4])) - 2.0).abs() < 1e-12);
        assert!((order(&curve([1e-1, 1e-2, 1e-3])) - 1.0).abs() < 1e-12);
        assert!(order(&curve([1e-2, 1e-1, 1e-3])).is_nan() && order(&[]).is_nan());
    }
}
