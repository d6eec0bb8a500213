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

const KINDS: [(&str, &str); 8] = [
    ("CTO", "consistent"),
    ("AEO", "elastic_average"),
    ("DEMQO", "quasi_static"),
    ("PSTLO", "truss_like"),
    ("UKO", "kruyt"),
    ("UCKO", "kruyt_calibrated"),
    ("UCKO-2DOF", "kruyt_twice_calibrated"),
    ("KAO", "kruyt_augmented"),
];

/// Those that are averaged or calibrated over the first steps of a test and then kept.
const LEARNING: [&str; 3] = ["elastic_average", "kruyt_calibrated", "kruyt_twice_calibrated"];

/// The run in which the cells are relaxed as little as those of the paper.
const ROUGH: &str = "rough-truss_like";

/// Step of UKO as a strain, and as a displacement of the head, m.
const STEPS: [(&str, &str); 4] = [("1e-3", "-1e-4"), ("1e-4", "-1e-5"), ("1e-5", "-1e-6"), ("1e-6", "-1e-7")];

/// As `stage.1.solver` of the scene, for another operator.
fn newton(kind: &str) -> String {
    format!("tangent = '{kind}', tangent_update = 'always', secant = {{ enabled = false }}, quasi_newton_pairs = 0")
}

/// The stages of the scene with one more before them: the first five of the thirty steps are made with the operator of the studied one,
/// so that it has learnt from them.
fn learnt(run: Run, kind: &str) -> Run {
    let boundary =
        |way: &str| format!("boundary = [{{ set = 'top', platen = 'smooth', displacement = {{ y = {way} }} }}]");
    let loading = |steps: u32| format!("loading = {{ increments = {steps}, commit_iterates_after = 0 }}");
    let newton = newton(kind);
    let first = format!("{{ name = 'first', {}, solver = {{ {newton} }}, {} }}", loading(5), boundary("-2.5e-4"));
    let before = format!("{{ name = 'before', {}, {} }}", loading(25), boundary("-1.25e-3"));
    let studied = format!(
        "{{ name = 'studied', loading = {{ increments = 1, max_iterations = 15, smallest_increment = 1.0, stabilise = false }}, \
         solver = {{ {newton}, force_tolerance = 1e-9, stagnated_force_tolerance = 0.0 }}, {} }}",
        boundary("-2e-5")
    );
    run.set(format!("stage=[{first}, {before}, {studied}]"))
}

fn runs(size: Size) -> Vec<Run> {
    let run = |name: String| Run::new(name, SCENE, Command::Stopping, size);
    let of_kind = |name: String, kind: &str| run(name).set(format!("stage.1.solver.tangent={kind}"));
    let from_rest = |run: Run| run.set("stage.0.boundary.0.displacement.y=0").set("stage.0.loading.increments=1");
    let mut runs = Vec::new();
    for (_, kind) in KINDS {
        let late = format!("late-{kind}");
        runs.push(from_rest(of_kind(format!("start-{kind}"), kind)));
        runs.push(if LEARNING.contains(&kind) { learnt(run(late), kind) } else { of_kind(late, kind) });
    }
    for (strain, way) in STEPS {
        let run = of_kind(format!("step-{strain}"), "kruyt");
        runs.push(from_rest(run.set(format!("stage.1.boundary.0.displacement.y={way}"))));
    }
    runs.push(from_rest(of_kind(ROUGH.to_owned(), "truss_like")).set("rve.tolerance=1e-3"));
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

/// Where the iterations end, next to the printed floor, which is one number for all operators.
fn floor_of(quantity: String, theirs: f64, ours: f64) -> Comparison {
    let source = "[Argilaga2018] section 6: floor";
    Comparison::new(quantity, "-", Theirs::Value(theirs), source, ours, Tolerance::Nothing)
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let (x, y) = (("iteration", Scale::Linear), ("out-of-balance force over reactions", Scale::Logarithmic));
    let mut charts = Vec::new();
    let mut comparisons = Vec::new();
    for (part, label, floor) in [("start", "first step", 3e-4), ("late", "at 1.5 %", 2e-4)] {
        let mut chart = Chart::new(&format!("[Argilaga2018] Fig. 6: {label}"), x, y);
        let mut lowest_of_all = f64::INFINITY;
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
            lowest_of_all = lowest_of_all.min(lowest(&curve));
            chart.curve(name, curve);
        }
        comparisons.push(floor_of(format!("lowest of all operators, {label}"), floor, lowest_of_all));
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
    let rough = residuals(results.run(ROUGH)?)?;
    comparisons.push(floor_of("PSTLO, first step, cells relaxed to 1e-3: lowest".to_owned(), 3e-4, lowest(&rough)));
    let notes = vec!["every run stops at its studied step, whose tolerance cannot be met".to_owned()];
    Ok(Outcome { charts, comparisons, notes, ..Outcome::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_operators_that_learn_are_used_before_the_studied_step() {
        let runs = runs(Size::Small);
        let learns = |name: &str| {
            let run = runs.iter().find(|run| run.name == name).unwrap();
            run.settings.iter().any(|setting| setting.starts_with("stage=["))
        };
        assert!(learns("late-elastic_average") && learns("late-kruyt_calibrated"));
        assert!(!learns("late-truss_like") && !learns("start-elastic_average"));
    }

    #[test]
    fn the_lowest_and_the_first_below_the_tolerance_are_found() {
        let curve = [[1.0, 0.5], [2.0, 8e-3], [3.0, 2e-4], [4.0, 3e-4]];
        assert_eq!((lowest(&curve), to_tolerance(&curve)), (2e-4, 2.0));
        assert!(to_tolerance(&curve[..1]).is_nan());
    }
}
