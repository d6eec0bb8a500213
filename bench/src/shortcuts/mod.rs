//! Random scenes with every shortcut, and with each of them switched off: those that are exact change no digit of the history, and the
//! others no more than what the accuracy of the scene allows, or the errors that both runs estimate where cells snap.

mod draw;
mod levers;

use crate::effort::Effort;
use crate::program::{EndedRun, run_to_its_end};
use crate::report::Report;
use crate::stability::check::bound;
use crate::stability::packings::{Slot, slots};
use crate::table::{Cell, Table};
use anyhow::Context;
use draw::Scene;
use levers::{Effect, LEVERS, Lever};
use macro_solver::output::write_atomically;
use rve_server::definition::Packing;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Scenes unless the command line says how many, thorough and quick.
const SCENES: [u64; 2] = [40, 2];

/// Seed unless the command line has one.
const SEED: u64 = 1;

/// Runs the scenes that the command line asks for.
///
/// # Errors
/// A scene that cannot be made or run, a shortcut that changes a history although it is exact (the tables are written before), or a report
/// that cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let options = &effort.stability;
    let seed = options.seed.unwrap_or(SEED);
    let count = options.cases.unwrap_or_else(|| effort.choose(SCENES[0], SCENES[1]));
    let numbers = options.scene.map_or(0..count, |number| number..number + 1);
    let slots = slots(seed)?;
    report.note(&format!("seed {seed}, scenes {} to {}", numbers.start, numbers.end.saturating_sub(1)))?;
    let mut table = Table::new(COLUMNS);
    let mut sums: BTreeMap<&str, Sum> = BTreeMap::new();
    let mut changed = Vec::new();
    for number in numbers {
        let scene = Scene::sampled(seed, number, &slots)?;
        let folder = tempfile::tempdir().context("a folder for the runs")?;
        write(&scene, &slots[scene.slot], folder.path()).with_context(|| format!("scene {number}"))?;
        let findings = findings(&scene, folder.path()).with_context(|| format!("scene {number} of seed {seed}"))?;
        for finding in &findings {
            sums.entry(finding.lever.name).or_default().add(finding);
            table.row(row(number, &scene, &slots[scene.slot], finding));
        }
        let wrong: Vec<&str> = findings.iter().filter(|one| one.is_wrong()).map(|one| one.lever.name).collect();
        if !wrong.is_empty() {
            write(&scene, &slots[scene.slot], &report.folder().join(format!("scene-{number}")))?;
            changed.push(format!("scene {number} ({})", wrong.join(", ")));
        }
        report.raw("scenes", &table)?;
    }
    let mut summary = Table::new([
        "shortcut",
        "effect",
        "scenes",
        "taken_in",
        "same_history",
        "median_difference",
        "largest_difference",
        "largest_over_allowed",
    ]);
    for lever in &LEVERS {
        if let Some(sum) = sums.get(lever.name) {
            summary.row(sum.row(lever));
        }
    }
    report.table("shortcuts", "without each shortcut; differences of stress over the mean pressure", &summary)?;
    anyhow::ensure!(
        changed.is_empty(),
        "a shortcut changes the history by more than it may: {}; the scenes are kept in the folder of the report, and `--seed {seed} --scene K` \
         runs one again",
        changed.join("; ")
    );
    Ok(())
}

const COLUMNS: [&str; 15] = [
    "scene",
    "loading",
    "packing",
    "element",
    "elements",
    "strategy",
    "rve",
    "steps",
    "exit_code",
    "shortcut",
    "taken",
    "exit_code_without",
    "same_history",
    "difference_over_pressure",
    "difference_over_allowed",
];

/// What one shortcut has shown in one scene.
struct Finding {
    lever: &'static Lever,
    steps: usize,
    /// Exit codes with it and without.
    exits: [i32; 2],
    /// How often it was taken.
    taken: u64,
    is_same: bool,
    /// Differences of the mean stresses.
    difference: Difference,
}

impl Finding {
    fn is_wrong(&self) -> bool {
        match self.lever.effect {
            Effect::Exact => !self.is_same || self.exits[0] != self.exits[1],
            Effect::WithinTolerance => self.difference.over_allowed > 1.0,
        }
    }
}

