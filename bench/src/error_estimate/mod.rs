//! The estimated error of the stresses against the true one, and what it costs to keep to an error.
//!
//! Every cell is solved along two paths to a strain well past the peak of most: tightly (the reference), at fixed strains per ramp
//! step, and with `rve.error`. The true error is the difference of the stress from the reference over the largest mean pressure so
//! far; error and estimate are root mean squares over the steps. Work is counted in force evaluations, so a busy machine changes
//! no figure.

mod case;

use super::Effort;
use super::report::Report;
use super::table::Table;
use crate::newton::case::side_by_side;
use case::{Grains, Loading, Solution, cells, solution};
use protocol::Tensor2;
use rve_server::definition::RveOptions;
use std::time::Instant;

/// Load steps of 1e-3.
const STEPS: usize = 40;

/// Strain per ramp step and tolerance of the reference.
const TIGHT: (f64, f64) = (2e-7, 1e-6);

/// Fixed strains per ramp step.
const FIXED: [f64; 5] = [1e-6, 2e-6, 5e-6, 1e-5, 2e-5];

/// Tolerance with them: that of `rve.error = 5e-3`.
const TOLERANCE: f64 = 1e-2;

/// Errors that are asked for.
const WANTED: [f64; 3] = [2e-3, 5e-3, 1e-2];

/// How a cell is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Setting {
    Tight,
    Fixed(f64),
    ByError(f64),
}

impl Setting {
    fn all() -> Vec<Self> {
        let fixed = FIXED.map(Self::Fixed);
        [Self::Tight].into_iter().chain(fixed).chain(WANTED.map(Self::ByError)).collect()
    }

    fn options(self) -> RveOptions {
        let given = |strain, tolerance| RveOptions {
            strain_per_step: Some(strain),
            tolerance: Some(tolerance),
            ..RveOptions::default()
        };
        match self {
            Self::Tight => given(TIGHT.0, TIGHT.1),
            Self::Fixed(strain) => given(strain, TOLERANCE),
            Self::ByError(error) => RveOptions { error: Some(error), ..RveOptions::default() },
        }
    }

    fn name(self) -> String {
        match self {
            Self::Tight => "reference".to_owned(),
            Self::Fixed(strain) => format!("strain {strain:.0e}"),
            Self::ByError(error) => format!("error {error:.0e}"),
        }
    }
}

/// Measures all cells, paths and settings, or the cells that the command line names. Tables are written anew after each cell, so that
/// a study that is interrupted leaves the cells it has finished.
///
/// # Errors
/// A packing cannot be made, a worker ends early, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let (cells, steps) = (cells(effort.quick)?, effort.choose(STEPS, 5));
    let names: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
    let settings = Setting::all();
    let mut cases = Vec::new();
    for cell in cells.iter().filter(|cell| effort.includes(&cell.name, &names)) {
        let begin = Instant::now();
        let solved = side_by_side(Loading::ALL.len() * settings.len(), |piece| {
            let (loading, setting) = (Loading::ALL[piece / settings.len()], settings[piece % settings.len()]);
            solution(cell, loading, &setting.options(), steps, setting != Setting::Tight)
        });
        let solved = solved.into_iter().collect::<anyhow::Result<Vec<Solution>>>()?;
        for (loading, solutions) in Loading::ALL.into_iter().zip(solved.chunks(settings.len())) {
            for (setting, solution) in settings.iter().zip(solutions).skip(1) {
                cases.push(Case::new(cell, loading, *setting, &solutions[0], solution));
            }
        }
        report.raw("cases", &table(&cases))?;
        report.raw("settings", &by_setting(&cases, &settings))?;
        report.note(&format!("{}: done in {:.0} s", cell.name, begin.elapsed().as_secs_f64()))?;
    }
    report.table("cases", "true and estimated error of every cell, path and setting", &table(&cases))?;
    report.table("settings", "over all cells and paths, by setting", &by_setting(&cases, &settings))?;
    report.note(
        "ratio: estimated over true error, root mean squares over the steps. work: force evaluations per load step; replicas: those of \
         the second solution over them. best_fixed: work over that of the cheapest fixed strain per step of the same cell and path \
         whose true error is not larger; empty if none is as accurate.",
    )?;
    Ok(())
}

