//! Random scenes with every shortcut, and with each of them switched off: those that are exact change no digit of the history, and the
//! others no more than what the accuracy of the scene allows, or the errors that both runs estimate where cells snap.

mod compare;
mod draw;
mod levers;

use crate::effort::Effort;
use crate::program::{Refusal, run_to_its_end};
use crate::report::Report;
use crate::stability::check::bound;
use crate::stability::packings::{Slot, slots};
use crate::table::{Cell, Table};
use anyhow::Context;
use compare::{Difference, difference, is_same};
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
/// A scene that cannot be made or run, a shortcut that changes a history by more than it may (the tables are written before), or a report that
/// cannot be written.
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
        let findings = match findings(&scene, folder.path()) {
            Ok(findings) => findings,
            Err(error) => {
                keep(report, number, &scene, &slots[scene.slot])?;
                return Err(error.context(format!("scene {number} of seed {seed}")));
            }
        };
        let findings = match findings {
            Ok(findings) => findings,
            Err(refusal) => {
                report.note(&format!("scene {number}: {refusal}"))?;
                continue;
            }
        };
        for finding in &findings {
            sums.entry(finding.lever.name).or_default().add(finding);
            table.row(row(number, &scene, &slots[scene.slot], finding));
        }
        let wrong: Vec<&str> = findings.iter().filter(|one| one.is_wrong()).map(|one| one.lever.name).collect();
        if !wrong.is_empty() {
            keep(report, number, &scene, &slots[scene.slot])?;
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
        "ended_early",
        "another_end",
        "not_compared",
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
    /// Differences of the mean stresses; `None` without a common step, or where the shortcut states no bound.
    difference: Option<Difference>,
}

impl Finding {
    fn is_wrong(&self) -> bool {
        match self.lever.effect {
            Effect::Exact => !self.is_same || self.exits[0] != self.exits[1],
            Effect::WithinTolerance => self.difference.is_some_and(|found| found.over_allowed > 1.0),
        }
    }
}

/// Runs a scene with and without each shortcut that has a meaning for it; or why it is refused.
fn findings(scene: &Scene, folder: &Path) -> anyhow::Result<Result<Vec<Finding>, Refusal>> {
    let file = folder.join("scene.toml");
    let run =
        |name: &str, settings: &[&str]| run_to_its_end(&file, settings, &folder.join(name)).context(name.to_owned());
    let base = match run("default", &[]) {
        Ok(base) => base,
        Err(error) => return error.downcast::<Refusal>().map(Err),
    };
    let is_at_rest = base.summary["fallbacks"]["packings_far_from_rest"].as_u64() == Some(0);
    let mut findings = Vec::new();
    for lever in LEVERS.iter().filter(|lever| (lever.serves)(scene)) {
        let other = run(lever.name, lever.settings)?;
        let with = if lever.is_taken_without { &other } else { &base };
        let is_bounded = is_at_rest || !lever.needs_rest;
        findings.push(Finding {
            lever,
            steps: base.steps(),
            exits: [base.code, other.code],
            taken: lever.keys.iter().map(|key| with.summary["economy"][key]["count"].as_u64().unwrap_or(0)).sum(),
            is_same: is_same(&base, &other),
            difference: is_bounded
                .then(|| difference(&base, &other, scene.components(), bound(&scene.options)))
                .flatten(),
        });
    }
    Ok(Ok(findings))
}

/// Writes a scene and its packing to the folder of the report.
fn keep(report: &Report, number: u64, scene: &Scene, slot: &Slot) -> anyhow::Result<()> {
    write(scene, slot, &report.folder().join(format!("scene-{number}")))
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
        finding.difference.map_or(f64::NAN, |found| found.largest).into(),
        finding.difference.map_or(f64::NAN, |found| found.over_allowed).into(),
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
    /// Scenes that do not converge with the shortcut.
    ended_early: u64,
    /// Scenes of which one run converges and the other does not.
    another_end: u64,
    /// Scenes whose runs have no step in common behind step 0, or for which the shortcut states no bound: their packing is not at rest.
    not_compared: u64,
}

impl Sum {
    fn add(&mut self, finding: &Finding) {
        self.scenes += 1;
        self.taken_in += u64::from(finding.taken > 0);
        self.same += u64::from(finding.is_same);
        self.ended_early += u64::from(finding.exits[0] != 0);
        self.another_end += u64::from(finding.exits[0] != finding.exits[1]);
        match finding.difference {
            Some(Difference { largest, over_allowed }) => {
                self.differences.push(largest);
                self.over_allowed = self.over_allowed.max(over_allowed);
            }
            None => self.not_compared += 1,
        }
    }

    fn row(&self, lever: &Lever) -> [Cell; 11] {
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
            self.ended_early.into(),
            self.another_end.into(),
            self.not_compared.into(),
        ]
    }
}