/// Runs a scene with and without each shortcut that has a meaning for it.
fn findings(scene: &Scene, folder: &Path) -> anyhow::Result<Vec<Finding>> {
    let file = folder.join("scene.toml");
    let run =
        |name: &str, settings: &[&str]| run_to_its_end(&file, settings, &folder.join(name)).context(name.to_owned());
    let base = run("default", &[])?;
    let mut findings = Vec::new();
    for lever in LEVERS.iter().filter(|lever| (lever.serves)(scene)) {
        let other = run(lever.name, lever.settings)?;
        let with = if lever.is_taken_without { &other } else { &base };
        findings.push(Finding {
            lever,
            steps: base.steps(),
            exits: [base.code, other.code],
            taken: lever.keys.iter().map(|key| with.summary["economy"][key]["count"].as_u64().unwrap_or(0)).sum(),
            is_same: is_same(&base, &other),
            difference: difference(&base, &other, scene.components(), bound(&scene.options)),
        });
    }
    Ok(findings)
}

/// Beginnings of columns that count work, or that the estimate of the error adds.
const NO_RESULTS: [&str; 4] = ["evaluations", "estimated_error", "balance_error", "strain_per_step"];

fn is_result(column: &str) -> bool {
    !NO_RESULTS.iter().any(|begin| column.starts_with(begin))
}

/// Whether all results of two histories are equal in every digit.
fn is_same(one: &EndedRun, other: &EndedRun) -> bool {
    let results = |run: &EndedRun| -> Vec<(String, Vec<String>)> {
        run.columns
            .iter()
            .filter(|(name, _)| is_result(name))
            .map(|(name, rows)| (name.clone(), rows.clone()))
            .collect()
    };
    results(one) == results(other)
}

/// How far the mean stresses of two runs are apart behind step 0, in which packings that are not at rest under the law of the scene differ; NaN
/// where one run has other steps.
#[derive(Clone, Copy, Debug)]
struct Difference {
    /// Largest difference in any step over the mean pressure of the first run.
    largest: f64,
    /// Largest difference over what is allowed in its step: the bound, or the errors that both runs estimate if they are larger.
    over_allowed: f64,
}

fn difference(one: &EndedRun, other: &EndedRun, components: &[&str], bound: f64) -> Difference {
    let mut found = Difference { largest: 0.0, over_allowed: 0.0 };
    if one.steps() != other.steps() || one.steps() == 0 {
        return Difference { largest: f64::NAN, over_allowed: f64::NAN };
    }
    let normal = components.iter().filter(|name| name.as_bytes()[0] == name.as_bytes()[1]);
    let sums: Vec<f64> = normal.map(|name| values(one, name).iter().sum::<f64>()).collect();
    let pressure = -sums.iter().sum::<f64>() / (sums.len() * one.steps()) as f64;
    let errors = [one, other].map(|run| values(run, "estimated_error"));
    let pairs: Vec<[Vec<f64>; 2]> = components.iter().map(|name| [values(one, name), values(other, name)]).collect();
    for step in 1..one.steps() {
        let apart = pairs.iter().map(|[a, b]| (a[step] - b[step]).abs() / pressure).fold(0.0, f64::max);
        // Runs without the estimate have no such column; NaN counts as nothing known.
        let estimated: f64 =
            errors.iter().filter_map(|error| error.get(step)).filter(|error| error.is_finite()).sum();
        found.largest = found.largest.max(apart);
        found.over_allowed = found.over_allowed.max(apart / bound.max(estimated));
    }
    found
}

/// A column of numbers; NaN where an entry is none, empty where there is no such column.
fn values(run: &EndedRun, name: &str) -> Vec<f64> {
    let rows = run.columns.iter().find(|(column, _)| column == name).map_or(&[][..], |(_, rows)| rows);
    rows.iter().map(|row| row.parse().unwrap_or(f64::NAN)).collect()
}