/// Figures of one cell, path and setting.
struct Case {
    cell: String,
    loading: Loading,
    setting: Setting,
    truth: f64,
    estimate: f64,
    work: f64,
    replicas: f64,
    steps: usize,
    is_complete: bool,
}

impl Case {
    fn new(cell: &Grains, loading: Loading, setting: Setting, reference: &Solution, solution: &Solution) -> Self {
        let errors = errors(&reference.stresses, &solution.stresses);
        let steps = errors.len();
        let [own, replicas] = solution.force_evaluations.map(|count| count as f64);
        Self {
            cell: cell.name.clone(),
            loading,
            setting,
            truth: root_mean_square(&errors),
            estimate: root_mean_square(&solution.estimates[..steps]),
            work: own / solution.stresses.len().max(1) as f64,
            replicas: replicas / own,
            steps,
            is_complete: solution.is_complete,
        }
    }

    /// Work over that of the cheapest fixed setting that is as accurate.
    fn over_best_fixed(&self, all: &[Self]) -> f64 {
        let rival = |other: &&Self| {
            matches!(other.setting, Setting::Fixed(_))
                && (&other.cell, other.loading) == (&self.cell, self.loading)
                && other.truth <= self.truth
        };
        let cheapest = all.iter().filter(rival).map(|other| other.work).fold(f64::INFINITY, f64::min);
        if cheapest.is_finite() { self.work / cheapest } else { f64::NAN }
    }
}

/// Stress differences over the largest pressure so far, step by step, as far as both paths reach.
fn errors(reference: &[Tensor2], found: &[Tensor2]) -> Vec<f64> {
    let mut pressure = 0.0_f64;
    reference
        .iter()
        .zip(found)
        .map(|(reference, found)| {
            pressure = pressure.max(-0.5 * (reference.get(0, 0) + reference.get(1, 1)));
            let squares = reference.0.iter().zip(&found.0).map(|(one, other)| (one - other).powi(2));
            squares.sum::<f64>().sqrt() / pressure
        })
        .collect()
}

fn root_mean_square(values: &[f64]) -> f64 {
    let known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    (known.iter().map(|value| value * value).sum::<f64>() / known.len().max(1) as f64).sqrt()
}

fn table(cases: &[Case]) -> Table {
    let heads =
        ["cell", "path", "setting", "true", "estimated", "ratio", "work", "replicas", "best_fixed", "steps", "end"];
    let mut table = Table::new(heads);
    for case in cases {
        table.row([
            case.cell.as_str().into(),
            case.loading.name().into(),
            case.setting.name().into(),
            case.truth.into(),
            case.estimate.into(),
            (case.estimate / case.truth).into(),
            case.work.into(),
            case.replicas.into(),
            case.over_best_fixed(cases).into(),
            case.steps.into(),
            if case.is_complete { "completed" } else { "broke off" }.into(),
        ]);
    }
    table
}

fn by_setting(cases: &[Case], settings: &[Setting]) -> Table {
    let heads = [
        "setting",
        "cases",
        "median_true",
        "largest_true",
        "within_2",
        "within_3",
        "smallest_ratio",
        "largest_ratio",
        "median_work",
    ];
    let mut table = Table::new(heads);
    for setting in settings.iter().skip(1) {
        let of_setting: Vec<&Case> = cases.iter().filter(|case| case.setting == *setting).collect();
        let ratios = sorted(of_setting.iter().map(|case| case.estimate / case.truth));
        let within = |factor: f64| ratios.iter().filter(|ratio| (1.0 / factor..=factor).contains(*ratio)).count();
        let errors = sorted(of_setting.iter().map(|case| case.truth));
        let work = sorted(of_setting.iter().map(|case| case.work));
        table.row([
            setting.name().into(),
            of_setting.len().into(),
            middle(&errors).into(),
            errors.last().copied().unwrap_or(f64::NAN).into(),
            within(2.0).into(),
            within(3.0).into(),
            ratios.first().copied().unwrap_or(f64::NAN).into(),
            ratios.last().copied().unwrap_or(f64::NAN).into(),
            middle(&work).into(),
        ]);
    }
    table
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn middle(sorted: &[f64]) -> f64 {
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
