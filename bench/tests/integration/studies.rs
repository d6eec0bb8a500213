//! Every study of `grainspan bench` runs in its quick form and leaves tables, pictures and the machine.

use crate::program::{Site, bench, root, stderr};
use std::fs;

#[test]
fn every_study_runs_and_leaves_its_findings() {
    let site = Site::new();
    let listed = bench(&["--list"]);
    assert!(listed.status.success());
    let listed = String::from_utf8(listed.stdout).unwrap();
    let names: Vec<&str> = listed.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"self-test"), "{listed}");
    for name in names {
        let folder = site.path(name);
        let ended = bench(&[name, "--quick", "--out", folder.to_str().unwrap()]);
        let said = stderr(&ended);
        if name == "instructions" && said.contains("nothing here counts instructions") {
            // Neither the processor nor Valgrind counts here: the study says what to install.
            assert!(ended.status.code() == Some(2) && said.contains("apt-get install"), "{said}");
            continue;
        }
        assert!(ended.status.success(), "bench {name}: {said}");
        let machine: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.join("machine.json")).unwrap()).unwrap();
        assert!(machine["cores"].as_u64().unwrap() > 0);
        assert!(fs::read_to_string(folder.join("report.txt")).unwrap().contains("A quick look"));
        let files = fs::read_dir(&folder).unwrap().flatten().map(|entry| entry.path());
        let tables: Vec<_> = files.filter(|file| file.extension().is_some_and(|end| end == "csv")).collect();
        assert!(!tables.is_empty(), "bench {name} left no table");
        for table in tables {
            let rows = csv_rows(&table);
            // It lists increments that did not come to rest; most seeds have none in so few cases.
            let may_be_empty = table.ends_with("stability/restless.csv");
            assert!(rows >= 1 || may_be_empty, "{} has no rows", table.display());
        }
    }
}

/// Rows below the head; every row must have as many cells as the head.
fn csv_rows(path: &std::path::Path) -> usize {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.records().collect::<Result<Vec<_>, _>>().unwrap().len()
}

#[test]
fn pictures_are_drawn_again_and_counted_and_nothing_to_draw_is_refused() {
    let site = Site::new();
    let measured = root().join("docs/lab-book/runs/2026-11-21-epyc-2-cores/rve/spheres-1000.csv");
    let folder = site.path("rve");
    let redraw = ["rve", "--redraw", "--out", folder.to_str().unwrap()];
    fs::create_dir(&folder).unwrap();
    let ended = bench(&redraw);
    assert_eq!(ended.status.code(), Some(2));
    let said = stderr(&ended);
    assert!(said.contains("no table to draw from") && said.contains("hint:"), "{said}");
    fs::copy(measured, folder.join("spheres-1000.csv")).unwrap();
    let drawn = bench(&redraw);
    assert!(drawn.status.success());
    assert!(String::from_utf8(drawn.stdout).unwrap().starts_with("6 pictures drawn again in "));
}

#[test]
fn an_unknown_study_is_refused_with_the_way_to_the_list() {
    let ended = bench(&["nonsense"]);
    assert_eq!(ended.status.code(), Some(2));
    assert!(stderr(&ended).contains("bench --list"), "{}", stderr(&ended));
}

/// An unknown part measured everything, and one that a quick look leaves out nothing.
#[test]
fn an_unknown_part_is_refused_with_those_that_there_are() {
    let site = Site::new();
    for (arguments, said) in [
        (&["rve", "--only", "spheres"][..], "spheres-1000"),
        (&["rve", "--quick", "--only", "spheres-1000"], "discs-400"),
        (&["error-estimate", "--only", "discs-400 of seed 1"], "discs-400 of seed 11"),
        (&["stability", "--only", "every"], "everyday"),
        (&["channel", "--only", "latency"], "has no parts"),
        (&["newton", "--only", "slip_newtn"], "slip_newton"),
        (&["newton", "--only", "biaxial", "--only", "slip_secant_rounded"], "no part that is chosen has a variant"),
    ] {
        let folder = site.path(arguments[0]);
        let ended = bench(&[arguments, &["--out", folder.to_str().unwrap()]].concat());
        let text = stderr(&ended);
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(said) && text.contains("hint:"), "{arguments:?}: {text}");
    }
}

#[test]
fn microbenchmarks_are_listed_and_print() {
    let listed = bench(&["micro"]);
    let text = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.status.success() && text.contains("lane_cost PACKING"), "{text}");
    let ended = bench(&["micro", "lane_cost", "packings/discs-100.json", "4"]);
    assert!(ended.status.success(), "{}", stderr(&ended));
    assert!(String::from_utf8(ended.stdout).unwrap().contains("bits are the same"));
    let unknown = bench(&["micro", "nonsense"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(stderr(&unknown).contains("bench micro"), "{}", stderr(&unknown));
    let misplaced = bench(&["channel", "lane_cost"]);
    assert_eq!(misplaced.status.code(), Some(2));
}