/// Writes a scene and its packing.
fn write(scene: &Scene, slot: &Slot, folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let json = match slot.packing()? {
        Packing::Discs(packing) => packing.to_json(),
        Packing::Spheres(packing) => packing.to_json(),
    };
    write_atomically(&folder.join("packing.json"), json.as_bytes())?;
    write_atomically(&folder.join("scene.toml"), scene.text.as_bytes())?;
    Ok(())
}

fn row(number: u64, scene: &Scene, slot: &Slot, finding: &Finding) -> [Cell; 15] {
    let exit = |code: i32| Cell::from(code.to_string());
    [
        number.into(),
        scene.loading.name().into(),
        slot.name.as_str().into(),
        scene.element.into(),
        scene.elements.as_str().into(),
        if scene.strategy.is_empty() { "default" } else { scene.strategy }.into(),
        scene.accuracy().into(),
        finding.steps.into(),
        exit(finding.exits[0]),
        finding.lever.name.into(),
        finding.taken.into(),
        exit(finding.exits[1]),
        if finding.is_same { "yes" } else { "no" }.into(),
        finding.difference.largest.into(),
        finding.difference.over_allowed.into(),
    ]
}

/// One shortcut over all scenes.
#[derive(Default)]
struct Sum {
    scenes: u64,
    taken_in: u64,
    same: u64,
    differences: Vec<f64>,
    over_allowed: f64,
}

impl Sum {
    fn add(&mut self, finding: &Finding) {
        self.scenes += 1;
        self.taken_in += u64::from(finding.taken > 0);
        self.same += u64::from(finding.is_same);
        let Difference { largest, over_allowed } = finding.difference;
        if largest.is_finite() {
            self.differences.push(largest);
            self.over_allowed = self.over_allowed.max(over_allowed);
        }
    }

    fn row(&self, lever: &Lever) -> [Cell; 8] {
        let mut sorted = self.differences.clone();
        sorted.sort_by(f64::total_cmp);
        let at = |place: usize| Cell::from(sorted.get(place).copied().unwrap_or(f64::NAN));
        [
            lever.name.into(),
            lever.effect.name().into(),
            self.scenes.into(),
            self.taken_in.into(),
            self.same.into(),
            at(sorted.len() / 2),
            at(sorted.len().saturating_sub(1)),
            self.over_allowed.into(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(columns: &[(&str, &[&str])]) -> EndedRun {
        let columns = columns
            .iter()
            .map(|(name, rows)| ((*name).to_owned(), rows.iter().map(|row| (*row).to_owned()).collect()));
        EndedRun { code: 0, summary: serde_json::Value::Null, columns: columns.collect() }
    }

    #[test]
    fn histories_are_compared_by_their_results_and_stresses_over_the_pressure() {
        let run = |evaluations: &[&str], xy: &[&str], error: &[&str]| {
            ended(&[
                ("evaluations", evaluations),
                ("xx", &["-1", "-2"]),
                ("yy", &["-3", "-2"]),
                ("xy", xy),
                ("estimated_error", error),
            ])
        };
        let one = run(&["4", "8"], &["0", "1"], &["0", "1e-3"]);
        assert!(is_same(&one, &run(&["5", "9"], &["0", "1"], &["0", "2e-3"])));
        let other = run(&["4", "8"], &["0", "1.1"], &["0", "1e-3"]);
        assert!(!is_same(&one, &other));
        let components = ["xx", "yy", "xy"];
        let found = difference(&one, &other, &components, 0.025);
        assert!((found.largest - 0.05).abs() < 1e-12 && (found.over_allowed - 2.0).abs() < 1e-9, "{found:?}");
        // Where the runs themselves do not know better, and in step 0.
        let snapped = run(&["4", "8"], &["0.5", "1.1"], &["0", "0.099"]);
        assert!(difference(&one, &snapped, &components, 0.025).over_allowed < 0.51);
        let short = ended(&[("evaluations", &["4"]), ("xx", &["-1"]), ("yy", &["-3"]), ("xy", &["0"])]);
        assert!(!is_same(&one, &short) && difference(&one, &short, &components, 0.025).largest.is_nan());
    }
}
