//! P-2: error of a coupled run over its evaluations, for steps, tolerances, strategies and operators, against a run with a tolerance ten times
//! tighter and twice as many steps. The grain solver is the same for all, so that what differs is the solution of the macro problem.

use super::biaxial::conditions;
use super::case::{
    STABILISATION, StrategyRun, definition, packing_of_seed, side_by_side, small_packing, solve_on_grains,
};
use super::strategies::{Variant, operators, own};
use crate::effort::Effort;
use crate::report::Report;
use crate::table::Table;
use charts::{Chart, Scale};
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::problem::{Criteria, NamedStrategy, Platen, Problem, Strategy, Tolerances};
use rve_server::definition::{Accuracy, RveOptions};

/// Width and height of the specimen, m.
const SIZE: [f64; 2] = [0.05, 0.10];

/// Compression of all runs, before the peak: past it runs take branches, and errors say which.
const COMPRESSION: f64 = 6e-3;

/// Steps of the coarsest run; the loads at which all are compared.
const FEWEST_STEPS: usize = 6;

/// Out-of-balance forces over reactions that are compared.
const TOLERANCES: [f64; 3] = [1e-2, 1e-3, 1e-4];

/// Of the reference.
const REFERENCE: f64 = 1e-5;

/// A run that is measured.
#[derive(Clone, Debug)]
struct Setting {
    variant: Variant,
    steps: usize,
    tolerance: f64,
}

/// The default strategy with all steps and tolerances, then all strategies and operators with one of each; the reference last.
fn settings(effort: &Effort) -> Vec<Setting> {
    let default = NamedStrategy::SlipNewton;
    let by_default = Variant { name: default.keyword().to_owned(), strategy: default.preset() };
    let steps = [1, 2, 4].map(|finer| finer * FEWEST_STEPS);
    let mut all = Vec::new();
    for tolerance in TOLERANCES {
        all.extend(steps.map(|steps| Setting { variant: by_default.clone(), steps, tolerance }));
    }
    let others = [own(), operators()].concat().into_iter().filter(|variant| variant.name != by_default.name);
    let others = others.take(effort.choose(usize::MAX, 1));
    all.extend(others.map(|variant| Setting { variant, steps: steps[1], tolerance: TOLERANCES[1] }));
    all.push(Setting { variant: by_default, steps: 2 * steps[2], tolerance: REFERENCE });
    all
}

/// Measures all settings.
///
/// # Errors
/// The packing cannot be made, workers are lost, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let (packing, elements, accuracy) = match effort.quick {
        true => (small_packing()?, [1, 1], Accuracy::Draft),
        false => (packing_of_seed(1)?, [2, 4], Accuracy::Default),
    };
    let grains = [definition(packing, accuracy)?];
    let settings = settings(effort);
    let points = (4 * elements[0] * elements[1]) as f64;
    let runs = side_by_side(settings.len(), |place| {
        let Setting { variant, steps, tolerance } = &settings[place];
        solve_on_grains(&problem(elements, *steps, *tolerance, &variant.strategy, accuracy), &grains)
    });
    let runs = runs.into_iter().collect::<anyhow::Result<Vec<StrategyRun>>>()?;
    let reference = runs.last().expect("the reference is always run");
    let discs = effort.choose(400, 100);
    report.note(&format!(
        "work-precision: {} x {} Q8 between rough platens under 100 kPa to {} %, {discs} discs a cell; error: root mean square of the stress \
         ratio at {FEWEST_STEPS} loads, over its largest value, against {} steps with {REFERENCE:e}",
        elements[0],
        elements[1],
        100.0 * COMPRESSION,
        8 * FEWEST_STEPS
    ))?;
    let mut table = Table::new([
        "variant",
        "steps",
        "force_tolerance",
        "evaluations",
        "tangents",
        "Mforce_evaluations",
        "processor_s",
        "failed",
        "stagnated",
        "error",
        "end",
    ]);
    for (setting, run) in settings.iter().zip(&runs) {
        let statistics = &run.run.statistics;
        table.row([
            setting.variant.name.as_str().into(),
            setting.steps.into(),
            setting.tolerance.into(),
            (statistics.evaluations as f64 / points).into(),
            (statistics.tangents as f64 / points).into(),
            (statistics.cost.force_evaluations as f64 * 1e-6).into(),
            run.processor.into(),
            statistics.cut_backs.into(),
            statistics.stagnated_steps.into(),
            error(run, reference).into(),
            run.end().into(),
        ]);
    }
    report.table("work-precision", "evaluations and tangents per Gauss point, error of the stress ratio", &table)?;
    let mut chart = Chart::new(
        "coupled run before the peak",
        ("evaluations per Gauss point", Scale::Logarithmic),
        ("error of the stress ratio", Scale::Logarithmic),
    );
    for tolerance in TOLERANCES {
        let of_tolerance = settings.iter().zip(&runs).take(9).filter(|(setting, _)| setting.tolerance == tolerance);
        let curve =
            of_tolerance.map(|(_, run)| [run.run.statistics.evaluations as f64 / points, error(run, reference)]);
        chart.curve(&format!("6, 12, 24 steps, tolerance {tolerance:e}"), curve);
    }
    report.chart("work-precision", &chart)?;
    Ok(())
}

