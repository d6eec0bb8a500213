//! Every study of `grainspan bench` runs in its quick form and leaves tables, pictures and the machine.

use crate::harness::Site;
use std::fs;
use std::process::Stdio;

#[test]
fn every_study_runs_and_leaves_its_findings() {
    let site = Site::new();
    let listed = site.program(&["bench", "--list"]).stdout(Stdio::piped()).output().unwrap();
    assert!(listed.status.success());
    let listed = String::from_utf8(listed.stdout).unwrap();
    let names: Vec<&str> = listed.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"self-test"), "{listed}");
    for name in names {
        let folder = site.path(name);
        let ended = site.start(name, &["bench", name, "--quick", "--out", folder.to_str().unwrap()]).end();
        assert!(ended.status.success(), "bench {name}: {}", ended.stderr);
        let machine: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.join("machine.json")).unwrap()).unwrap();
        assert!(machine["cores"].as_u64().unwrap() > 0);
        assert!(fs::read_to_string(folder.join("report.txt")).unwrap().contains("A quick look"));
        let files = fs::read_dir(&folder).unwrap().flatten().map(|entry| entry.path());
        let tables: Vec<_> = files.filter(|file| file.extension().is_some_and(|end| end == "csv")).collect();
        assert!(!tables.is_empty(), "bench {name} left no table");
        for table in tables {
            let rows = csv_rows(&table);
            assert!(rows >= 1, "{} has no rows", table.display());
        }
    }
}

/// Rows below the head; every row must have as many cells as the head.
fn csv_rows(path: &std::path::Path) -> usize {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.records().collect::<Result<Vec<_>, _>>().unwrap().len()
}

#[test]
fn pictures_are_drawn_anew_and_counted_and_nothing_to_draw_is_refused() {
    let site = Site::new();
    let measured = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/bench/2026-11-21-epyc-2-cores/rve/spheres-1000.csv");
    let folder = site.path("rve");
    let redraw = ["bench", "rve", "--redraw", "--out", folder.to_str().unwrap()];
    fs::create_dir(&folder).unwrap();
    let ended = site.start("nothing", &redraw).end();
    assert_eq!(ended.status.code(), Some(2));
    assert!(ended.stderr.contains("no table to draw from") && ended.stderr.contains("hint:"), "{}", ended.stderr);
    fs::copy(measured, folder.join("spheres-1000.csv")).unwrap();
    let told = site.program(&redraw).stdout(Stdio::piped()).output().unwrap();
    assert!(told.status.success());
    assert!(String::from_utf8(told.stdout).unwrap().starts_with("6 pictures drawn anew in "));
}

#[test]
fn an_unknown_study_is_refused_with_the_way_to_the_list() {
    let site = Site::new();
    let ended = site.start("none", &["bench", "nonsense"]).end();
    assert_eq!(ended.status.code(), Some(2));
    assert!(ended.stderr.contains("bench --list"), "{}", ended.stderr);
}
