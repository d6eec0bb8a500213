//! Whole runs on engines outside this program.

use super::{foreign, native};
use crate::harness::Site;
use crate::harness::table::Table;
use std::process::Command;

/// One element, two small steps: seconds with an engine in pure Python.
const SMALL: [&str; 8] = [
    "--set",
    "mesh.elements=[1,1]",
    "--set",
    "loading.increments=2",
    "--set",
    "boundary.2.displacement.y=-1e-4",
    "--workers",
    "1",
];

fn program(site: &Site, arguments: &[&str]) -> Command {
    let catalogue = site.path("engines.toml");
    std::fs::write(&catalogue, foreign::catalogue()).unwrap();
    let mut command = site.program(arguments);
    command.env("GRAINSPAN_ENGINES", catalogue);
    command
}

/// Runs the small scene into the folder `name`.
fn run(site: &Site, name: &str, extra: &[&str]) -> serde_json::Value {
    let out = site.path(name);
    let mut arguments = vec!["run", "scenes/biaxial-small.toml", "--quiet", "--out", out.to_str().unwrap()];
    arguments.extend(SMALL.iter().chain(extra));
    let ended = program(site, &arguments).output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap()
}

/// The last number of a column of a history.
fn last(site: &Site, name: &str, column: &str) -> f64 {
    Table::of(&site.history(name)).last(column)
}

fn agrees_with_the_built_in_engine(engine: &str, tolerance: f64) {
    if !foreign::is_there(engine) {
        return;
    }
    let site = Site::new();
    run(&site, "own", &[]);
    let summary = run(&site, "other", &["--engine", engine]);
    assert!(summary["fallbacks"]["tangents_by_difference"].as_u64().unwrap() > 0, "{summary}");
    assert!(summary["versions"]["engines"].as_str().unwrap().starts_with(engine));
    let (own, other) = (last(&site, "own", "stress_ratio"), last(&site, "other", "stress_ratio"));
    eprintln!("{engine}: stress ratio {other:.5}, built-in {own:.5}");
    assert!((other / own - 1.0).abs() < tolerance, "{other} {own}");
}

#[test]
fn reference_engine_runs_the_small_scene() {
    agrees_with_the_built_in_engine("reference", 5e-3);
}

#[test]
fn yade_runs_the_small_scene() {
    agrees_with_the_built_in_engine("yade", 5e-3);
}

#[test]
fn lammps_runs_the_small_scene() {
    agrees_with_the_built_in_engine("lammps", 5e-3);
}

/// States by snapshot, states by replay, workers that are replaced every few jobs: the same bytes.
#[test]
fn how_states_travel_and_how_often_workers_change_leaves_no_trace() {
    if !foreign::is_there("reference") {
        return;
    }
    let site = Site::new();
    run(&site, "plain", &["--engine", "reference"]);
    let replayed = run(&site, "replayed", &["--engine", "reference-replay"]);
    let recycled = run(&site, "recycled", &["--engine", "reference-replay", "--set", "pool.recycle_jobs=2"]);
    assert!(recycled["fallbacks"]["workers_left"].as_u64().unwrap() > 1, "{recycled}");
    assert_eq!(recycled["worker_restarts"].as_u64(), Some(0), "{recycled}");
    // Every fresh worker rebuilds states from paths, and the summary says so.
    assert!(recycled["fallbacks"]["workers_recycled"].as_u64().unwrap() > 1, "{recycled}");
    let trials = |summary: &serde_json::Value| summary["fallbacks"]["replayed_trials"].as_u64().unwrap();
    assert!(trials(&recycled) > trials(&replayed), "{recycled}");
    assert_eq!(site.history("plain"), site.history("replayed"));
    assert_eq!(site.history("plain"), site.history("recycled"));
}

