//! How a small scene ended, and whether a finer run ends with the same stress.

use super::super::check::{bound, varied};
use super::super::groups::{Compared, compared};
use super::super::packings::Slot;
use super::draw::Scene;
use super::problem::problem;
use crate::newton::case::{StrategyRun, solve_on_cell};
use macro_solver::observer::Outcome;
use rve_server::definition::RveOptions;

/// Iterates of a finer run are held to this share of the tolerances.
const TIGHTNESS: f64 = 0.1;

/// Scenes of at most this many evaluations of points, and of this many force evaluations times grains, are compared with finer runs: two to
/// twelve times the work of the scene. Counted, not timed, so that the same scenes are compared on every machine.
const CHEAP: (u64, f64) = (1000, 1e8);

/// What a scene has shown.
pub(super) struct Finding {
    /// How it ended.
    pub(super) class: String,
    /// The run itself.
    pub(super) run: StrategyRun,
    /// Largest difference of a component of the mean stress at the end from the finer run, over the mean pressure.
    pub(super) error: f64,
    /// What it is compared with.
    pub(super) bound: f64,
    /// Distance of the ranges of coarse and fine runs; NaN where the first finer run agreed.
    pub(super) gap: f64,
}

/// Runs a scene, and finer ones if it is to be `checked`; shows every run to `watch`, with its strain per step and its tolerance over those
/// of the scene.
///
/// # Errors
/// A packing or a mesh that cannot be made, or a worker that ends early.
pub(super) fn found(
    scene: &Scene,
    slot: &Slot,
    checked: bool,
    watch: &mut dyn FnMut([f64; 2], &StrategyRun),
) -> anyhow::Result<Finding> {
    let run = solved(scene, slot, &scene.options, 1.0)?;
    watch([1.0, 1.0], &run);
    let bound = bound(&scene.options);
    let mut finding = Finding { class: class(&run), run, error: f64::NAN, bound, gap: f64::NAN };
    let scale = mean_pressure(&finding.run, scene);
    let Some(first) = end(&finding.run, scale).filter(|_| checked) else { return Ok(finding) };
    let statistics = &finding.run.run.statistics;
    if statistics.evaluations > CHEAP.0 || statistics.cost.force_evaluations as f64 * slot.number as f64 > CHEAP.1 {
        finding.class = "unchecked: a finer run would be dear".to_owned();
        return Ok(finding);
    }
    let mut broken = String::new();
    let comparison = compared(first, bound, |setting| {
        let tightness = if setting[1] < 1.0 { TIGHTNESS } else { 1.0 };
        match solved(scene, slot, &varied(&scene.options, setting), tightness) {
            Ok(run) => {
                watch(setting, &run);
                broken = class(&run);
                end(&run, scale)
            }
            Err(error) => {
                broken = format!("broke off: {error:#}");
                None
            }
        }
    });
    finding.class = match comparison {
        Compared::Decided(found) => {
            (finding.error, finding.gap) = (found.error, found.gap);
            match found.is_apart(bound) {
                true => format!("wrong: ends {:.1} % of the mean pressure away from finer runs", 100.0 * found.gap),
                false => "right".to_owned(),
            }
        }
        Compared::Undecided(found) => {
            (finding.error, finding.gap) = (found.error, found.gap);
            format!("unchecked: a finer run {broken}")
        }
        Compared::Nothing => format!("unchecked: the finer run {broken}"),
    };
    Ok(finding)
}

fn solved(scene: &Scene, slot: &Slot, options: &RveOptions, tightness: f64) -> anyhow::Result<StrategyRun> {
    solve_on_cell(&problem(scene, options, tightness)?, &scene.definition(slot, options)?)
}

/// Mean pressure of the body over its steps, Pa, as cases have it along their paths; no less than a tenth of the pressure on the sides.
fn mean_pressure(run: &StrategyRun, scene: &Scene) -> f64 {
    let axes = if scene.elements[2] == 0 { 2 } else { 3 };
    let pressure = |stress: &[f64; 9]| -(0..axes).map(|axis| stress[4 * axis]).sum::<f64>() / axes as f64;
    let sum: f64 = run.steps.iter().map(|step| pressure(&step.stress)).sum();
    (sum / run.steps.len().max(1) as f64).max(0.1 * scene.pressure)
}

/// Mean stress at the end of the path over a `scale`, Pa; `None` before the end.
fn end(run: &StrategyRun, scale: f64) -> Option<Vec<f64>> {
    let last = run.steps.last().filter(|_| run.is_complete())?;
    let end: Vec<f64> = last.stress.iter().map(|stress| stress / scale).collect();
    end.iter().all(|stress| stress.is_finite()).then_some(end)
}

fn class(run: &StrategyRun) -> String {
    if run.steps.iter().any(|step| step.stress.iter().any(|stress| !stress.is_finite())) {
        return "not finite".to_owned();
    }
    match &run.run.outcome {
        Outcome::Refused(error) => format!("refused: {error}"),
        Outcome::DidNotConverge { reason } => format!("did not converge: {reason}"),
        _ => run.end().to_owned(),
    }
}
