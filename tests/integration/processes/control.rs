//! `grainspan ctl`: real runs are paused, saved and stopped between two steps, and end in the same bytes.

use crate::harness::{Ended, Site, Watched, eventually, signal};
use rustix::process::Signal;
use std::fs;
use std::process::Stdio;
use std::time::Duration;

fn start(site: &Site, name: &str, more: &[&str]) -> Watched {
    let out = site.path(name);
    let words = ["run", "scenes/biaxial-small.toml", "--workers", "1", "--out", out.to_str().unwrap()];
    let size =
        ["--set", "mesh.elements=[1, 2]", "--set", "loading.increments=100", "--set", "checkpoint.seconds=3600"];
    site.start(name, &[&words[..], &size, more].concat())
}

/// `grainspan ctl` on the folder `name`: exit code, standard output, standard error.
fn ctl(site: &Site, name: &str, words: &[&str]) -> (Option<i32>, String, String) {
    let folder = site.path(name);
    let arguments = [&["ctl", folder.to_str().unwrap()], words].concat();
    let output = site.program(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn whole(site: &Site) -> String {
    let ended: Ended = start(site, "whole", &[]).end();
    assert!(ended.status.success(), "{}", ended.stderr);
    site.history("whole")
}

#[test]
fn a_run_that_was_paused_ends_in_the_same_bytes_and_can_be_looked_at_meanwhile() {
    let site = Site::new();
    let expected = whole(&site);
    let mut run = start(&site, "paused", &[]);
    run.await_rows(&site.path("paused/history.csv"), 3);
    assert_eq!(ctl(&site, "paused", &["pause", "--wait"]).0, Some(0));
    let rows = site.history("paused").lines().count();
    assert!(site.path("paused/checkpoint.bin").exists(), "a paused run has saved its state");
    assert!(site.status().contains("grainspan ctl"), "{}", site.status());
    // What the page asks for is done while the run waits.
    fs::write(site.path("paused/control/cell-3"), "").unwrap();
    let cell = eventually("cell of a Gauss point", || {
        let text = fs::read(site.path("paused/cells/point-0003.json")).ok()?;
        serde_json::from_slice::<serde_json::Value>(&text).ok()
    });
    assert_eq!(cell["step"].as_u64().unwrap() as usize, rows - 2);
    assert_eq!(cell["grains"].as_array().unwrap().len(), 100);
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(site.history("paused").lines().count(), rows, "a paused run waits");
    assert_eq!(ctl(&site, "paused", &["resume", "--wait"]).0, Some(0));
    let ended = run.end();
    assert!(ended.status.success(), "{}", ended.stderr);
    assert_eq!(site.history("paused"), expected);
    for file in ["fields/step-0100.vtu", "fields.pvd", "cells/point-0003.json", "units.json", "probe_errors.csv"] {
        let read = |name: &str| fs::read(site.path(name).join(file)).unwrap();
        assert!(read("paused") == read("whole"), "{file}");
    }
    assert!(!site.path("paused/control/paused").exists());
}

#[test]
fn a_stopped_run_continues_to_the_same_bytes() {
    let site = Site::new();
    let expected = whole(&site);
    let mut run = start(&site, "parts", &[]);
    run.await_rows(&site.path("parts/history.csv"), 3);
    assert_eq!(ctl(&site, "parts", &["checkpoint", "--wait"]).0, Some(0));
    assert!(site.path("parts/checkpoint.bin").exists());
    let (code, said, _) = ctl(&site, "parts", &["stop"]);
    assert_eq!(code, Some(0));
    assert!(said.contains("after its current step"), "{said}");
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(130), "{}", ended.stderr);
    let rows = site.history("parts").lines().count();
    assert!(rows < 102 && site.path("parts/checkpoint.bin").exists());
    let ended = start(&site, "parts", &["--resume"]).end();
    assert!(ended.status.success(), "{}", ended.stderr);
    assert!(ended.stderr.contains(&format!("continuing after step {}", rows - 2)), "{}", ended.stderr);
    assert_eq!(site.history("parts"), expected);
}

#[test]
fn a_state_that_cannot_be_saved_is_told_to_whoever_asked_for_it() {
    let site = Site::new();
    let mut run = start(&site, "full", &[]);
    run.await_rows(&site.path("full/history.csv"), 2);
    // A folder in the way of the draft: the disk takes no checkpoint.
    let in_the_way = site.path("full/.checkpoint.partial");
    fs::create_dir(&in_the_way).unwrap();
    let (code, _, said) = ctl(&site, "full", &["checkpoint", "--wait"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("could not save its state; it goes on") && said.contains("checkpoint.bin"), "{said}");
    let (code, _, said) = ctl(&site, "full", &["pause", "--wait"]);
    assert!(code == Some(2) && said.contains("it is paused"), "{said}");
    fs::remove_dir(&in_the_way).unwrap();
    assert_eq!(ctl(&site, "full", &["checkpoint", "--wait"]).0, Some(0));
    assert!(site.path("full/checkpoint.bin").exists());
    assert_eq!(ctl(&site, "full", &["stop", "--wait"]).0, Some(0));
    assert_eq!(run.end().status.code(), Some(130));
}

#[test]
fn a_paused_run_hears_signals_and_a_dead_one_takes_no_requests() {
    let site = Site::new();
    let mut run = start(&site, "one", &[]);
    run.await_rows(&site.path("one/history.csv"), 2);
    assert_eq!(ctl(&site, "one", &["pause", "--wait"]).0, Some(0));
    signal(run.pid(), Signal::INT);
    assert_eq!(run.end().status.code(), Some(130));
    let (code, _, said) = ctl(&site, "one", &["resume"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("no run writes to") && said.contains("grainspan status"), "{said}");
    assert_eq!(ctl(&site, "none", &["stop"]).0, Some(2));
}

/// The request waited for the end of a step, and there was none without workers.
#[test]
fn a_run_that_waits_for_workers_can_be_stopped() {
    let site = Site::new();
    let name = format!("idle{}", std::process::id());
    let out = site.path("waiting");
    let words = ["run", "scenes/biaxial-small.toml", "--attach", &name, "--out", out.to_str().unwrap()];
    let run = site.start("waiting", &words);
    eventually("a run that can be asked", || (ctl(&site, "waiting", &["stop"]).0 == Some(0)).then_some(()));
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(130), "{}", ended.stderr);
    assert!(ended.stderr.contains("before the first step"), "{}", ended.stderr);
    assert!(!site.path("waiting/control/stop").exists());
}
