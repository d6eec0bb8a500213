//! What committed iterates save, and whether they change results: elements and specimens through their peaks, each with iterations that all
//! begin at the last accepted state and with iterates that are committed where those do not contract.

use super::biaxial::conditions;
use super::case::{StrategyRun, packing_of, side_by_side, solve_on_cell};
use crate::effort::Effort;
use crate::report::Report;
use crate::table::Table;
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::problem::{
    Criteria, DisplacementMeasure, ErrorControl, NamedStrategy, Platen, Problem, Stabilisation, Tolerances,
};
use rve_server::contact::ContactTable;
use rve_server::definition::{AnyDefinition, GrainDefinition, PackingFile, RveOptions};
use rve_server::space::Discs;

/// Estimated error that every run keeps to, as that of a scene that names none.
const ERROR: f64 = 5e-3;

/// `k_t / k_n` of the tests.
const STIFFNESS_RATIOS: [f64; 3] = [0.5, 0.8, 1.0];

/// The correction over the displacements of a full step alone.
const BY_DISPLACEMENT: Criteria =
    Criteria { force: None, displacement: Some(DisplacementMeasure::FullStep), energy: false };

/// Strains up to which evaluations are compared.
const MARKS: [f64; 4] = [0.01, 0.02, 0.03, 0.057];

/// Seed, grains and friction of the preparation of a packing, and whether the number of iterations was chosen without it.
struct Source {
    seed: u64,
    grains: usize,
    friction: f64,
    held_back: bool,
}

const fn source(seed: u64, grains: usize, friction: f64, held_back: bool) -> Source {
    Source { seed, grains, friction, held_back }
}

const SOURCES: [Source; 10] = [
    source(31, 400, 0.05, false),
    source(32, 400, 0.05, false),
    source(33, 400, 0.05, false),
    source(34, 400, 0.2, false),
    source(35, 400, 0.5, false),
    source(61, 400, 0.05, true),
    source(62, 400, 0.1, true),
    source(63, 400, 0.2, true),
    source(64, 250, 0.05, true),
    source(65, 400, 0.5, true),
];

/// A body that is compressed under 100 kPa from its sides in steps of 1e-3.
struct Test {
    name: &'static str,
    elements: [usize; 2],
    platen: Platen,
    steps: usize,
    /// Whether the displacement criterion 1e-2 alone decides; otherwise the criteria of a scene.
    by_displacement: bool,
    stiffness_ratios: &'static [f64],
}

const TESTS: [Test; 3] = [
    Test {
        name: "element",
        elements: [1, 1],
        platen: Platen::Smooth,
        steps: 57,
        by_displacement: false,
        stiffness_ratios: &STIFFNESS_RATIOS,
    },
    Test {
        name: "element, displacement 1e-2",
        elements: [1, 1],
        platen: Platen::Smooth,
        steps: 57,
        by_displacement: true,
        stiffness_ratios: &STIFFNESS_RATIOS,
    },
    Test {
        name: "2 x 4 Q8",
        elements: [2, 4],
        platen: Platen::Rough,
        steps: 40,
        by_displacement: false,
        stiffness_ratios: &[0.8],
    },
];

/// What is compared: no iterate committed before its step has converged, and the default.
const AFTER: [Option<usize>; 2] = [None, Stabilisation::UNDER_MOVING_SUPPORTS.commit_iterates_after];

/// One run.
struct Done {
    test: &'static str,
    source: &'static Source,
    stiffness_ratio: f64,
    after: Option<usize>,
    points: f64,
    result: StrategyRun,
}