fn problem(elements: [usize; 2], steps: usize, tolerance: f64, strategy: &Strategy, accuracy: Accuracy) -> Problem {
    let mesh = Block::plane(SIZE, elements, ElementKind::Q8).mesh().expect("a sound block");
    let mut problem = Problem::new(mesh, conditions(Platen::Rough, -COMPRESSION * SIZE[1]));
    let stage = &mut problem.stages[0];
    stage.control.increments = steps;
    stage.control.min = 1.0 / (64 * steps) as f64;
    stage.control.max_iterations = 50;
    stage.control.stabilisation = STABILISATION;
    stage.strategy = strategy.clone();
    stage.tolerances =
        Tolerances { force: tolerance, criteria: Criteria::FORCE_OVER_REACTIONS, ..Tolerances::default() };
    problem.strain_per_step = RveOptions { accuracy, ..RveOptions::default() }.strain_per_step();
    problem
}

/// Root mean square of the difference of the stress ratios at the loads of the coarsest run, over the largest ratio there; NaN where a run
/// did not come so far.
fn error(run: &StrategyRun, reference: &StrategyRun) -> f64 {
    let ratio = |run: &StrategyRun, load: f64| {
        run.steps.iter().find(|step| (step.report.load - load).abs() < 1e-9).map_or(f64::NAN, |step| step.ratio)
    };
    root_mean_square((1..=FEWEST_STEPS).map(|number| {
        let load = number as f64 / FEWEST_STEPS as f64;
        [ratio(run, load), ratio(reference, load)]
    }))
}

/// Of the differences of pairs, over the largest second value.
fn root_mean_square(pairs: impl Iterator<Item = [f64; 2]>) -> f64 {
    let (mut sum, mut count, mut largest) = (0.0, 0, 0.0f64);
    for [value, expected] in pairs {
        sum += (value - expected).powi(2);
        largest = largest.max(expected.abs());
        count += 1;
    }
    (sum / f64::from(count)).sqrt() / largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_measured_with_all_steps_and_tolerances_and_the_reference_comes_last() {
        let all = settings(&Effort::default());
        assert_eq!(all.len(), 9 + own().len() - 1 + operators().len() + 1);
        let (first, last) = (&all[..9], all.last().unwrap());
        assert!(first.iter().all(|setting| setting.variant.name == "slip_newton"));
        assert!(all[..all.len() - 1].iter().all(|setting| setting.tolerance >= 10.0 * last.tolerance));
        assert!(all.iter().all(|setting| setting.steps % FEWEST_STEPS == 0 && setting.steps <= last.steps));
    }

    #[test]
    fn errors_are_relative_to_the_largest_value_and_a_missing_load_is_none() {
        let error = root_mean_square([[1.1, 1.0], [2.0, 2.0]].into_iter());
        assert!((error - (0.01f64 / 2.0).sqrt() / 2.0).abs() < 1e-12);
        assert!(root_mean_square([[f64::NAN, 1.0]].into_iter()).is_nan());
    }
}
