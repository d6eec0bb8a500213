//! One Q8 element between smooth platens: evaluations per Gauss point up to 1, 2, 3 and 5.7 % axial strain, over several
//! packings.

use super::case::{
    STABILISATION, StrategyRun, definition, packing_of_seed, side_by_side, small_packing, solve_on_grains,
};
use super::strategies::{Variant, operators, own, rounded};
use crate::effort::Effort;
use crate::report::Report;
use crate::table::{Cell, Table};
use charts::{Chart, Scale};
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::problem::{Criteria, Platen, Problem, Strategy, Tolerances};
use protocol::Definition;
use rve_server::definition::{Accuracy, RveOptions};

/// Steps of 1e-3 of the height.
const STEPS: usize = 57;

/// Steps at which evaluations are compared.
const MARKS: [usize; 4] = [10, 20, 30, 57];

/// Evaluations per Gauss point up to the marks: of the open FEM x DEM code (escript with Yade), and what is aimed at.
const REFERENCE: [f64; 4] = [65.0, 218.0, 572.0, 1312.0];
const TARGET: [f64; 4] = [30.0, 75.0, 150.0, 350.0];

/// Seeds of the packings. Settings were fixed on the first.
const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];

/// All that are compared here. Of the published operators only the ends of the ranking: this part is about strategies.
pub(super) fn variants() -> Vec<Variant> {
    let published = operators().into_iter().filter(|variant| ["UKO", "PSTLO"].contains(&variant.name.as_str()));
    [own(), rounded(), published.collect()].concat()
}

/// Measures the variants under both criteria over all packings.
///
/// # Errors
/// A packing cannot be made, workers are lost, or the report cannot be written.
pub(super) fn run(variants: &[Variant], effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let steps = effort.choose(STEPS, 3);
    let (packings, accuracy) = match effort.quick {
        true => (vec![small_packing()?], Accuracy::Draft),
        false => {
            let accuracy = if effort.full { Accuracy::Default } else { Accuracy::Draft };
            (SEEDS.into_iter().map(packing_of_seed).collect::<anyhow::Result<_>>()?, accuracy)
        }
    };
    let grains = packings
        .into_iter()
        .map(|packing| definition(packing, accuracy))
        .collect::<anyhow::Result<Vec<Definition>>>()?;
    let criteria = criteria();
    let count = variants.len() * criteria.len() * grains.len();
    let place = |piece: usize| {
        let (variant, rest) = (piece / (criteria.len() * grains.len()), piece % (criteria.len() * grains.len()));
        (variant, rest / grains.len(), rest % grains.len())
    };
    let runs = side_by_side(count, |piece| {
        let (variant, criterion, packing) = place(piece);
        let problem = problem(steps, &variants[variant].strategy, criteria[criterion].1, accuracy);
        solve_on_grains(&problem, &grains[packing..=packing])
    });
    let runs = runs.into_iter().collect::<anyhow::Result<Vec<StrategyRun>>>()?;
    let all: Vec<Of<'_>> = runs
        .iter()
        .enumerate()
        .map(|(piece, result)| {
            let (variant, criterion, packing) = place(piece);
            Of { variant: &variants[variant], criterion: criteria[criterion].0, packing: SEEDS[packing], result }
        })
        .collect();
    report.raw("element-steps", &each(&all, steps))?;
    report.raw("element-packings", &by_packing(&all, steps))?;
    report.table(
        "element",
        "evaluations per Gauss point up to the strain, mean over packings",
        &means(&all, steps),
    )?;
    for (criterion, _) in criteria {
        let shown: Vec<&Of<'_>> = all.iter().filter(|one| one.criterion == criterion).collect();
        report.chart(&format!("element-{criterion}"), &picture(&shown, criterion, steps))?;
    }
    report.note(
        "`requested` counts the evaluations of the solver, `computed` those of the workers: bitwise equal trials of points of one \
         packing are computed once. `failed` steps were cut back.",
    )?;
    Ok(())
}

/// One run and what it is of.
struct Of<'a> {
    variant: &'a Variant,
    criterion: &'static str,
    packing: u64,
    result: &'a StrategyRun,
}

/// Both criteria: the correction of an iteration over the step, as the reference has it, and the out-of-balance force
/// over the reactions, ten times tighter.
fn criteria() -> [(&'static str, Tolerances); 2] {
    let plain = Tolerances::default();
    [
        ("displacement", Tolerances { displacement: 1e-2, criteria: Criteria::CORRECTION_OVER_STEP, ..plain }),
        ("force", Tolerances { force: 1e-3, criteria: Criteria::FORCE_OVER_REACTIONS, ..plain }),
    ]
}

fn problem(steps: usize, strategy: &Strategy, tolerances: Tolerances, accuracy: Accuracy) -> Problem {
    let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q8).mesh().expect("a sound block");
    let mut problem = Problem::new(mesh, super::biaxial::conditions(Platen::Smooth, -1e-3 * steps as f64));
    problem.stages[0].control.increments = steps;
    problem.stages[0].control.min = 1e-3 / steps as f64;
    problem.stages[0].control.max_iterations = 25;
    problem.stages[0].control.stabilisation = STABILISATION;
    problem.stages[0].strategy = strategy.clone();
    problem.stages[0].tolerances = tolerances;
    problem.strain_per_step = RveOptions { accuracy, ..RveOptions::default() }.strain_per_step();
    problem
}

/// Gauss points of the element.
const POINTS: f64 = 4.0;