/// Runs all tests over all packings.
///
/// # Errors
/// A packing cannot be made, workers are lost, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let sources = if effort.quick { &SOURCES[8..9] } else { &SOURCES[..] };
    let packings: Vec<PackingFile> = side_by_side(sources.len(), |place| {
        let Source { seed, grains, friction, .. } = sources[place];
        packing_of(seed, grains, friction, 3e7)
    })
    .into_iter()
    .collect::<anyhow::Result<_>>()?;
    let mut pieces = Vec::new();
    for test in &TESTS {
        for (place, source) in sources.iter().enumerate() {
            let ratios = if effort.quick { &test.stiffness_ratios[..1] } else { test.stiffness_ratios };
            for &stiffness_ratio in ratios {
                pieces.extend(AFTER.map(|after| (test, place, source, stiffness_ratio, after)));
            }
        }
    }
    let runs = side_by_side(pieces.len(), |piece| {
        let (test, place, source, stiffness_ratio, after) = pieces[piece];
        let (definition, options) = cell(packings[place].clone(), stiffness_ratio)?;
        let problem = problem(test, effort.choose(test.steps, 2), &options, after);
        let (points, result) = (problem.point_count() as f64, solve_on_cell(&problem, &definition)?);
        Ok(Done { test: test.name, source, stiffness_ratio, after, points, result })
    });
    let runs = runs.into_iter().collect::<anyhow::Result<Vec<Done>>>()?;
    report.raw("committed-iterates-runs", &each(&runs))?;
    report.table(
        "committed-iterates",
        "evaluations per Gauss point up to the strain, geometric means over packings and k_t/k_n, and sums over all runs",
        &means(&runs),
    )?;
    report.note(
        "`after` is `commit_iterates_after`: 0 begins every iterate at the last accepted state. \
         `last_ratio` is the mean stress ratio of the last third of the paths, with the standard error of its difference over the pairs \
         of runs, both over the pairs that came there: past a snap single runs part, means should not.",
    )?;
    Ok(())
}

fn cell(packing: PackingFile<Discs>, stiffness_ratio: f64) -> anyhow::Result<(AnyDefinition, RveOptions)> {
    let contact = ContactTable {
        normal_stiffness: None,
        modulus: Some(3e7),
        ..ContactTable::linear(1.0, stiffness_ratio, 0.55)
    };
    let options = RveOptions { error: Some(ERROR), ..RveOptions::default() };
    let definition = GrainDefinition { packing, contact, options: options.clone() }.validate()?;
    Ok((AnyDefinition::Discs(definition), options))
}

fn problem(test: &Test, steps: usize, options: &RveOptions, after: Option<usize>) -> Problem {
    let [columns, rows] = test.elements;
    let size = [columns as f64 / rows as f64, 1.0];
    let mesh = Block::plane(size, test.elements, ElementKind::Q8).mesh().expect("a sound block");
    let mut problem = Problem::new(mesh, conditions(test.platen, -1e-3 * steps as f64));
    let stage = &mut problem.stages[0];
    stage.control.increments = steps;
    stage.control.stabilisation =
        Some(Stabilisation { commit_iterates_after: after, ..Stabilisation::UNDER_MOVING_SUPPORTS });
    stage.strategy = NamedStrategy::default_of(2).preset();
    let own = Tolerances::within(ERROR);
    stage.tolerances = match test.by_displacement {
        true => Tolerances { displacement: 1e-2, criteria: BY_DISPLACEMENT, ..Tolerances::default() },
        false => own,
    };
    problem.strain_per_step = options.strain_per_step();
    let [smallest, largest] = options.strain_per_step_bounds();
    problem.error_control = Some(ErrorControl { error: ERROR, smallest, largest });
    problem
}

impl Done {
    /// Evaluations per point up to a strain; NaN if the run did not come that far.
    fn until(&self, strain: f64) -> f64 {
        let steps = self.result.increments as f64 * 1e-3;
        if strain > steps * (1.0 + 1e-9) {
            f64::NAN
        } else {
            self.result.requested_until(strain / steps) / self.points
        }
    }

    /// Mean stress ratio over the last third of the path; NaN if the run did not come there.
    fn last_ratio(&self) -> f64 {
        mean_of_last_third(self.result.steps.iter().map(|step| (step.report.load, step.ratio)))
    }
}

/// Mean over loads above two thirds; NaN if there is none.
fn mean_of_last_third(steps: impl Iterator<Item = (f64, f64)>) -> f64 {
    let late: Vec<f64> = steps.filter(|(load, _)| *load > 2.0 / 3.0).map(|(_, ratio)| ratio).collect();
    mean(&late)
}

/// NaN of no value.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The pairs of runs that both came to the last third: their ratios without and with committed iterates.
fn known_pairs(plain: &[f64], committed: &[f64]) -> [Vec<f64>; 2] {
    let pairs = plain.iter().copied().zip(committed.iter().copied());
    pairs.filter(|(one, other)| !one.is_nan() && !other.is_nan()).unzip::<f64, f64, Vec<f64>, Vec<f64>>().into()
}