/// Some points by another engine, as the scene says: close to either engine alone, and reproducible.
#[test]
fn engines_share_the_points_of_a_run_as_the_scene_says() {
    if !foreign::is_there("reference") {
        return;
    }
    let site = Site::new();
    let share = ["--set", "pool.points.reference=[1,3]"];
    run(&site, "own", &[]);
    let summary = run(&site, "mixed", &share);
    let engines = summary["versions"]["engines"].as_str().unwrap();
    assert!(engines.contains("(2 points), reference 1 (2 points)"), "{engines}");
    run(&site, "again", &share);
    assert_eq!(site.history("mixed"), site.history("again"));
    assert_ne!(site.history("mixed"), site.history("own"));
    let (own, mixed) = (last(&site, "own", "stress_ratio"), last(&site, "mixed", "stress_ratio"));
    assert!((mixed / own - 1.0).abs() < 5e-3, "{mixed} {own}");
}

/// An engine in C that refuses large steps and says so has its load step cut; the run needs no more of it.
#[test]
fn a_step_that_an_engine_in_c_finds_too_large_is_cut() {
    let Some(engine) = native::with_largest_strain("3.5e-4") else { return };
    let site = Site::new();
    let out = site.path("limited");
    let arguments = ["run", "scenes/biaxial-small.toml", "--engine", "limited", "--out", out.to_str().unwrap()];
    let mut command = site.program(&[&arguments[..], &SMALL].concat());
    let catalogue = site.path("limited.toml");
    std::fs::write(&catalogue, format!("[limited]\ncommand = [{engine:?}]\n")).unwrap();
    let ended = command.env("GRAINSPAN_ENGINES", catalogue).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{said}");
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    // Two steps of 5e-4: each is too large for one trial.
    assert!(summary["cutbacks"].as_u64().unwrap() > 0, "{summary}");
    // It reports no energies: nothing is open that smaller steps could close.
    assert!(!said.contains("energy balance") && summary["energy"]["residual"].is_null(), "{said}");
}

/// Runs the small scene on an engine that is a program of its own: exit code and what was said.
fn run_alone(engine: &std::path::Path) -> (i32, String) {
    let site = Site::new();
    let catalogue = site.path("alone.toml");
    std::fs::write(&catalogue, format!("[alone]\ncommand = [{engine:?}]\n")).unwrap();
    let out = site.path("alone");
    let arguments = ["run", "scenes/biaxial-small.toml", "--engine", "alone", "--out", out.to_str().unwrap()];
    let mut command = site.program(&[&arguments[..], &SMALL].concat());
    let ended = command.env("GRAINSPAN_ENGINES", catalogue).output().unwrap();
    (ended.status.code().unwrap(), String::from_utf8(ended.stderr).unwrap())
}

/// Every step began as packed, and the run ended well with a third of the stress.
#[test]
fn an_engine_whose_snapshots_hold_nothing_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let Some(engine) = native::without_states(folder.path()) else { return };
    let (code, said) = run_alone(&engine);
    assert!(code == 3 && said.contains("the snapshots of the engine do not hold its state"), "{code}: {said}");
}

#[test]
fn a_run_that_fails_names_the_engine_outside() {
    let Some(engine) = native::with_largest_strain("1e-9") else { return };
    let (code, said) = run_alone(&engine);
    assert!(code == 1 && said.contains("these cells are solved by alone"), "{code}: {said}");
}

/// The example in C has no grains, and so no fabric and no energies: what it does not deliver was written as zero, in tables and summary.
#[test]
fn what_an_engine_does_not_deliver_is_no_number() {
    if !native::is_there() {
        return;
    }
    let site = Site::new();
    let catalogue = site.path("elastic.toml");
    std::fs::write(&catalogue, format!("[mine]\ncommand = [{:?}]\n", native::command().get_program())).unwrap();
    let out = site.path("mine");
    let arguments = ["run", "scenes/biaxial-small.toml", "--engine", "mine", "--set", "output.points=[0]"];
    let mut command = site.program(&[&arguments[..], &SMALL, &["--out", out.to_str().unwrap()]].concat());
    let ended = command.env("GRAINSPAN_ENGINES", catalogue).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{said}");
    assert!(said.contains("engine `elastic-c` does not deliver fabric, fabric_anisotropy,"), "{said}");
    let table = Table::read(&out.join("points/point-0000.csv"));
    for column in ["fabric_xx", "fabric_anisotropy", "coordination_number_no_rattlers", "damping_work"] {
        let values = table.column(column);
        assert!(values.len() > 1 && values.iter().all(|value| value.is_nan()), "{column}: {values:?}");
    }
    assert!(table.column("sigma_yy").iter().all(|value| value.is_finite()));
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    let energies: Vec<&String> = summary["energy"].as_object().unwrap().keys().collect();
    assert_eq!(energies, ["external_work", "hourglass", "stabilisation"]);
}