fn each(all: &[Of<'_>], steps: usize) -> Table {
    let mut table = Table::new([
        "strategy",
        "criterion",
        "packing",
        "step",
        "strain",
        "requested",
        "iterations",
        "failed",
        "stabilisation_increments",
        "force_ratio",
        "stress_ratio",
    ]);
    for one in all {
        for step in &one.result.steps {
            let report = &step.report;
            table.row([
                one.variant.name.as_str().into(),
                one.criterion.into(),
                one.packing.into(),
                report.step.into(),
                (report.load * 1e-3 * steps as f64).into(),
                (report.evaluations as f64 / POINTS).into(),
                report.iterations.into(),
                report.cut_backs.into(),
                report.stabilisation_increments.into(),
                report.force_ratio.into(),
                step.ratio.into(),
            ]);
        }
    }
    table
}

/// Evaluations per Gauss point requested up to each mark; NaN beyond the path.
fn marks(result: &StrategyRun, steps: usize) -> [f64; 4] {
    MARKS
        .map(|mark| if mark > steps { f64::NAN } else { result.requested_until(mark as f64 / steps as f64) / POINTS })
}

fn by_packing(all: &[Of<'_>], steps: usize) -> Table {
    let heads = [
        "strategy",
        "criterion",
        "packing",
        "asked_1",
        "asked_2",
        "asked_3",
        "asked_5.7",
        "computed",
        "tangents",
        "failed",
        "stabilised",
    ];
    let mut table = Table::new(heads);
    for one in all {
        let [first, second, third, last] = marks(one.result, steps);
        let statistics = &one.result.run.statistics;
        table.row([
            one.variant.name.as_str().into(),
            one.criterion.into(),
            one.packing.into(),
            first.into(),
            second.into(),
            third.into(),
            last.into(),
            (one.result.computed as f64 / POINTS).into(),
            (statistics.tangents as f64 / POINTS).into(),
            statistics.cut_backs.into(),
            statistics.stabilised_steps.into(),
        ]);
    }
    table
}

/// Runs of one variant under one criterion, in the order of the packings.
fn groups<'a>(all: &'a [Of<'a>]) -> impl Iterator<Item = &'a [Of<'a>]> {
    all.chunk_by(|one, other| one.variant.name == other.variant.name && one.criterion == other.criterion)
}

fn means(all: &[Of<'_>], steps: usize) -> Table {
    let mut table = Table::new([
        "strategy",
        "criterion",
        "at_1_%",
        "at_2_%",
        "at_3_%",
        "at_5.7_%",
        "worst_5.7_%",
        "computed",
        "tangents",
        "failed",
        "stabilised",
        "unfinished",
        "Mforce_evaluations",
        "wall_s",
    ]);
    let row = |name: &str, criterion: &str, at: [f64; 4], rest: [Cell; 8]| {
        let [worst, computed, tangents, failed, stabilised, unfinished, force, wall] = rest;
        let [first, second, third, last] = at.map(Cell::from);
        [
            name.into(),
            criterion.into(),
            first,
            second,
            third,
            last,
            worst,
            computed,
            tangents,
            failed,
            stabilised,
            unfinished,
            force,
            wall,
        ]
    };
    let nothing = || std::array::from_fn(|_| Cell::from(f64::NAN));
    table.row(row("escript with Yade", "displacement", REFERENCE, nothing()));
    table.row(row("aimed at", "displacement", TARGET, nothing()));
    for group in groups(all) {
        let marks: Vec<[f64; 4]> = group.iter().map(|one| marks(one.result, steps)).collect();
        let mean = |of: &dyn Fn(&Of<'_>) -> f64| group.iter().map(of).sum::<f64>() / group.len() as f64;
        let sum = |of: &dyn Fn(&Of<'_>) -> u64| group.iter().map(of).sum::<u64>();
        let at = std::array::from_fn(|mark| marks.iter().map(|one| one[mark]).sum::<f64>() / marks.len() as f64);
        let worst = marks.iter().map(|one| one[3]).fold(f64::NAN, f64::max);
        table.row(row(
            &group[0].variant.name,
            group[0].criterion,
            at,
            [
                worst.into(),
                mean(&|one| one.result.computed as f64 / POINTS).into(),
                mean(&|one| one.result.run.statistics.tangents as f64 / POINTS).into(),
                sum(&|one| one.result.run.statistics.cut_backs).into(),
                sum(&|one| one.result.run.statistics.stabilised_steps).into(),
                sum(&|one| u64::from(!one.result.is_complete())).into(),
                mean(&|one| one.result.run.statistics.cost.force_evaluations as f64 * 1e-6).into(),
                mean(&|one| one.result.wall).into(),
            ],
        ));
    }
    table
}

/// Mean evaluations over strain, as far as all packings came.
fn picture(shown: &[&Of<'_>], criterion: &str, steps: usize) -> Chart {
    let title = format!("single element, {criterion} criterion, mean over packings");
    let y = ("evaluations per Gauss point", Scale::Logarithmic);
    let mut chart = Chart::new(&title, ("axial strain, %", Scale::Linear), y);
    let strains = MARKS.map(|mark| 0.1 * mark as f64);
    if criterion == "displacement" {
        chart.curve("escript with Yade", strains.into_iter().zip(REFERENCE).map(<[f64; 2]>::from));
    }
    chart.curve("aimed at", strains.into_iter().zip(TARGET).map(<[f64; 2]>::from));
    for group in shown.chunk_by(|one, other| one.variant.name == other.variant.name) {
        let mean = |step: usize| {
            let requested = group.iter().map(|one| one.result.requested_until(step as f64 / steps as f64));
            requested.sum::<f64>() / group.len() as f64 / POINTS
        };
        chart.curve(&group[0].variant.name, (1..=steps).map(|step| [0.1 * step as f64, mean(step)]));
    }
    chart
}