fn each(runs: &[Done]) -> Table {
    let mut table = Table::new([
        "test",
        "seed",
        "held_back",
        "stiffness_ratio",
        "after",
        "to_0.01",
        "to_0.02",
        "to_0.03",
        "to_0.057",
        "whole",
        "failed",
        "stabilised",
        "with_committed_iterates",
        "stagnated",
        "not_equilibrated",
        "force_evaluations",
        "last_ratio",
        "reached",
    ]);
    for run in runs {
        let statistics = &run.result.run.statistics;
        let [first, second, third, last] = MARKS.map(|strain| run.until(strain).into());
        table.row([
            run.test.into(),
            run.source.seed.into(),
            u64::from(run.source.held_back).into(),
            run.stiffness_ratio.into(),
            run.after.unwrap_or(0).into(),
            first,
            second,
            third,
            last,
            (statistics.evaluations as f64 / run.points).into(),
            statistics.cut_backs.into(),
            statistics.stabilised_steps.into(),
            statistics.steps_with_committed_iterates.into(),
            statistics.stagnated_steps.into(),
            statistics.flags.not_equilibrated.into(),
            statistics.cost.force_evaluations.into(),
            run.last_ratio().into(),
            run.result.run.load.into(),
        ]);
    }
    table
}

fn means(runs: &[Done]) -> Table {
    let mut table = Table::new([
        "test",
        "packings",
        "after",
        "to_0.01",
        "to_0.02",
        "to_0.03",
        "to_0.057",
        "whole",
        "failed",
        "stabilised",
        "force_evaluations",
        "last_ratio",
        "standard_error",
    ]);
    for test in &TESTS {
        for held_back in [false, true] {
            let of = |after: Option<usize>| {
                let chosen =
                    |run: &&Done| run.test == test.name && run.source.held_back == held_back && run.after == after;
                runs.iter().filter(chosen).collect::<Vec<&Done>>()
            };
            let [plain, committed] = AFTER.map(of);
            let ratios = |runs: &[&Done]| runs.iter().map(|run| run.last_ratio()).collect::<Vec<f64>>();
            let known = known_pairs(&ratios(&plain), &ratios(&committed));
            let differences: Vec<f64> = known[0].iter().zip(&known[1]).map(|(one, other)| other - one).collect();
            for ((after, chosen), ratios) in AFTER.into_iter().zip([&plain, &committed]).zip(&known) {
                if chosen.is_empty() {
                    continue;
                }
                let geometric = |figure: &dyn Fn(&Done) -> f64| {
                    (chosen.iter().map(|run| figure(run).ln()).sum::<f64>() / chosen.len() as f64).exp()
                };
                let sum = |count: &dyn Fn(&Done) -> u64| chosen.iter().map(|run| count(run)).sum::<u64>();
                let [first, second, third, last] = MARKS.map(|strain| geometric(&|run| run.until(strain)).into());
                table.row([
                    test.name.into(),
                    if held_back { "held back" } else { "tuned on" }.into(),
                    after.unwrap_or(0).into(),
                    first,
                    second,
                    third,
                    last,
                    geometric(&|run| run.result.run.statistics.evaluations as f64 / run.points).into(),
                    sum(&|run| run.result.run.statistics.cut_backs).into(),
                    sum(&|run| run.result.run.statistics.stabilised_steps).into(),
                    sum(&|run| run.result.run.statistics.cost.force_evaluations).into(),
                    mean(ratios).into(),
                    standard_error(&differences).into(),
                ]);
            }
        }
    }
    table
}

/// Standard error of a mean; NaN of fewer than two values.
fn standard_error(values: &[f64]) -> f64 {
    let (count, mean) = (values.len() as f64, mean(values));
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (squares / (count - 1.0) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_error_is_that_of_a_mean() {
        assert!((standard_error(&[1.0, 2.0, 3.0, 4.0]) - (5.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-15);
        assert!(standard_error(&[1.0]).is_nan());
    }

    /// A run that broke off early counted with a stress ratio of 0.
    #[test]
    fn a_run_that_did_not_reach_the_last_third_has_no_ratio_there() {
        let steps = [(0.0, 1.0), (0.5, 3.0), (0.75, 2.0), (1.0, 1.0)];
        assert_eq!(mean_of_last_third(steps.into_iter()), 1.5);
        assert!(mean_of_last_third(steps[..2].iter().copied()).is_nan());
        let known = known_pairs(&[1.0, f64::NAN, 3.0], &[2.0, 2.0, f64::NAN]);
        assert_eq!(known, [vec![1.0], vec![2.0]]);
        assert!(mean(&known_pairs(&[f64::NAN], &[1.0])[0]).is_nan());
    }
}
