//! The biaxial test of [Argilaga2018], section 3, with every operator and strategy (T-10): iterations and evaluations per
//! step before and after the peak, with one packing behind all points and with five that are dealt out at random.

use super::case::{
    STABILISATION, Step, StrategyRun, definition, packing_of_seed, side_by_side, small_packing, solve_on_grains,
};
use super::strategies::{Variant, operators, own};
use crate::effort::Effort;
use crate::report::Report;
use crate::table::Table;
use charts::{Chart, Scale};
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::problem::{Axis, Condition, Criteria, Platen, PressureKind, Problem, Strategy, Tolerances};
use rve_server::definition::{Accuracy, RveOptions};
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Width and height of the specimen, m.
const SIZE: [f64; 2] = [0.05, 0.10];

/// The grains behind the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grains {
    /// One packing behind all: a specimen that stays uniform up to the peak, where all points come to the same snap at once.
    Alike,
    /// Five packings, dealt out at random: each point snaps when it must, and shear localises where it can.
    Mixed,
}

impl Grains {
    /// What `--only` calls it, and the names of files and charts.
    fn name(self) -> &'static str {
        match self {
            Self::Alike => "biaxial",
            Self::Mixed => "mixed",
        }
    }

    /// Seeds of the packings.
    fn seeds(self) -> std::ops::RangeInclusive<u64> {
        match self {
            Self::Alike => 1..=1,
            Self::Mixed => 1..=5,
        }
    }
}

/// All that are compared here.
pub(super) fn variants() -> Vec<Variant> {
    [own(), operators()].concat()
}

/// Measures the variants at the size that the effort allows: 8 x 16 elements in full, else 2 x 4.
///
/// # Errors
/// The packing cannot be made, workers are lost, or the report cannot be written.
pub(super) fn run(kind: Grains, variants: &[Variant], effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let elements = if effort.full { [8, 16] } else { effort.choose([2, 4], [1, 1]) };
    let steps = effort.choose(20, 2);
    let packings = if effort.quick {
        vec![small_packing()?]
    } else {
        kind.seeds().map(packing_of_seed).collect::<anyhow::Result<Vec<_>>>()?
    };
    let number = packings.len();
    let grains =
        packings.into_iter().map(|packing| definition(packing, ACCURACY)).collect::<anyhow::Result<Vec<_>>>()?;
    let points = (4 * elements[0] * elements[1]) as f64;
    let (discs, name, written) = (effort.choose(400, 100), kind.name(), &*report);
    let runs: Mutex<BTreeMap<usize, StrategyRun>> = Mutex::default();
    let ended = side_by_side(variants.len(), |place| -> anyhow::Result<()> {
        let result = solve_on_grains(&problem(elements, steps, &variants[place].strategy), &grains)?;
        let mut runs = runs.lock().expect("no thread panics while it writes");
        runs.insert(place, result);
        // A study that is ended early leaves what it has found.
        Ok(written.raw(name, &summary(&with_names(variants, &runs), points))?)
    });
    ended.into_iter().collect::<anyhow::Result<()>>()?;
    let runs = runs.into_inner().expect("no thread has panicked");
    let all = with_names(variants, &runs);
    report.note(&format!(
        "{name}: {} x {} Q8 elements, {number} packings of {discs} discs, draft accuracy, {steps} steps of 1e-3; FNORM/RNORM \
         below 1e-2",
        elements[0], elements[1]
    ))?;
    report.raw(&format!("{name}-steps"), &each(&all, points))?;
    report.table(name, "per step, before and after the peak", &summary(&all, points))?;
    let mut chart = Chart::new(
        "biaxial test",
        ("axial strain, %", Scale::Linear),
        ("evaluations per Gauss point and step", Scale::Logarithmic),
    );
    for (variant, result) in &all {
        let steps_taken = result.steps.iter().filter(|step| step.report.size > 0.0);
        let curve =
            steps_taken.map(|step| [0.1 * step.report.load * steps as f64, step.report.evaluations as f64 / points]);
        chart.curve(&variant.name, curve);
    }
    report.chart(name, &chart)?;
    report.note("Cells of one packing under equal strain answer alike; `computed` counts each answer once.")?;
    Ok(())
}

/// The runs that are done, in the order of their variants.
fn with_names<'a>(
    variants: &'a [Variant],
    runs: &'a BTreeMap<usize, StrategyRun>,
) -> Vec<(&'a Variant, &'a StrategyRun)> {
    runs.iter().map(|(place, run)| (&variants[*place], run)).collect()
}

