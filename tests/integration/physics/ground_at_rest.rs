//! `[initial_stress] prepare`: ground starts in balance with its weight, whatever the pressure of its packing.

use crate::harness::table::Table;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn program(words: &[&str], sets: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grainspan"));
    command.args(words).current_dir(env!("CARGO_MANIFEST_DIR"));
    sets.iter().for_each(|set| {
        command.args(["--set", set]);
    });
    command.output().unwrap()
}

const SCENE: &str = "scenes/geotechnics/ground.toml";

/// Force on the wall before it moves, N/m, and the summary.
fn start(folder: &Path, sets: &[&str]) -> (f64, serde_json::Value) {
    let out = folder.to_str().unwrap();
    let ran = program(&["run", SCENE, "--size", "small", "--workers", "2", "--out", out], sets);
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let force = Table::read(&folder.join("history.csv")).column("wall_force")[0];
    (force, serde_json::from_slice(&fs::read(folder.join("summary.json")).unwrap()).unwrap())
}

/// The force at rest is `K0 (q H + g H^2 / 2)` for another coefficient, surcharge and element too, and for pressures that are joined.
#[test]
fn the_wall_carries_the_earth_pressure_at_rest() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let (force, summary) = start(&out, &["loading.increments=1"]);
    assert!((force / 1e5 - 1.0).abs() < 1e-5, "{force}");
    let number = |name: &str| summary[name].as_f64().unwrap();
    assert!(number("initial_imbalance") < 1e-5 && number("initial_deviation") < 1e-5, "{summary}");
    let other = [
        "loading.increments=1",
        "mesh.element=t6",
        "initial_stress.geostatic.rest_coefficient=0.7",
        "initial_stress.geostatic.surcharge=3e4",
        "pressure.0.value=3e4",
    ];
    let (force, summary) = start(&out, &other);
    assert!((force / (0.7 * (3e4 * 4.0 + 2e4 * 8.0)) - 1.0).abs() < 1e-5, "{force}");
    assert!(summary["initial_imbalance"].as_f64().unwrap() < 1e-5);
    let joined =
        ["loading.increments=1", "initial_stress.prepare_spacing=0.3", "initial_stress.largest_deviation=0.3"];
    let (force, summary) = start(&out, &joined);
    let imbalance = summary["initial_imbalance"].as_f64().unwrap();
    assert!(imbalance > 1e-4 && imbalance < 0.3, "{imbalance}");
    assert!((force / 1e5 - 1.0).abs() < 0.02, "{force}");
}

const SLOPE: &str = "scenes/geotechnics/slope-at-rest.toml";

/// A slope of twenty cells with shear stresses: in balance with its weight before anything moves, and the same bytes for two workers and one.
#[test]
fn a_slope_starts_in_balance_with_its_weight() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, workers: &str| {
        let out = folder.path().join(name);
        let words = ["run", SLOPE, "--size", "small", "--workers", workers, "--out", out.to_str().unwrap()];
        let sets = [
            "mesh.elements=[2, 1, 1, 1]",
            "stage.0.friction.0.factor=0.9",
            "stage.0.loading.increments=1",
            "initial_stress.largest_deviation=1e-5",
        ];
        let ran = program(&words, &sets);
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        let summary = fs::read(out.join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap();
        (fs::read(out.join("history.csv")).unwrap(), summary)
    };
    let (history, summary) = run("two", "2");
    let imbalance = summary["initial_imbalance"].as_f64().unwrap();
    // Measured 1e-7.
    assert!(imbalance < 1e-5, "{imbalance}");
    assert_eq!(summary["prepared"]["cells"], 20, "{summary}");
    assert_eq!(history, run("one", "1").0);
}

/// What friction does not bear, and keys that contradict each other, are refused when the scene is read.
#[test]
fn slopes_without_equilibrium_are_refused() {
    for (set, part) in [
        ("initial_stress.equilibrium.friction_angle=5.0", "no stress in equilibrium with the loads"),
        ("initial_stress.equilibrium.friction_angle=95.0", "below 90"),
        ("initial_stress.prepare_spacing=0.1", "a cell, of its own"),
        ("initial_stress.uniform={ xx = -1e5, yy = -1e5 }", "another stress at the start"),
    ] {
        let refused = program(&["check", SLOPE, "--size", "small"], &[set]);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{set}: {said}");
        assert!(said.contains(part) && said.contains("hint"), "{set}: {said}");
    }
}

/// Ground without a surcharge has points near a pressure of zero; what they cannot carry is refused with its place.
#[test]
fn stresses_that_grains_cannot_carry_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let words = ["run", SCENE, "--size", "small", "--out", out.to_str().unwrap()];
    let ran = program(&words, &["initial_stress.geostatic.rest_coefficient=0.1"]);
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert_eq!(ran.status.code(), Some(2), "{said}");
    for part in ["ground.toml", "prepare = true", "Gauss point 0", "rest_coefficient"] {
        assert!(said.contains(part), "'{part}' is missing in: {said}");
    }
    let none = program(&["check", SCENE], &["initial_stress={ prepare = true }"]);
    assert!(String::from_utf8_lossy(&none.stderr).contains("no stress to bring the cells to"));
    // A body force that the stress does not carry is noticed before anything is prepared.
    let light = program(&["check", SCENE, "--size", "small"], &["body_force.0.value.y=-1e4"]);
    let said = String::from_utf8_lossy(&light.stdout).into_owned();
    assert!(said.contains("not in balance with the initial loads") && said.contains("8 cells"), "{said}");
}
