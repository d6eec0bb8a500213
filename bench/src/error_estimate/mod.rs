//! The estimated error of the stresses against the true one, and what it costs to keep to an error.
//!
//! Every cell is solved along three paths to a strain well past the peak of most: tightly (the reference), at fixed strains per ramp
//! step, and with `rve.error`. The true error is the difference of the stress from the reference over the largest mean pressure so
//! far, at equal strains; error and estimate are root mean squares over the steps up to the peak of the reference, and over those
//! past it, where cells snap and any two solutions are members of an ensemble. Work is counted in force evaluations, so a busy
//! machine changes no figure.

mod case;

use super::report::Report;
use super::table::Table;
use crate::effort::Effort;
use crate::newton::case::side_by_side;
use case::{Grains, Loading, Mark, Solution, cells, names, solution};
use protocol::Tensor2;
use rve_server::definition::RveOptions;
use std::collections::BTreeSet;
use std::time::Instant;

/// Load steps of 1e-3.
const STEPS: usize = 24;

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

/// What `--only` may name.
pub(super) fn parts(effort: &Effort) -> Vec<String> {
    names(effort.quick)
}

/// Measures all cells, paths and settings, or the cells that the command line names. Tables are written again after each cell, so that
/// a study that is interrupted leaves the cells it has finished.
///
/// # Errors
/// A packing cannot be made, a worker ends early, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let (cells, steps) = (cells(effort.quick)?, effort.choose(STEPS, 5));
    let known: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
    let settings = Setting::all();
    let mut cases = Vec::new();
    let mut by_step = Table::new(["cell", "path", "setting", "step", "stress_ratio", "true", "estimated"]);
    for cell in cells.iter().filter(|cell| effort.includes(&cell.name, &known)) {
        let begin = Instant::now();
        let solved = side_by_side(Loading::ALL.len() * settings.len(), |piece| {
            let (loading, setting) = (Loading::ALL[piece / settings.len()], settings[piece % settings.len()]);
            solution(cell, loading, &setting.options(), steps, setting != Setting::Tight)
        });
        let solved = solved.into_iter().collect::<anyhow::Result<Vec<Solution>>>()?;
        for (loading, solutions) in Loading::ALL.into_iter().zip(solved.chunks(settings.len())) {
            let peak = peak(&solutions[0]);
            let errors: Vec<Vec<StepError>> =
                solutions.iter().skip(1).map(|found| errors(&solutions[0], found)).collect();
            let shared = shared_steps(&errors);
            for ((setting, solution), errors) in settings.iter().zip(solutions).skip(1).zip(&errors) {
                for error in errors {
                    by_step.row([
                        cell.name.as_str().into(),
                        loading.name().into(),
                        setting.name().into(),
                        error.step.into(),
                        error.ratio.into(),
                        error.truth.into(),
                        error.estimate.into(),
                    ]);
                }
                for part in Part::ALL {
                    let of_part = |error: &&StepError| part == Part::of(error.step, peak);
                    if errors.iter().any(|error| of_part(&error)) {
                        let compared = errors.iter().filter(|error| of_part(error) && shared.contains(&error.step));
                        let figures = Figures::of(&compared.copied().collect::<Vec<_>>());
                        cases.push(Case::new(cell, loading, part, *setting, figures, solution));
                    }
                }
            }
        }
        report.raw("steps", &by_step)?;
        report.raw("cases", &table(&cases))?;
        report.raw("settings", &by_setting(&cases, &settings))?;
        report.note(&format!("{}: done in {:.0} s", cell.name, begin.elapsed().as_secs_f64()))?;
    }
    report.table("cases", "true and estimated error of every cell, path and setting", &table(&cases))?;
    report.table("settings", "over all cells and paths, by setting", &by_setting(&cases, &settings))?;
    report.note(
        "strains: prescribed, or found so that forces are in balance, whose tolerance is then part of the true error. part: up to the peak of the stress ratio of the reference, or past it. true, estimated: root mean squares over the `steps` \
         that all settings of the cell and path have, empty if there is none. ratio: estimated over true error, over those of them with an \
         estimate. work: force evaluations per load step of the whole path; replicas: those of the second solution over them. \
         best_fixed: work over that of the cheapest fixed strain per step of the same cell, path and part whose true error is not \
         larger; empty if none is as accurate.",
    )?;
    Ok(())
}

/// Part of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    ToThePeak,
    Past,
}

impl Part {
    const ALL: [Self; 2] = [Self::ToThePeak, Self::Past];

    fn of(step: usize, peak: usize) -> Self {
        if step <= peak { Self::ToThePeak } else { Self::Past }
    }

