//! [Argilaga2018] Fig. 9: time on one worker over the time on several, 512 elements. Part of P-5.

use crate::cli::reproduce::prelude::*;
use crate::side_by_side::cores;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-speedup",
    source: "[Argilaga2018] Fig. 9",
    shows: "time on one worker process over the time on more of them, up to the cores of this machine",
    run_time: ("1 min", "5 min"),
    entries: &[("P-5", "efficiency")],
    runs,
    evaluate,
};

/// Numbers of workers: those with a number in the paper, and powers of two around them.
const WORKERS: [usize; 6] = [1, 2, 4, 8, 12, 16];

/// Speed-up in the paper, on this number of cores.
const PUBLISHED: [(usize, f64); 2] = [(8, 7.15), (12, 9.06)];

/// Runs of each number of workers; their median counts.
const REPEATS: usize = 3;

fn name(workers: usize, repeat: usize) -> String {
    format!("workers-{workers}-{}", repeat + 1)
}

/// Numbers of workers that have a core each.
fn counts() -> impl Iterator<Item = usize> {
    let cores = cores().get();
    WORKERS.into_iter().filter(move |count| *count <= cores)
}

fn runs(size: Size) -> Vec<Run> {
    // The first steps of forty: all of them on one worker take the better part of an hour.
    let (mesh, steps) = match size {
        Size::Small => ("[8, 16]", 2),
        Size::Paper => ("[16, 32]", 2),
    };
    let compression = 5.0e-5 * f64::from(steps);
    // Repeats follow each other in turn, so that a machine that slows down slows all of them.
    let order = (0..REPEATS).flat_map(|repeat| counts().map(move |workers| (workers, repeat)));
    let run = |(workers, repeat)| {
        Run::new(name(workers, repeat), "scenes/argilaga2018/biaxial.toml", Command::Scene, size)
            .set(format!("mesh.elements={mesh}"))
            .set(format!("boundary.2.displacement.y=-{compression}"))
            .set(format!("loading.increments={steps}"))
            .set("output.fields_every=0")
            .on_workers(workers)
    };
    order.map(run).collect()
}

/// Median wall time of the runs on this number of workers, s.
fn median_time(results: &Results, workers: usize) -> Result<f64, ReproduceError> {
    let time = |repeat| results.run(&name(workers, repeat))?.summary(&["time", "wall_s"]);
    let mut times = (0..REPEATS).map(time).collect::<Result<Vec<f64>, ReproduceError>>()?;
    times.sort_by(f64::total_cmp);
    Ok(times[REPEATS / 2])
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let (x, y) = (("workers, cores", Scale::Linear), ("speed-up", Scale::Linear));
    let mut chart = Chart::new("[Argilaga2018] Fig. 9: speed-up", x, y);
    let mut comparisons = Vec::new();
    let alone = median_time(results, 1)?;
    comparisons.push(Comparison::reported("time on one worker", "s", alone));
    let mut curve = Curve::new();
    let has_run = |count: &usize| results.run(&name(*count, 0)).is_ok();
    for workers in WORKERS.into_iter().filter(has_run) {
        let speed_up = alone / median_time(results, workers)?;
        curve.push([workers as f64, speed_up]);
        if workers == 1 {
            continue;
        }
        let theirs = PUBLISHED.iter().find(|(cores, _)| *cores == workers).map(|(_, speed_up)| *speed_up);
        let source = "[Argilaga2018] Fig. 9";
        comparisons.push(Comparison::new(
            format!("speed-up on {workers} workers"),
            "-",
            theirs.map_or(Theirs::Nothing, Theirs::Value),
            if theirs.is_some() { source } else { "" },
            speed_up,
            Tolerance::Nothing,
        ));
        // More than the paper's is as good, up to the ideal.
        if let Some(theirs) = theirs {
            let efficiency = |speed_up: f64| speed_up / workers as f64;
            comparisons.push(Comparison::new(
                format!("efficiency of {workers} workers"),
                "-",
                Theirs::Between(efficiency(theirs), 1.0),
                source,
                efficiency(speed_up),
                Tolerance::Absolute(0.02),
            ));
        }
    }
    chart.curve("ideal", curve.iter().map(|[workers, _]| [*workers, *workers]));
    chart.curve("this program", curve);
    chart.published("[Argilaga2018]", PUBLISHED.map(|(cores, speed_up)| [cores as f64, speed_up]));
    let mut outcome =
        Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() };
    let left_out: Vec<String> = WORKERS.iter().filter(|count| !has_run(count)).map(ToString::to_string).collect();
    if !left_out.is_empty() {
        outcome.notes.push(format!("more workers than this machine has cores are left out: {}", left_out.join(", ")));
    }
    Ok(outcome)
}
