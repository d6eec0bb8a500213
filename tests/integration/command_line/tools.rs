//! The commands other than `run` and `element`: pack, check, bench, completions, help.

use crate::harness::commands::{grainspan, succeeded};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

#[test]
fn the_small_packing_is_made_to_the_same_bits_each_time_and_reported() {
    let output = succeeded(&["pack", "packings/discs-100.toml"]);
    assert!(
        output.stdout == succeeded(&["pack", "packings/discs-100.toml"]).stdout,
        "another packing the second time"
    );
    let report = String::from_utf8(output.stderr).unwrap();
    for word in ["void ratio", "coordination number", "anisotropy", "tolerance", "force evaluations"] {
        assert!(report.contains(word), "{word}: {report}");
    }
}

#[test]
fn check_gives_an_overview() {
    let output = succeeded(&["check", "scenes/biaxial.toml"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for line in ["32 elements (q8), 121 nodes", "242 of which 19 are prescribed", "128", "400 discs", "Scene OK."] {
        assert!(text.contains(line), "{line}: {text}");
    }
}

/// What a beginner has to know before the run: what the packing carries, whether the loads ask for it, and what it costs.
#[test]
fn check_tells_what_the_packing_carries_and_whether_the_loads_ask_for_it() {
    let scene = "scenes/biaxial-small.toml";
    let text = String::from_utf8(succeeded(&["check", scene]).stdout).unwrap();
    for part in
        ["xx -1.000e5, yy -1.000e5, xy", "mean pressure 1.000e5 Pa", "void ratio 0.", "without rattlers", "of memory"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!text.contains("DO NOT MATCH"), "{text}");
    let output = succeeded(&["check", scene, "--set", "pressure.0.value=2e5", "--set", "solver.force_tolerance=1e9"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for part in
        ["LOADS AND PACKING DO NOT MATCH", "2.000e5 Pa on left", "history = \"ramp\"", "solver.force_tolerance = 1e9"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(text.ends_with("do not match; see the note above.\n") && !text.contains("Scene OK"), "{text}");
}

#[test]
fn packings_that_are_not_at_rest_under_the_law_of_the_scene_are_named_before_and_after_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("springless");
    let settings = [
        "packing='../packings/discs-400.json'",
        "contact.stiffness_ratio=0",
        "mesh.elements=[1, 1]",
        "loading.increments=1",
        "solver.force_tolerance=1e-3",
        "solver.displacement_tolerance=1e-2",
        // Or it may end at a state within the weaker tolerances.
        "solver.stagnated_force_tolerance=0",
        "solver.stagnated_displacement_tolerance=0",
    ];
    let settings: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let check = [&["check", "scenes/biaxial-small.toml"], &settings[..]].concat();
    let checked = String::from_utf8(succeeded(&check).stdout).unwrap();
    for part in
        ["753 were dropped because stiffness_ratio = 0", "the grains are far from rest under this contact law"]
    {
        assert!(checked.contains(part), "{part}: {checked}");
    }
    let run = ["run", "scenes/biaxial-small.toml", "--out", out.to_str().unwrap()];
    let output = grainspan(&[&run, &settings[..]].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    // A frictionless packing that was prepared with friction falls together: there is no equilibrium near.
    assert!(!output.status.success(), "{told}");
    for part in [
        "753 contact forces of packings dropped or cut",
        "1 packing far from rest",
        "Prepare the packing under the law",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["fallback_groups"]["look_at_this"]["packing_forces_changed"], 753);
    assert!(fs::read_to_string(out.join("run.jsonl")).unwrap().contains("packing_under_another_law"));
}

#[test]
fn check_says_when_a_packing_carries_no_load() {
    let folder = tempfile::tempdir().unwrap();
    let packing = folder.path().join("one.json");
    let text = "{\"format\":\"grainspan-packing\",\"version\":1,\"dimension\":2,\"thickness\":5e-4,\"periodicity\":[[1e-2,0.0],[0.0,1e-2]],\
                \"grains\":[[1e-3,1e-3,2.5e-4],[5e-3,5e-3,1e-9]]}";
    fs::write(&packing, text).unwrap();
    let setting = format!("packing='{}'", packing.display());
    let text =
        String::from_utf8(succeeded(&["check", "scenes/biaxial-small.toml", "--set", &setting]).stdout).unwrap();
    assert!(text.contains("the packing carries no load") && text.contains("in other units?"), "{text}");
}

/// The benchmarks are a program of their own; the command passes everything on and says where to get the program.
#[test]
fn benchmarks_are_the_program_next_to_this_one() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("grainspan");
    fs::copy(env!("CARGO_BIN_EXE_grainspan"), &own).unwrap();
    let bench = |arguments: &[&str]| {
        let mut command = Command::new(&own);
        command.arg("bench").args(arguments).env("PATH", folder.path().join("elsewhere")).output().unwrap()
    };
    let missing = bench(&["--list"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("cargo build --release --package grainspan-bench"));
    let other = folder.path().join("grainspan-bench");
    fs::write(&other, "#!/bin/sh\nprintf '%s|' \"$@\"\nexit 7\n").unwrap();
    fs::set_permissions(&other, fs::Permissions::from_mode(0o755)).unwrap();
    for arguments in [&["--list"][..], &["rve", "--quick", "--only", "a b"], &["--help"], &["rve", "-h"]] {
        let passed = bench(arguments);
        assert_eq!(passed.status.code(), Some(7));
        assert_eq!(String::from_utf8(passed.stdout).unwrap(), format!("{}|", arguments.join("|")));
    }
}

#[test]
fn every_command_explains_itself_with_an_example() {
    let help = String::from_utf8(succeeded(&["--help"]).stdout).unwrap();
    assert!(help.contains("Examples:") && help.contains("Exit codes: 0 done"), "{help}");
    for command in ["run", "element", "pack", "check"] {
        assert!(help.contains(command));
        let own = String::from_utf8(succeeded(&[command, "--help"]).stdout).unwrap();
        assert!(own.contains("Example") && own.contains(&format!("grainspan {command} ")), "{own}");
    }
    let script = String::from_utf8(succeeded(&["completions", "bash"]).stdout).unwrap();
    assert!(script.contains("complete -F _grainspan"), "a bash script");
}

/// `2>&1 | head`: what is told to people ends no run.
#[test]
fn a_reader_of_messages_that_leaves_ends_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut run = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", "scenes/biaxial-small.toml", "--workers", "1", "--out"])
        .arg(&out)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(run.stderr.take());
    assert!(run.wait().unwrap().success());
    assert!(out.join("summary.json").exists());
}

/// The packing of a region under the law of that region.
#[test]
fn check_knows_the_packings_of_regions() {
    let region = "region=[{ name = 'soft', from = [-1.0, -1.0], to = [1.0, 1.0], \
                  contact = { law = 'linear', modulus = 1e8, stiffness_ratio = 0.5, friction = 1e-7, density = 2650.0 } }]";
    let text = String::from_utf8(succeeded(&["check", "scenes/biaxial-small.toml", "--set", region]).stdout).unwrap();
    assert!(text.contains("packing of a region: of the packing's tangential forces"), "{text}");
}