/// Coarse, but the same for all: what is compared are counts of iterations.
const ACCURACY: Accuracy = Accuracy::Draft;

/// A specimen on a platen, with one corner held, under 100 kPa from both sides and a platen that comes down.
pub(super) fn conditions(contact: Platen, displacement: f64) -> Vec<Condition> {
    let platen =
        |nodes: &str, displacement| Condition::Platen { nodes: nodes.into(), contact, axis: Axis::Y, displacement };
    let pressure =
        |sides: &str| Condition::Pressure { sides: sides.into(), value: 1e5, kind: PressureKind::Follower };
    vec![
        platen("bottom", 0.0),
        platen("top", displacement),
        Condition::fixed("bottom_left", Axis::X),
        pressure("left"),
        pressure("right"),
    ]
}

fn problem(elements: [usize; 2], steps: usize, strategy: &Strategy) -> Problem {
    let mesh = Block::plane(SIZE, elements, ElementKind::Q8).mesh().expect("a sound block");
    let mut problem = Problem::new(mesh, conditions(Platen::Smooth, -1e-3 * steps as f64 * SIZE[1]));
    problem.stages[0].control.increments = steps;
    problem.stages[0].control.min = 1.0 / (64 * steps) as f64;
    problem.stages[0].control.max_iterations = 25;
    problem.stages[0].control.stabilisation = STABILISATION;
    problem.stages[0].strategy = strategy.clone();
    problem.stages[0].tolerances =
        Tolerances { force: 1e-2, criteria: Criteria::FORCE_OVER_REACTIONS, ..Tolerances::default() };
    problem.strain_per_step = RveOptions { accuracy: ACCURACY, ..RveOptions::default() }.strain_per_step();
    problem
}

fn each(all: &[(&Variant, &StrategyRun)], points: f64) -> Table {
    let mut table = Table::new([
        "variant",
        "step",
        "load",
        "iterations",
        "requested",
        "failed",
        "stabilisation_increments",
        "force_ratio",
        "stress_ratio",
    ]);
    for (variant, result) in all {
        for Step { report, ratio, .. } in &result.steps {
            table.row([
                variant.name.as_str().into(),
                report.step.into(),
                report.load.into(),
                report.iterations.into(),
                (report.evaluations as f64 / points).into(),
                report.cut_backs.into(),
                report.stabilisation_increments.into(),
                report.force_ratio.into(),
                (*ratio).into(),
            ]);
        }
    }
    table
}

/// Means over the steps before or after the peak, per step of 1e-3, whatever it was cut into.
fn summary(all: &[(&Variant, &StrategyRun)], points: f64) -> Table {
    let mut table = Table::new([
        "variant",
        "iterations_pre",
        "iterations_post",
        "asked_pre",
        "asked_post",
        "computed",
        "tangents",
        "failed",
        "stabilised",
        "reached_%",
        "peak_ratio",
        "wall_s",
        "processor_s",
        "end",
    ]);
    for (variant, result) in all {
        let peak = result.peak();
        let increments = |steps: &[&Step]| steps.iter().map(|step| step.report.size).sum::<f64>();
        let (pre, post): (Vec<&Step>, Vec<&Step>) =
            result.steps.iter().filter(|step| step.report.size > 0.0).partition(|step| step.report.step <= peak);
        let full_steps = |steps: &[&Step]| increments(steps) * result.increments as f64;
        let iterations =
            |steps: &[&Step]| steps.iter().map(|step| step.report.iterations as f64).sum::<f64>() / full_steps(steps);
        let requested = |steps: &[&Step]| {
            steps.iter().map(|step| step.report.evaluations as f64).sum::<f64>() / points / full_steps(steps)
        };
        let statistics = &result.run.statistics;
        table.row([
            variant.name.as_str().into(),
            iterations(&pre).into(),
            iterations(&post).into(),
            requested(&pre).into(),
            requested(&post).into(),
            (result.computed as f64 / points).into(),
            (statistics.tangents as f64 / points).into(),
            statistics.cut_backs.into(),
            statistics.stabilised_steps.into(),
            (100.0 * result.run.load).into(),
            result.steps.iter().map(|step| step.ratio).fold(f64::NAN, f64::max).into(),
            result.wall.into(),
            result.processor.into(),
            result.end().into(),
        ]);
    }
    table
}
