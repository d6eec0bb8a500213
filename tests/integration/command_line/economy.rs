//! Shortcuts of `[economy]`: what they may not change, and how they are accounted for.

use crate::harness::short_scenes::{SHORT_SCENES, ShortScene};
use crate::harness::table::Table;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs a short scene to its end; its history and the shortcuts of its summary.
fn run(scene: &ShortScene, out: &Path, more: &[&str]) -> (String, serde_json::Value) {
    let file = format!("scenes/{}.toml", scene.file);
    let output = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", &file, "--workers", "1", "--quiet", "--out"])
        .arg(out)
        .args(scene.set.iter().chain(more).flat_map(|setting| ["--set", setting]))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}: {}", scene.name, String::from_utf8_lossy(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    (fs::read_to_string(out.join("history.csv")).unwrap(), summary["economy"].clone())
}

/// Every procedure, link and formulation: the exact shortcuts change no byte, and one that is switched off is not taken.
#[test]
fn exact_shortcuts_change_no_byte_and_can_be_switched_off() {
    let place = tempfile::tempdir().unwrap();
    let off = ["economy.unchanged_targets=false", "economy.duplicate_trials=false"];
    let taken = std::sync::Mutex::new([0; 2]);
    std::thread::scope(|scope| {
        for scenes in SHORT_SCENES.chunks(SHORT_SCENES.len().div_ceil(2)) {
            let (place, taken) = (place.path(), &taken);
            scope.spawn(move || {
                for scene in scenes {
                    let (with, saved) = run(scene, &place.join(format!("{}-on", scene.name)), &[]);
                    let (without, spent) = run(scene, &place.join(format!("{}-off", scene.name)), &off);
                    // Shares of evaluations count what was evaluated: all other columns are results.
                    assert!(with == without || counted_only(&with, &without), "{}: the histories differ", scene.name);
                    for (number, key) in ["unchanged_targets", "duplicate_trials"].into_iter().enumerate() {
                        assert_eq!(
                            (spent[key]["enabled"].as_bool(), spent[key]["count"].as_u64()),
                            (Some(false), Some(0)),
                            "{}: {key}",
                            scene.name
                        );
                        let count = saved[key]["count"].as_u64().unwrap();
                        let evaluations = saved[key]["force_evaluations_saved"].as_u64().unwrap();
                        assert!(evaluations >= count, "{}: {key}: {saved}", scene.name);
                        taken.lock().unwrap()[number] += count;
                    }
                }
            });
        }
    });
    let taken = taken.into_inner().unwrap();
    // Targets that repeat need a part of the body that is prescribed throughout (macro-solver/src/solve/tests/stepping.rs).
    assert!(taken[1] > 0, "shared replies occur in some scene: {taken:?}");
}

/// Columns that count work and are no result.
const COUNTS: [&str; 3] = ["evaluations", "force_evaluations", "rve_evaluations"];

/// Whether two histories differ in counts of work alone.
fn counted_only(one: &str, other: &str) -> bool {
    let (one, other) = (Table::of(one), Table::of(other));
    let is_count = |name: &str| COUNTS.iter().any(|count| name.starts_with(count));
    let results = || one.names().iter().filter(|name| !is_count(name));
    one.names() == other.names() && results().all(|name| one.texts(name) == other.texts(name))
}

/// An increment of exactly zero, relaxed all the same, changes the results by less than the tolerance of the grains.
#[test]
fn zero_increments_are_answered_at_once_unless_they_are_to_be_relaxed() {
    let place = tempfile::tempdir().unwrap();
    let scene = &SHORT_SCENES[0];
    let (with, saved) = run(scene, &place.path().join("on"), &[]);
    let (without, spent) = run(scene, &place.path().join("off"), &["economy.zero_increments=false"]);
    let count = saved["zero_increments"]["count"].as_u64().unwrap();
    assert!(count > 0 && saved["zero_increments"]["force_evaluations_saved"] == 14 * count, "{saved}");
    assert_eq!(
        (spent["zero_increments"]["count"].as_u64(), spent["zero_increments"]["enabled"].as_bool()),
        (Some(0), Some(false))
    );
    assert!(saved["zero_increments"]["error"].as_f64().unwrap() > 0.0);
    let ratios = |history: &str| Table::of(history).column("stress_ratio");
    // Draft accuracy: 1e-2 of the mean contact force.
    for (one, other) in ratios(&with).iter().zip(&ratios(&without)) {
        assert!((one - other).abs() < 1e-2 * other, "{one} {other}");
    }
}

/// Every means by which a run saves work is in the summary, no part is larger than its whole, and what adds up does.
#[test]
fn every_means_is_accounted_for_and_the_numbers_add_up() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("run");
    let output = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", "scenes/biaxial-small.toml", "--workers", "1", "--set", "loading.increments=3", "--out"])
        .arg(&out)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the binary starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    let economy = summary["economy"].as_object().unwrap();
    let names: Vec<&str> = economy.keys().map(String::as_str).collect();
    let expected = [
        "duplicate_trials",
        "error_estimate",
        "event_driven",
        "lanes",
        "stagnated_steps",
        "tangents_not_requested",
        "unchanged_targets",
        "zero_increments",
    ];
    assert_eq!(names, expected);
    let count = |name: &str, field: &str| economy[name][field].as_u64().unwrap();
    for name in expected {
        assert!(count(name, "count") <= count(name, "of"), "{name}: {}", economy[name]);
        assert!(economy[name]["enabled"].as_bool().unwrap() || count(name, "count") == 0, "{name}");
    }
    let of = |key: &str| summary[key].as_u64().unwrap();
    let (evaluations, tangents) = (of("rve_evaluations"), of("tangents"));
    assert_eq!(count("tangents_not_requested", "count") + tangents, evaluations);
    assert_eq!(count("unchanged_targets", "of"), evaluations + count("unchanged_targets", "count"));
    // What a worker solved: all that was evaluated, points and replicas, but shared replies and increments of zero.
    let asked = evaluations + count("error_estimate", "count");
    let without_zero = count("lanes", "of") + count("duplicate_trials", "count");
    assert!(without_zero <= asked && without_zero + count("zero_increments", "count") >= asked, "{summary}");
    // One worker, 32 points of one RVE: most come to it together.
    assert!(count("lanes", "count") > count("lanes", "of") / 2, "{}", economy["lanes"]);
    assert!(economy["lanes"]["trials_per_message"].as_f64().unwrap() >= 4.0, "{}", economy["lanes"]);
    assert_eq!(count("error_estimate", "force_evaluations_spent") > 0, count("error_estimate", "count") > 0);
    assert!(said.contains("  side by side     ") && said.contains("  no tangent       "), "{said}");
}