    fn name(self) -> &'static str {
        match self {
            Self::ToThePeak => "to the peak",
            Self::Past => "past it",
        }
    }
}

/// Figures of one cell, path, part and setting.
struct Case {
    cell: String,
    loading: Loading,
    part: Part,
    setting: Setting,
    figures: Figures,
    work: f64,
    replicas: f64,
    is_complete: bool,
}

/// Root mean squares over some load steps; NaN over none.
#[derive(Clone, Copy, Debug)]
struct Figures {
    truth: f64,
    /// Of the steps that have an estimate.
    estimate: f64,
    /// Estimated over true error, both of the steps that have an estimate.
    ratio: f64,
    /// Steps that `truth` is taken over.
    steps: usize,
}

impl Figures {
    fn of(errors: &[StepError]) -> Self {
        let truth = |errors: &[StepError]| root_mean_square(errors.iter().map(|error| error.truth));
        let estimated: Vec<StepError> = errors.iter().copied().filter(|error| error.estimate.is_finite()).collect();
        let estimate = root_mean_square(estimated.iter().map(|error| error.estimate));
        Self { truth: truth(errors), estimate, ratio: estimate / truth(&estimated), steps: errors.len() }
    }
}

impl Case {
    fn new(
        cell: &Grains,
        loading: Loading,
        part: Part,
        setting: Setting,
        figures: Figures,
        solution: &Solution,
    ) -> Self {
        let [own, replicas] = solution.force_evaluations.map(|count| count as f64);
        Self {
            cell: cell.name.clone(),
            loading,
            part,
            setting,
            figures,
            work: own / (solution.load * solution.steps as f64),
            replicas: replicas / own,
            is_complete: solution.is_complete,
        }
    }

    /// Work over that of the cheapest fixed setting that is as accurate.
    fn over_best_fixed(&self, all: &[Self]) -> f64 {
        let rival = |other: &&Self| {
            matches!(other.setting, Setting::Fixed(_))
                && (&other.cell, other.loading, other.part) == (&self.cell, self.loading, self.part)
                && other.figures.truth <= self.figures.truth
        };
        let cheapest = all.iter().filter(rival).map(|other| other.work).fold(f64::INFINITY, f64::min);
        if cheapest.is_finite() { self.work / cheapest } else { f64::NAN }
    }
}

/// Errors at the end of one load step.
#[derive(Clone, Copy, Debug)]
struct StepError {
    step: usize,
    /// Stress ratio of the reference.
    ratio: f64,
    truth: f64,
    estimate: f64,
}

/// Difference of the principal stresses in the plane over their sum.
fn stress_ratio(stress: &Tensor2) -> f64 {
    let deviator = (stress.get(0, 0) - stress.get(1, 1)).hypot(stress.get(0, 1) + stress.get(1, 0));
    (deviator / (stress.get(0, 0) + stress.get(1, 1))).abs()
}

/// Load step with the largest stress ratio.
fn peak(reference: &Solution) -> usize {
    let ratio = |mark: &&Mark| stress_ratio(&mark.stress);
    let largest = reference.marks.iter().max_by(|one, other| ratio(one).total_cmp(&ratio(other)));
    largest.map_or(0, |mark| mark.step)
}

/// Stress differences over the largest pressure so far, at the ends of the load steps that both solutions have.
fn errors(reference: &Solution, found: &Solution) -> Vec<StepError> {
    let mut pressure = 0.0_f64;
    let mut errors = Vec::new();
    for mark in &reference.marks {
        pressure = pressure.max(-0.5 * (mark.stress.get(0, 0) + mark.stress.get(1, 1)));
        let Some(other) = found.marks.iter().find(|other| other.step == mark.step) else { continue };
        let squares = mark.stress.0.iter().zip(&other.stress.0).map(|(one, other)| (one - other).powi(2));
        errors.push(StepError {
            step: mark.step,
            ratio: stress_ratio(&mark.stress),
            truth: squares.sum::<f64>().sqrt() / pressure,
            estimate: other.estimate,
        });
    }
    errors
}

/// Load steps that all settings have: a setting that broke off, or was cut back over the end of a step, has fewer, and errors over other
/// steps are no comparison.
fn shared_steps(errors: &[Vec<StepError>]) -> BTreeSet<usize> {
    let has = |errors: &[StepError], step: usize| errors.iter().any(|error| error.step == step);
    let first = errors.first().into_iter().flatten().map(|error| error.step);
    first.filter(|&step| errors.iter().all(|errors| has(errors, step))).collect()
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let known: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    // Nothing known is not nothing wrong.
    (known.iter().map(|value| value * value).sum::<f64>() / known.len() as f64).sqrt()
}

