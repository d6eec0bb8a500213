//! What happens to real processes when they are killed, stopped or interrupted.

mod harness;

use harness::{Site, Traces, eventually, lives, signal};
use rustix::process::Signal;
use std::path::PathBuf;
use std::time::Duration;

/// Check A-2: ten workers killed at moments that nobody chose.
#[test]
fn ten_killed_workers_change_no_byte_of_the_history() {
    let site = Site::new();
    let undisturbed = site.start_run("undisturbed", "2", 40).end();
    assert!(undisturbed.status.success(), "{}", undisturbed.stderr);
    let mut run = site.start_run("disturbed", "2", 40);
    let history = site.path("disturbed").join("history.csv");
    run.await_rows(&history, 1);
    // A small generator: which of the workers, and when, differs from kill to kill.
    let mut draw = 12_345_u32;
    let mut killed = Vec::new();
    for _ in 0..10 {
        let workers = run.await_workers(2);
        draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let victim = workers[(draw >> 24) as usize % workers.len()];
        signal(victim, Signal::KILL);
        killed.push(victim);
        eventually("end of the victim", || (!lives(victim)).then_some(()));
        std::thread::sleep(Duration::from_millis(u64::from(draw >> 26)));
    }
    let ended = run.end();
    assert!(ended.status.success(), "{}", ended.stderr);
    assert_eq!(site.history("disturbed"), site.history("undisturbed"));
    assert_eq!(site.summary("undisturbed", "worker_restarts"), 0);
    assert!(site.summary("disturbed", "worker_restarts") >= 9, "the last may die with the run");
    assert!(site.summary("disturbed", "reissued_jobs") >= 1);
}

/// Interrupts a run after a few steps.
fn interrupt(how: Signal) -> (Site, Traces) {
    let site = Site::new();
    let mut run = site.start_run("a", "2", 500);
    let workers = run.await_workers(2);
    let traces = site.traces("a");
    run.await_rows(&site.path("a").join("history.csv"), 3);
    signal(run.pid(), how);
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(130), "{}", ended.stderr);
    assert!(ended.stderr.contains("interrupted"), "{}", ended.stderr);
    assert!(workers.into_iter().all(|pid| !lives(pid)), "a worker outlived its run");
    (site, traces)
}

#[test]
fn an_interrupted_run_keeps_its_steps_and_leaves_nothing_behind() {
    for how in [Signal::INT, Signal::TERM] {
        let (site, traces) = interrupt(how);
        assert!(site.history("a").lines().count() >= 4);
        let summary = std::fs::read_to_string(site.path("a").join("summary.json")).unwrap();
        assert!(summary.contains("\"interrupted\""), "{summary}");
        assert_eq!(traces.left(), Vec::<PathBuf>::new());
    }
}

#[test]
fn workers_end_with_a_killed_run_and_tidy_up_after_it() {
    let site = Site::new();
    let mut run = site.start_run("a", "2", 500);
    let workers = run.await_workers(2);
    let traces = site.traces("a");
    run.await_rows(&site.path("a").join("history.csv"), 2);
    signal(run.pid(), Signal::KILL);
    drop(run);
    eventually("end of the workers", || workers.iter().all(|pid| !lives(*pid)).then_some(()));
    assert_eq!(traces.left(), Vec::<PathBuf>::new());
}

#[test]
fn what_a_killed_run_and_its_killed_workers_leave_is_reported_and_cleaned() {
    let site = Site::new();
    let mut run = site.start_run("a", "2", 500);
    let traces = site.traces("a");
    run.await_rows(&site.path("a").join("history.csv"), 1);
    signal(run.pid(), Signal::STOP);
    run.workers().into_iter().for_each(|worker| signal(worker, Signal::KILL));
    signal(run.pid(), Signal::KILL);
    drop(run);
    assert!(!traces.left().is_empty());
    assert!(site.status().contains(&traces.run), "a dead run is reported");
    assert!(site.program(&["clean"]).status().unwrap().success());
    assert_eq!(traces.left(), Vec::<PathBuf>::new());
    assert!(!site.status().contains(&traces.run));
}

/// Workers that end whatever they are given, as with a full memory.
#[test]
fn a_run_whose_workers_cannot_live_ends_with_code_three() {
    let site = Site::new();
    let mut run = site.start_run("a", "1", 500);
    run.await_rows(&site.path("a").join("history.csv"), 1);
    while run.runs() {
        // Long enough to join, mostly: those that end before are replaced ever more slowly.
        std::thread::sleep(Duration::from_millis(150));
        for worker in run.workers() {
            signal(worker, Signal::KILL);
        }
    }
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(3), "{}", ended.stderr);
    let text = ended.stderr;
    let reasons = ["replacements were started", "has ended 3 workers", "no worker has joined"];
    assert!(reasons.iter().any(|reason| text.contains(reason)), "{text}");
    assert!(site.history("a").lines().count() >= 2, "accepted steps are kept");
}
