//! What `grainspan run` writes and says: files, messages, exit codes, and the report about a run.

use super::run::{numbers, run, run_scene, text};
use crate::harness::table::Table;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use vtkio::Vtk;
use vtkio::model::{CellType, DataSet};

/// Names of the files in a folder, sorted.
fn names(folder: PathBuf) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_small_scene_runs_and_writes_everything_it_promises() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let output = run(&out, "2", &[]);
    let stderr = text(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    assert!(output.stdout.is_empty(), "data goes to files");
    for line in [
        "step   5  load 1.0000",
        "done: 5 steps",
        "evaluations",
        "worker time",
        "warnings",
        "fallbacks",
        "skipped",
        "initial residual",
        "written to",
    ] {
        assert!(stderr.contains(line), "{line}: {stderr}");
    }
    assert_eq!(
        names(out.clone()),
        [
            "cells",
            "fields",
            "fields.pvd",
            "grains",
            "history.csv",
            "history.svg",
            "packing.json",
            "probe_errors.csv",
            "run.jsonl",
            "scene.toml",
            "summary.json",
            "units.json"
        ]
    );
    check_history(&out);
    check_summary(&out);
    check_fields(&out);
    for line in fs::read_to_string(out.join("run.jsonl")).unwrap().lines() {
        let event: serde_json::Value = serde_json::from_str(line).expect("every line is one JSON object");
        assert!(event["timestamp"].is_string() && event["level"].is_string());
    }
}

fn check_history(out: &Path) {
    let history = Table::read(&out.join("history.csv"));
    assert_eq!(
        history.names().join(","),
        "step,time,load,iterations,evaluations,axial_compression,stress_ratio,volume_change,top_force,cut_backs,stabilised,committed_iterates,strain_per_step,estimated_error,estimated_error_of_mean,balance_error,balance_error_of_mean"
    );
    assert_eq!(history.rows().len(), 6);
    let ratio = history.column("stress_ratio");
    assert!((ratio[0] - 1.0).abs() < 1e-4, "the packing starts isotropic");
    assert!((history.last("axial_compression") - 5.0e-3).abs() < 1e-12, "the platen goes all the way");
    assert!((ratio[5] / 2.215 - 1.0).abs() < 0.02, "the stress ratio grows: {}", ratio[5]);
    // The platen carries the mean vertical stress: force = stress x current width, and the sides stay at 100 kPa.
    assert!((history.column("top_force")[0] + 5000.0).abs() < 1.0, "100 kPa on 50 mm");
}

fn check_summary(out: &Path) {
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!((summary["status"].as_str(), summary["steps"].as_u64()), (Some("done"), Some(5)));
    assert_eq!((summary["gauss_points"].as_u64(), summary["workers"].as_u64()), (Some(32), Some(2)));
    assert_eq!(summary["fallbacks"]["tangent_fallback"].as_u64(), Some(0));
    let time = |key: &str| summary["time"][key].as_f64().unwrap();
    let workers = time("rve_s") + time("tangent_s") + time("transport_s") + time("idle_s");
    assert!(
        (workers / (2.0 * time("wall_s")) - 1.0).abs() < 0.05,
        "two workers: {workers} s in {} s",
        time("wall_s")
    );
    assert!(time("macro_transport_s") > 0.0 && time("macro_transport_s") < time("wall_s"));
    assert!(time("rve_s") > 0.0 && time("tangent_s") > 0.0);
    let balance = |key: &str| summary["balance"][key].as_f64().unwrap();
    let ratio = balance("largest_force_ratio");
    assert!(ratio > 0.0 && ratio <= 1e-2, "within the tolerance of forces: {ratio}");
    assert!(balance("error_of_mean") <= balance("error") && balance("error") < 1e-2);
    let energy = |key: &str| summary["energy"][key].as_f64().unwrap();
    let balance = energy("external_work") - (energy("elastic") - energy("elastic_initial"));
    // Measured 0.42 against 0.43 J: the rest is the trapezium rule over five steps and the damping of the grains.
    assert!((balance - energy("frictional_dissipation")).abs() < 0.05 * energy("external_work"), "{balance}");
}

fn check_fields(out: &Path) {
    assert_eq!(names(out.join("fields")).len(), 6);
    let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(out.join("fields/step-0005.vtu")).unwrap().data else {
        panic!("not an unstructured grid")
    };
    let grid = pieces[0].load_piece_data(None).unwrap();
    assert_eq!((grid.num_points(), grid.cells.num_cells()), (15, 8));
    assert!(grid.cells.types.iter().all(|kind| *kind == CellType::Quad));
    let on_nodes: Vec<&str> = grid.data.point.iter().map(|field| field.name()).collect();
    assert_eq!(on_nodes, ["displacement", "reaction", "load"]);
    let on_elements: Vec<&str> = grid.data.cell.iter().map(|field| field.name()).collect();
    for field in [
        "stress",
        "strain",
        "void_ratio",
        "coordination_number",
        "grain_rotation",
        "step_evaluations",
        "force_evaluations",
    ] {
        assert!(on_elements.contains(&field), "{field}: {on_elements:?}");
    }
    let DataSet::PolyData { pieces, .. } = Vtk::import(out.join("grains/point-0000-step-0005.vtp")).unwrap().data
    else {
        panic!("not poly data")
    };
    let grains = pieces[0].load_piece_data(None).unwrap();
    assert_eq!(grains.num_points(), 100);
    let fields: Vec<&str> = grains.data.point.iter().map(|field| field.name()).collect();
    assert_eq!(fields, ["radius", "rotation", "contacts", "rattler", "displacement_fluctuation"]);
}