#[test]
fn what_an_engine_cannot_do_is_told_before_the_run() {
    let site = Site::new();
    let check = |extra: &[&str]| {
        let arguments = [&["check", "scenes/biaxial-small.toml"], extra].concat();
        let ended = program(&site, &arguments).stdout(std::process::Stdio::piped()).output().unwrap();
        let text = [ended.stdout, ended.stderr].concat();
        (ended.status.code().unwrap(), String::from_utf8(text).unwrap())
    };
    let (code, text) = check(&["--engine", "nonsense"]);
    assert!(code == 2 && text.contains("there is no engine 'nonsense'") && text.contains("reference"), "{text}");
    let (code, text) = check(&["--set", "pool.points.reference=[99]"]);
    assert!(code == 2 && text.contains("no Gauss point 99"), "{text}");
    if foreign::is_there("reference") {
        let (code, text) = check(&["--engine", "reference-replay"]);
        assert!(code == 0 && text.contains("finite differences") && text.contains("has no snapshots"), "{text}");
        assert!(text.contains("does not deliver damping_work: they are NaN at its points"), "{text}");
        let (code, text) = check(&["--engine", "reference", "--set", "contact.damping=0.5"]);
        assert!(code == 2 && text.contains("engine `reference` does not follow contact.damping"), "{text}");
        let both = ["pool.points.reference=[0]", "pool.points.reference-replay=[1]"];
        let (code, text) = check(&["--set", both[0], "--set", both[1]]);
        assert!(code == 2 && text.contains("both report the name `reference`"), "{text}");
    }
}

/// An engine in Python that breaks down as it builds its first cell: it was taken for a refusal of the cell, which ended the run.
#[test]
fn a_fault_while_a_cell_is_built_costs_a_worker_and_not_the_run() {
    if !foreign::is_there("reference") {
        return;
    }
    let site = Site::new();
    let script = site.path("transient.py");
    let text = format!(
        "import os, sys\n\
         from grainspan_worker import main\n\
         from grainspan_worker.engines.reference import ReferenceRve\n\
         class Transient(ReferenceRve):\n    \
             def __init__(self, *arguments):\n        \
                 mark = {:?}\n        \
                 if not os.path.exists(mark):\n            \
                     open(mark, 'w').close()\n            \
                     raise MemoryError('no memory at the moment')\n        \
                 super().__init__(*arguments)\n\
         main(Transient)\n",
        site.path("failed-once")
    );
    std::fs::write(&script, text).unwrap();
    let catalogue = site.path("transient.toml");
    let entry = format!(
        "[transient]\ncommand = [{:?}, {script:?}]\nenvironment = {{ PYTHONPATH = {:?} }}\n",
        foreign::python(),
        foreign::package()
    );
    std::fs::write(&catalogue, entry).unwrap();
    let out = site.path("transient");
    let start =
        ["run", "scenes/biaxial-small.toml", "--quiet", "--engine", "transient", "--out", out.to_str().unwrap()];
    let mut command = site.program(&[&start[..], &SMALL].concat());
    let ended = command.env("GRAINSPAN_ENGINES", catalogue).output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(site.path("failed-once").exists());
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert!(summary["worker_restarts"].as_u64().unwrap() > 0, "{summary}");
    run(&site, "healthy", &["--engine", "reference"]);
    assert_eq!(site.history("transient"), site.history("healthy"));
}
