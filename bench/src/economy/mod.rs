//! What each shortcut of a run saves, alone and together, and what error it brings.

mod scenes;

use crate::effort::Effort;
use crate::program::{ProgramRun, run_scene};
use crate::repeat::median;
use crate::report::Report;
use crate::table::Table;
use anyhow::Context;
use scenes::{EconomyScene, SCENES};
use std::fs;
use std::path::Path;

/// A way to run every scene: its name, and what `--set` gets.
struct Lever {
    name: &'static str,
    settings: &'static [&'static str],
    /// Whether a run that differs from the default in this alone has to write the same history.
    is_exact: bool,
}

const fn exact(name: &'static str, settings: &'static [&'static str]) -> Lever {
    Lever { name, settings, is_exact: true }
}

const fn other(name: &'static str, settings: &'static [&'static str]) -> Lever {
    Lever { name, settings, is_exact: false }
}

/// The default first; every other one is compared with it.
const LEVERS: [Lever; 10] = [
    exact("default", &["error_estimate.enabled=false"]),
    exact("without unchanged_targets", &["error_estimate.enabled=false", "economy.unchanged_targets=false"]),
    exact("without duplicate_trials", &["error_estimate.enabled=false", "economy.duplicate_trials=false"]),
    other("without zero_increments", &["error_estimate.enabled=false", "economy.zero_increments=false"]),
    exact("without lanes", &["error_estimate.enabled=false", "pool.lanes=false"]),
    other("tangents at every iterate", &["error_estimate.enabled=false", "solver.tangent_update=\"always\""]),
    exact("with the estimate of the error", &[]),
    other("event-driven", &["error_estimate.enabled=false", "rve.solver=\"event_driven\""]),
    other("rve.error = 5e-3", &["rve.accuracy=\"default\"", "rve.error=5e-3"]),
    other(
        "without the shortcuts",
        &[
            "error_estimate.enabled=false",
            "economy.unchanged_targets=false",
            "economy.duplicate_trials=false",
            "economy.zero_increments=false",
            "pool.lanes=false",
        ],
    ),
];

/// What errors are measured against.
const REFERENCE: [&str; 3] = ["rve.accuracy=\"tight\"", "rve.tolerance=1e-5", "error_estimate.enabled=false"];

/// What `--only` may name.
pub(super) fn parts(_: &Effort) -> Vec<String> {
    SCENES.map(|scene| scene.name.to_owned()).to_vec()
}

/// Runs every scene with every lever.
///
/// # Errors
/// A run fails, a shortcut that is exact changes the history (the table is written before), or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let names = SCENES.map(|scene| scene.name);
    let mut table = Table::new([
        "scene",
        "levers",
        "wall_s",
        "processor_s",
        "processor_ratio",
        "grains_s",
        "evaluations_per_point",
        "force_evaluations_per_evaluation",
        "saved_share",
        "rms_error",
        "same_bits",
    ]);
    let mut changed = Vec::new();
    for scene in SCENES.iter().filter(|scene| effort.includes(scene.name, &names)) {
        let folder = tempfile::tempdir().context("a folder for the runs")?;
        let measured = measure(scene, effort, folder.path()).with_context(|| format!("scene {}", scene.name))?;
        let base = median(&measured.runs[0].iter().map(|run| run.cost.processor).collect::<Vec<_>>());
        let default = measured.runs[0][0].column(scene.column)?.to_vec();
        for (lever, runs) in LEVERS.iter().zip(&measured.runs) {
            // A lever without a meaning for the procedure of this scene.
            let Some(first) = runs.first() else { continue };
            let of = |value: fn(&ProgramRun) -> f64| median(&runs.iter().map(value).collect::<Vec<_>>());
            let curve = first.column(scene.column)?;
            let is_same = same(curve, &default);
            if lever.is_exact && !is_same {
                changed.push(format!("{}, {}", scene.name, lever.name));
            }
            table.row([
                scene.name.into(),
                lever.name.into(),
                of(|run| run.cost.wall).into(),
                of(|run| run.cost.processor).into(),
                (of(|run| run.cost.processor) / base).into(),
                of(|run| number(run, &["time", "rve_s"])).into(),
                number(first, &["evaluations_per_gauss_point"]).into(),
                force_evaluations(first).into(),
                saved(first).into(),
                error(curve, &measured.reference).into(),
                if is_same { "yes" } else { "no" }.into(),
            ]);
        }
        report.raw("economy", &table)?;
        report.note(&format!("{}: done", scene.name))?;
    }
    let title = "ratios: processor time over that of the default; errors: root mean square of the probe over its largest value";
    report.table("economy", title, &table)?;
    anyhow::ensure!(
        changed.is_empty(),
        "the history is another one, where it has to be the same: {}",
        changed.join("; ")
    );
    Ok(())
}

/// All runs of a scene: of each lever those of all rounds.
struct Measured {
    runs: Vec<Vec<ProgramRun>>,
    reference: Vec<f64>,
}

fn measure(scene: &EconomyScene, effort: &Effort, folder: &Path) -> anyhow::Result<Measured> {
    let file = folder.join("scene.toml");
    fs::write(&file, scene.text())?;
    fs::write(folder.join("packing.json"), scene.packing)?;
    let settings = |more: &[&str]| -> Vec<String> {
        let quick: &[&str] = if effort.quick { scene.quick } else { &[] };
        scene.settings.iter().chain(quick).chain(more).map(|setting| (*setting).to_owned()).collect()
    };
    let reference = run_scene(&file, &settings(if effort.quick { &[] } else { &REFERENCE }), &folder.join("tight"))?;
    let reference = reference.column(scene.column)?.to_vec();
    let mut runs: Vec<Vec<ProgramRun>> = LEVERS.iter().map(|_| Vec::new()).collect();
    for round in 0..if effort.full { 3 } else { 1 } {
        let served =
            |lever: &Lever| !scene.is_dynamic() || !lever.settings.iter().any(|key| key.starts_with("solver."));
        for (place, lever) in LEVERS.iter().enumerate().filter(|(_, lever)| served(lever)) {
            let out = folder.join(format!("lever-{place}-{round}"));
            runs[place].push(run_scene(&file, &settings(lever.settings), &out).context(lever.name)?);
        }
    }
    Ok(Measured { runs, reference })
}

/// A number of the summary; NaN if it is not there.
fn number(run: &ProgramRun, path: &[&str]) -> f64 {
    path.iter().fold(&run.summary, |value, key| &value[key]).as_f64().unwrap_or(f64::NAN)
}

/// Force evaluations that the shortcuts have saved.
fn saved_evaluations(run: &ProgramRun) -> f64 {
    let shortcuts = run.summary["economy"].as_object().into_iter().flatten();
    shortcuts.filter_map(|(_, shortcut)| shortcut["force_evaluations_saved"].as_f64()).sum()
}

fn force_evaluations(run: &ProgramRun) -> f64 {
    number(run, &["force_evaluations"]) / number(run, &["rve_evaluations"])
}

/// Their share of what the run would have taken without.
fn saved(run: &ProgramRun) -> f64 {
    let saved = saved_evaluations(run);
    saved / (saved + number(run, &["force_evaluations"]))
}

/// Whether two curves are equal in every bit.
fn same(one: &[f64], other: &[f64]) -> bool {
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Root mean square of the difference over the largest value of the reference.
fn error(curve: &[f64], reference: &[f64]) -> f64 {
    let largest = reference.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if curve.len() != reference.len() || curve.is_empty() {
        return f64::NAN;
    }
    let square: f64 = curve.iter().zip(reference).map(|(a, b)| (a - b).powi(2)).sum();
    (square / curve.len() as f64).sqrt() / largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative_to_the_largest_value_and_equal_curves_are_the_same() {
        assert!((error(&[1.0, 2.2], &[1.0, 2.0]) - 0.1 / 2f64.sqrt()).abs() < 1e-12);
        assert!(error(&[1.0], &[1.0, 2.0]).is_nan());
        assert!(same(&[1.0, -0.0], &[1.0, -0.0]) && !same(&[0.0], &[-0.0]));
    }

    #[test]
    fn every_scene_names_its_packing_and_its_probe() {
        for scene in &SCENES {
            let text = scene.text();
            assert!(text.contains("\npacking = \"packing.json\"") && !text.contains("packings/"), "{}", scene.name);
            assert!(text.contains(&format!("name = \"{}\"", scene.column)), "{}", scene.name);
        }
    }
}