#[test]
fn a_run_that_cannot_converge_says_so_and_keeps_what_it_has() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let hopeless = ["--set", "loading.max_iterations=1", "--set", "loading.smallest_increment=0.1"];
    let left_alone = ["--set", "loading.stabilise=false", "--set", "name=hopeless"];
    let output = run(&out, "1", &[&hopeless[..], &left_alone].concat());
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(
        stderr.contains("cut back") && stderr.contains("error: the run did not converge") && stderr.contains("hint:")
    );
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["status"].as_str(), Some("not_converged"));
    assert!(summary["cutbacks"].as_u64() > Some(0));
    let history = fs::read_to_string(out.join("history.csv")).unwrap();
    assert!(history.lines().count() >= 2 && history.ends_with('\n'), "the initial state is kept: {history}");
    // The same with viscous stabilisation: it gets through, and says what that took.
    let out = place.path().join("stabilised");
    let output = run(&out, "2", &hopeless);
    let stderr = text(&output.stderr);
    assert!(output.status.success() && stderr.contains("stabilised: equilibrium after"), "{stderr}");
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert!(summary["fallbacks"]["steps_stabilised"].as_u64() > Some(0), "{summary}");
    let taken = summary["energy"]["stabilisation"].as_f64().unwrap();
    assert!(taken.abs() > 0.0 && taken.abs() < 0.2 * summary["energy"]["external_work"].as_f64().unwrap(), "{taken}");
    // How each step was reached stands in its row, and in the picture.
    let stabilised: Vec<f64> = numbers(&out, "stabilised").into_iter().filter(|count| *count > 0.0).collect();
    assert_eq!(stabilised.len() as u64, summary["fallbacks"]["steps_stabilised"].as_u64().unwrap());
    assert_eq!(
        stabilised.iter().sum::<f64>() as u64,
        summary["fallbacks"]["stabilisation_increments"].as_u64().unwrap()
    );
    assert_eq!(numbers(&out, "cut_backs").iter().sum::<f64>() as u64, summary["cutbacks"].as_u64().unwrap());
    assert!(fs::read_to_string(out.join("history.svg")).unwrap().contains("stabilised"));
}

/// The commonest error of a beginner: the packing was prepared at another stress than the loads ask for. More increments cannot
/// help; the reason is in every file that somebody may look at.
#[test]
fn a_run_that_finds_no_start_says_what_the_packing_carries_and_the_report_shows_it() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let output = run(&out, "2", &["--set", "pressure.1.value=-1e5", "--set", "mesh.elements=[1, 1]"]);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    for part in [
        "found no equilibrium at the start",
        "step 0 found no equilibrium",
        "the packing has the stress xx -1.000e5",
        "-1.000e5 Pa on right",
        "history = \"ramp\"",
    ] {
        assert!(stderr.contains(part), "{part}: {stderr}");
    }
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert!(summary["reason"].as_str().unwrap().contains("the packing has the stress"), "{summary}");
    let journal = fs::read_to_string(out.join("run.jsonl")).unwrap();
    assert!(journal.lines().any(|line| line.contains("\"ended\"") && line.contains("the packing has the stress")));
    report(&out);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        page.contains("\"status\":\"not_converged\"")
            && page.contains("the packing has the stress")
            && page.contains("No step was accepted")
    );
    assert!(page.contains("\"outlines\":[["), "the mesh");
}

/// The page of a finished run begins with the curve that the scene asks for, and does not spoil the folder for the next run.
#[test]
fn a_report_shows_the_curve_of_the_scene_and_leaves_the_folder_to_the_next_run() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let small = ["--set", "loading.increments=2", "--set", "mesh.elements=[1, 1]"];
    assert!(run(&out, "1", &small).status.success());
    report(&out);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let scene = fs::read_to_string(out.join("scene.toml")).unwrap();
    let main = "\"main\":[\"axial_compression\",\"stress_ratio\"]";
    assert!(page.contains(main), "the curve of the scene: {scene}");
    assert!(page.contains("\"unit\":\"N/m\""), "units are known");
    let again = run(&out, "1", &small);
    assert!(again.status.success(), "{}", text(&again.stderr));
    assert!(!out.join("report.html").exists());
}

fn report(out: &Path) {
    let output = Command::new(env!("CARGO_BIN_EXE_grainspan")).arg("report").arg(out).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// Energy that a motion was not given came from grains that its packing lets go, and the message told of the time step alone.
#[test]
fn an_unstable_motion_of_a_packing_far_from_rest_says_so() {
    let place = tempfile::tempdir().unwrap();
    let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let scene = place.path().join("wave.toml");
    let conditions = "[[periodic]]\nfrom = \"left\"\nto = \"right\"\njump = { x = 0.0, y = 0.0 }\n[[boundary]]\nset = \"bottom\"\n\
                      displacement = { x = 1e-7 }\nhistory = { sine = { frequency = 50.0 } }\n[[boundary]]\nset = \"bottom\"\n\
                      displacement = { y = 0.0 }\n[[boundary]]\nset = \"top\"\ndisplacement = { x = 0.0, y = 0.0 }\n";
    let text = format!(
        "packing = \"{}\"\nprocedure = \"dynamic\"\n[mesh]\nsize = [1.0, 2.0]\nelements = [1, 9]\nelement = \"q4_single\"\n\
         [contact]\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.0\n[rve]\naccuracy = \"default\"\n{conditions}\
         [loading]\nduration = 6e-3\n[dynamics]\noutput_interval = 1e-3\n",
        packing.display()
    );
    fs::write(&scene, text).unwrap();
    let output = run_scene(scene.to_str().unwrap(), &place.path().join("out"), "1", &["--quiet"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let expected = ["the motion is unstable", "hint: ", "far from rest under this contact law", "grainspan pack"];
    assert!(expected.iter().all(|part| said.contains(part)), "{said}");
}