fn table(cases: &[Case]) -> Table {
    let heads = [
        "cell",
        "path",
        "part",
        "setting",
        "true",
        "estimated",
        "ratio",
        "work",
        "replicas",
        "best_fixed",
        "steps",
        "end",
    ];
    let mut table = Table::new(heads);
    for case in cases {
        table.row([
            case.cell.as_str().into(),
            case.loading.name().into(),
            case.part.name().into(),
            case.setting.name().into(),
            case.figures.truth.into(),
            case.figures.estimate.into(),
            case.figures.ratio.into(),
            case.work.into(),
            case.replicas.into(),
            case.over_best_fixed(cases).into(),
            case.figures.steps.into(),
            if case.is_complete { "completed" } else { "broke off" }.into(),
        ]);
    }
    table
}

fn by_setting(cases: &[Case], settings: &[Setting]) -> Table {
    let heads = [
        "strains",
        "part",
        "setting",
        "cases",
        "median_true",
        "largest_true",
        "within_2",
        "within_3",
        "smallest_ratio",
        "median_ratio",
        "largest_ratio",
        "median_work",
        "median_best_fixed",
    ];
    let mut table = Table::new(heads);
    for ((prescribed, part), setting) in [true, false]
        .into_iter()
        .flat_map(|prescribed| Part::ALL.map(|part| (prescribed, part)))
        .flat_map(|group| settings.iter().skip(1).map(move |one| (group, one)))
    {
        let belongs = |case: &&Case| {
            (case.loading.prescribes_strains(), case.part, case.setting) == (prescribed, part, *setting)
        };
        let chosen: Vec<&Case> = cases.iter().filter(belongs).collect();
        let ratios = sorted(chosen.iter().map(|case| case.figures.ratio));
        let within = |factor: f64| ratios.iter().filter(|ratio| (1.0 / factor..=factor).contains(*ratio)).count();
        let errors = sorted(chosen.iter().map(|case| case.figures.truth));
        let work = sorted(chosen.iter().map(|case| case.work));
        let best = sorted(chosen.iter().map(|case| case.over_best_fixed(cases)));
        table.row([
            if prescribed { "prescribed" } else { "in balance" }.into(),
            part.name().into(),
            setting.name().into(),
            chosen.len().into(),
            middle(&errors).into(),
            errors.last().copied().unwrap_or(f64::NAN).into(),
            within(2.0).into(),
            within(3.0).into(),
            ratios.first().copied().unwrap_or(f64::NAN).into(),
            middle(&ratios).into(),
            ratios.last().copied().unwrap_or(f64::NAN).into(),
            middle(&work).into(),
            middle(&best).into(),
        ]);
    }
    table
}

/// In their order, without those that are not known.
fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
    values.sort_by(f64::total_cmp);
    values
}

fn middle(sorted: &[f64]) -> f64 {
    crate::repeat::median(sorted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(step: usize, truth: f64, estimate: f64) -> StepError {
        StepError { step, ratio: 1.0, truth, estimate }
    }

    /// A setting that broke off before the cells snapped had the smallest error.
    #[test]
    fn errors_are_compared_over_the_steps_that_all_settings_have() {
        let whole = vec![error(1, 1.0, 1.0), error(2, 1.0, 1.0), error(3, 9.0, 9.0)];
        let cut_back = vec![error(1, 1.0, 1.0), error(3, 9.0, 9.0)];
        let broken = vec![error(1, 1.0, 1.0), error(2, 1.0, 1.0)];
        let steps = |errors: &[Vec<StepError>]| shared_steps(errors).into_iter().collect::<Vec<_>>();
        assert_eq!(steps(&[whole.clone(), cut_back, broken]), [1]);
        assert!(steps(&[whole.clone(), Vec::new()]).is_empty());
        assert_eq!(steps(&[whole]), [1, 2, 3]);
        assert!(steps(&[]).is_empty());
    }

    /// The estimate of one step was divided by the error of all.
    #[test]
    fn the_ratio_is_over_steps_that_have_truth_and_estimate() {
        let figures = Figures::of(&[error(1, 1.0, 2.0), error(2, 7.0, f64::NAN)]);
        assert_eq!((figures.truth, figures.estimate, figures.ratio, figures.steps), (5.0, 2.0, 2.0, 2));
        let without = Figures::of(&[error(1, 1.0, f64::NAN)]);
        assert!(without.truth == 1.0 && without.estimate.is_nan() && without.ratio.is_nan());
        let nothing = Figures::of(&[]);
        assert!(nothing.truth.is_nan() && nothing.ratio.is_nan() && nothing.steps == 0);
        assert_eq!(sorted([3.0, f64::NAN, 1.0].into_iter()), [1.0, 3.0]);
    }
}
