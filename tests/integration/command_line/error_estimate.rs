//! The estimated error of a run, and runs that keep to an error.

use crate::harness::table::Table;
use macro_solver::output::frame_file;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn run(out: &Path, workers: &str, settings: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", "scenes/biaxial-small.toml", "--workers", workers, "--quiet", "--out"])
        .arg(out)
        .args(settings.iter().flat_map(|setting| ["--set", setting]))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the binary starts")
}

fn done(out: &Path, workers: &str, settings: &[&str]) -> serde_json::Value {
    let output = run(out, workers, settings);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap()
}

fn history(out: &Path) -> Table {
    Table::read(&out.join("history.csv"))
}

/// Values of a column; 0 where there is none, as at the start.
fn column(out: &Path, name: &str) -> Vec<f64> {
    history(out).texts(name).into_iter().map(|text| text.parse().unwrap_or(0.0)).collect()
}

#[test]
fn an_estimate_changes_no_byte_of_the_results_and_tells_their_error() {
    let place = tempfile::tempdir().unwrap();
    let [with, without, tight] = ["with", "without", "tight"].map(|name| place.path().join(name));
    // Forces balance closely, so that the error of the stresses is that of the cells.
    let closely = |out: &Path, settings: &[&str]| {
        let tolerances = ["solver.force_tolerance=1e-3", "solver.displacement_tolerance=1e-2"];
        done(out, "2", &[&tolerances[..], settings].concat())
    };
    let summary = closely(&with, &["error_estimate.share=0.2"]);
    let plain = closely(&without, &["error_estimate.enabled=false"]);
    assert!(plain["accuracy"].is_null());
    let (estimated, plain) = (history(&with), history(&without));
    assert_eq!(&estimated.names()[..plain.names().len()], plain.names());
    for name in plain.names() {
        assert_eq!(estimated.texts(name), plain.texts(name), "{name}");
    }
    for step in 0..estimated.count() {
        let frame = frame_file(step as u64);
        assert_eq!(fs::read(with.join(&frame)).unwrap(), fs::read(without.join(&frame)).unwrap(), "{frame}");
    }
    // All points of the scene are alike and the specimen stays uniform: the error of the stress ratio is that of a point.
    closely(&tight, &["rve.accuracy=tight", "rve.tolerance=1e-6", "error_estimate.enabled=false"]);
    let errors: Vec<f64> = column(&with, "stress_ratio")
        .iter()
        .zip(column(&tight, "stress_ratio"))
        .map(|(found, exact)| (found - exact).abs() / (0.5 * (1.0 + exact)))
        .collect();
    let mean = |values: &[f64]| (values.iter().map(|value| value * value).sum::<f64>() / 5.0).sqrt();
    let (truth, estimated) = (mean(&errors), mean(&column(&with, "estimated_error")));
    // Within a factor of three: the estimate of a single cell scatters, and the lateral strain answers to the error too.
    assert!((truth / 3.0..3.0 * truth).contains(&estimated), "{estimated} for {truth}");
    let share = summary["accuracy"]["share_of_force_evaluations"].as_f64().unwrap();
    assert!(share > 0.0 && share < 0.5, "{share}");
    // Seven that stay with their points, and one that follows the strain.
    assert_eq!(summary["accuracy"]["points"], 8);
}

#[test]
fn a_run_by_error_chooses_its_strain_per_step_and_is_the_same_for_any_number_of_workers() {
    let place = tempfile::tempdir().unwrap();
    let [one, three, strict] = ["one", "three", "strict"].map(|name| place.path().join(name));
    let loose = ["rve.accuracy=default", "rve.error=1e-2"];
    let summary = done(&one, "1", &loose);
    done(&three, "3", &loose);
    assert_eq!(fs::read(one.join("history.csv")).unwrap(), fs::read(three.join("history.csv")).unwrap());
    let strains = column(&one, "strain_per_step");
    assert!(strains[1] == 1e-5 && strains[5] > 1.2e-5, "it starts with a thousandth of the error: {strains:?}");
    assert!(summary["accuracy"]["over_all_steps"].as_f64().unwrap() < 1e-2, "{summary}");
    // An error that no strain per step within the bounds can keep to is counted.
    let summary = done(&strict, "2", &["rve.accuracy=default", "rve.error=1e-5", "loading.increments=50"]);
    let last = column(&strict, "strain_per_step");
    assert!(last.iter().all(|strain| (2e-9..=4e-8).contains(strain)), "{last:?}");
    let missed = column(&strict, "estimated_error").iter().filter(|error| **error > 1e-5).count();
    assert_eq!(summary["fallbacks"]["error_above_wanted"].as_u64(), Some(missed as u64));
}

#[test]
fn keys_that_contradict_the_error_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    for (settings, expected) in [
        (&["rve.error=5e-3"][..], "leave out accuracy"),
        (&["rve.accuracy=default", "rve.error=0.5"], "rve.error"),
        (&["rve.accuracy=default", "rve.error=5e-3", "error_estimate.enabled=false"], "needs the estimate"),
        (&["error_estimate.share=0"], "error_estimate.share"),
    ] {
        let output = run(&out, "1", settings);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(expected), "{expected}: {stderr}");
    }
}
