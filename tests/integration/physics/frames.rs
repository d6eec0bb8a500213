//! Frames of boundary grains [Liu2018] behind finite elements, as `[rve] frame` of a scene chooses them.

use crate::harness::table::Table;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A run of a scene.
fn run_scene(scene: &str, folder: &Path, name: &str, settings: &[&str]) -> (Output, PathBuf) {
    let out = folder.join(name);
    let ran = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", scene, "--workers", "2", "--out"])
        .arg(&out)
        .args(settings)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    (ran, out)
}

/// A short run of one element of the small biaxial scene.
fn run(folder: &Path, name: &str, more: &[&str]) -> (Output, PathBuf) {
    let short = ["--set", "mesh.elements=[1, 1]", "--set", "loading.increments=2", "--set", "rve.accuracy=draft"];
    let settings = [&short[..], &["--set", "boundary.2.displacement.y=-1e-4"], more].concat();
    run_scene("scenes/biaxial-small.toml", folder, name, &settings)
}

fn history(folder: &Path, name: &str, more: &[&str]) -> String {
    let (ran, out) = run(folder, name, more);
    let said = String::from_utf8_lossy(&ran.stderr).into_owned() + &String::from_utf8_lossy(&ran.stdout);
    assert_eq!(ran.status.code(), Some(0), "{more:?}: {said}");
    fs::read_to_string(out.join("history.csv")).unwrap()
}

fn last_ratio(history: &str) -> f64 {
    Table::of(history).last("stress_ratio")
}

#[test]
fn a_scene_chooses_its_frame_and_the_engine_follows() {
    let folder = tempfile::tempdir().unwrap();
    let frame = |keys: &str| format!("rve.frame={keys}");
    let by_engine = history(folder.path(), "engine", &["--engine", "boundary-frame"]);
    let by_scene = history(folder.path(), "scene", &["--set", &frame("{}")]);
    assert_eq!(by_engine, by_scene, "a periodic frame with direct control is what the engine alone takes");
    let cell = last_ratio(&history(folder.path(), "cell", &[]));
    let shared = last_ratio(&history(folder.path(), "shared", &["--set", &frame("{ shared_sides = true }")]));
    assert!((shared / cell - 1.0).abs() < 2e-2, "with shared sides {shared}, a periodic cell {cell}");
    let linear = last_ratio(&history(folder.path(), "linear", &["--set", &frame("{ constraint = 'linear' }")]));
    let servo = frame("{ control = { servo = { gain = 1.0 } } }");
    let blocked = ["--set", &servo, "--set", "contact.rotations=inner_blocked"];
    let servo = last_ratio(&history(folder.path(), "servo", &["--set", &servo]));
    let blocked = last_ratio(&history(folder.path(), "blocked", &blocked));
    let periodic = last_ratio(&by_scene);
    // No operator of contacts knows of a boundary: tangents of frames are those of perturbations, and are counted.
    let summary = fs::read(folder.path().join("scene/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap();
    assert!(summary["fallbacks"]["tangents_by_difference"].as_u64().unwrap() > 0, "{summary}");
    assert!((servo / periodic - 1.0).abs() < 5e-2, "by servo {servo}, directly {periodic}");
    assert!(linear > periodic && blocked > servo, "{linear} > {periodic}, {blocked} > {servo}");
}

/// Cells are brought to their stress as periodic cells, and frames are cut from them.
#[test]
fn frames_of_prepared_cells_are_said_to_begin_out_of_balance() {
    let check = |settings: &[&str]| {
        let checked = Command::new(env!("CARGO_BIN_EXE_grainspan"))
            .args(["check", "scenes/geotechnics/ground.toml"])
            .args(settings.iter().flat_map(|setting| ["--set", setting]))
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        String::from_utf8(checked.stdout).unwrap() + &String::from_utf8(checked.stderr).unwrap()
    };
    let said = check(&["rve.frame={}"]);
    assert!(said.contains("rve.frame.shared_sides = true"), "{said}");
    for settings in [&["rve.frame={ shared_sides = true }"][..], &[]] {
        let said = check(settings);
        assert!(said.contains("Scene OK") && !said.contains("shared_sides"), "{said}");
    }
}

/// A boundary that follows the strain resists most, one under uniform traction least, and a periodic one lies between [Liu2018].
#[test]
fn the_constraints_of_frames_are_in_the_order_of_their_stiffness() {
    let folder = tempfile::tempdir().unwrap();
    let ratio = |constraint: &str| {
        let constraint_key = format!("rve.frame.constraint='{constraint}'");
        let settings = [
            "mesh.elements=[1, 1]",
            "stage.1.loading.increments=1",
            "stage.1.boundary.0.displacement.y=-2e-4",
            // As it is cut, a frame is far from rest under uniform traction; in coarser steps it falls apart there.
            "rve.strain_per_step=2e-6",
            &constraint_key,
        ];
        let settings = settings.map(|setting| ["--set", setting]).concat();
        let (ran, out) = run_scene("scenes/liu2018/frame-biaxial.toml", folder.path(), constraint, &settings);
        assert_eq!(ran.status.code(), Some(0), "{constraint}: {}", String::from_utf8_lossy(&ran.stderr));
        last_ratio(&fs::read_to_string(out.join("history.csv")).unwrap())
    };
    let [traction, periodic, linear] = ["traction", "periodic", "linear"].map(ratio);
    assert!(1.0 < traction && traction < periodic && periodic < linear, "{traction} < {periodic} < {linear}");
}

/// Where contacts along the sides of a frame count whole on both of them, it is not at rest as it is cut. Its first tangents must not
/// hold the way to rest, or several elements find no equilibrium.
#[test]
fn frames_that_are_cut_out_of_balance_find_the_equilibrium_of_several_elements() {
    let folder = tempfile::tempdir().unwrap();
    let settings =
        ["mesh.elements=[1, 2]", "stage.1.loading.increments=1", "stage.1.boundary.0.displacement.y=-2e-5"];
    let settings = settings.map(|setting| ["--set", setting]).concat();
    let (ran, out) = run_scene("scenes/liu2018/frame-biaxial.toml", folder.path(), "frames", &settings);
    assert_eq!(ran.status.code(), Some(0), "{}", String::from_utf8_lossy(&ran.stderr));
    let history = fs::read_to_string(out.join("history.csv")).unwrap();
    let ratio = last_ratio(&history);
    assert!((1.0..1.4).contains(&ratio) && history.lines().count() == 4, "{history}");
}

#[test]
fn frames_and_inner_grains_are_refused_where_there_are_none() {
    let folder = tempfile::tempdir().unwrap();
    for (more, said) in [
        (&["--set", "rve.frame={}", "--set", "pool.engine=grains"][..], "no frames of boundary grains"),
        (&["--set", "contact.rotations=inner_blocked"], "inner_blocked"),
        (&["--set", "rve.frame={ control = { servo = { gain = 3.0 } } }"], "rve.frame.control.servo.gain"),
    ] {
        let (ran, out) = run(folder.path(), "refused", more);
        let error = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert_eq!(ran.status.code(), Some(2), "{more:?}: {error}");
        assert!(error.contains(said), "{more:?}: {error}");
        assert!(!out.exists());
    }
}
