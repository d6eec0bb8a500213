//! What happens to real processes when they are killed, stopped or interrupted.

use crate::harness::{Site, Traces, eventually, lives, signal};
use claims::Claim;
use rustix::process::Signal;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Check A-2: ten workers killed at moments that nobody chose.
#[test]
fn ten_killed_workers_change_no_byte_of_the_history() {
    let site = Site::new();
    let undisturbed = site.start_run("undisturbed", "2", 160).end();
    assert!(undisturbed.status.success(), "{}", undisturbed.stderr);
    let out = site.path("disturbed");
    let scene = ["run", "scenes/biaxial-small.toml", "--workers", "2", "--out", out.to_str().unwrap()];
    // Ten kills within a second may hit one trial three times: quarantine has tests of its own.
    let settings = ["--set", "loading.increments=160", "--set", "pool.quarantine_after=12"];
    let mut run = site.start("disturbed", &[&scene[..], &settings].concat());
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
    Claim::of("A-2", "history of a run of which ten workers are killed, against an undisturbed run")
        .holds(site.history("disturbed") == site.history("undisturbed"));
    assert_eq!(site.summary("undisturbed", "worker_restarts"), 0);
    // The last may die with the run.
    Claim::of("A-2", "workers replaced in a run of which ten workers are killed")
        .number(site.summary("disturbed", "worker_restarts") as f64)
        .at_least(9.0);
    assert!(site.summary("disturbed", "reissued_jobs") >= 1);
}

/// Workers that leak make room for fresh ones: by memory and by count, and nobody can tell from the results.
#[test]
fn workers_that_are_recycled_change_no_byte_of_the_history() {
    let site = Site::new();
    let run = |name: &str, sets: &[&str]| {
        let out = site.path(name);
        let words = ["run", "scenes/biaxial-small.toml", "--workers", "2", "--out", out.to_str().unwrap()];
        // Some seconds: the memory of a worker is looked at twice a second.
        let longer = ["--set", "rve.strain_per_step=4e-8", "--set", "loading.increments=10"];
        let ended = site.start(name, &[&words[..], &longer, sets].concat()).end();
        assert!(ended.status.success(), "{}", ended.stderr);
        let summary = std::fs::read_to_string(site.path(name).join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        assert_eq!((site.summary(name, "worker_restarts"), site.summary(name, "reissued_jobs")), (0, 0));
        summary["fallbacks"]["workers_recycled"].as_u64().unwrap()
    };
    assert_eq!(run("plain", &[]), 0);
    // More than a process needs that has just begun is not needed either: each look finds it too large.
    assert!(run("by-memory", &["--set", "pool.recycle_memory=1"]) >= 1);
    assert!(run("by-count", &["--set", "pool.recycle_jobs=20"]) >= 4);
    assert_eq!(site.history("by-memory"), site.history("plain"));
    assert_eq!(site.history("by-count"), site.history("plain"));
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
    assert!(ended.stderr.contains("interrupted") && ended.stderr.contains("--resume"), "{}", ended.stderr);
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

/// `timeout` and schedulers send a signal to the process and, right after that, to its group.
#[test]
fn a_signal_that_comes_twice_at_once_is_one_request() {
    let site = Site::new();
    let mut run = site.start_run("a", "2", 500);
    run.await_rows(&site.path("a").join("history.csv"), 2);
    signal(run.pid(), Signal::TERM);
    std::thread::sleep(Duration::from_millis(5));
    signal(run.pid(), Signal::TERM);
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(130), "{}", ended.stderr);
    let summary = std::fs::read_to_string(site.path("a").join("summary.json")).unwrap();
    assert!(summary.contains("\"interrupted\""), "{summary}");
}

/// Another build may take the place of the program while a run goes on: its workers are still those of its own build.
#[test]
fn a_run_whose_program_is_replaced_on_the_disk_still_starts_workers() {
    let site = Site::new();
    let (program, out) = (site.path("grainspan"), site.path("a"));
    std::fs::copy(env!("CARGO_BIN_EXE_grainspan"), &program).unwrap();
    let mut run = Command::new(&program)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["run", "scenes/biaxial-small.toml", "--workers", "2", "--set", "loading.increments=60"])
        .args(["--set", "pool.recycle_jobs=40", "--quiet", "--out", out.to_str().unwrap()])
        .spawn()
        .unwrap();
    let history = out.join("history.csv");
    eventually("first rows", || {
        std::fs::read_to_string(&history).is_ok_and(|text| text.lines().count() > 3).then_some(())
    });
    let other = site.path("other");
    std::fs::write(&other, "#!/bin/sh\nexit 1\n").unwrap();
    std::fs::rename(&other, &program).unwrap();
    assert!(run.wait().unwrap().success());
    let summary: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    assert!(summary["fallbacks"]["workers_recycled"].as_u64().unwrap() > 0, "{summary}");
    assert_eq!(site.history("a").lines().count(), 62);
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
    // One that is still to be started would tidy up.
    run.await_workers(2);
    let traces = site.traces("a");
    run.await_rows(&site.path("a").join("history.csv"), 1);
    signal(run.pid(), Signal::STOP);
    run.workers().into_iter().for_each(|worker| signal(worker, Signal::KILL));
    signal(run.pid(), Signal::KILL);
    drop(run);
    assert!(!traces.left().is_empty());
    assert!(site.status().contains(&traces.run), "a dead run is reported");
    // What is not the dead run's: a live run, even a stopped one, and files that only look alike.
    let mut live = site.start_run("live", "1", 500);
    let neighbour = site.traces("live");
    live.await_rows(&site.path("live").join("history.csv"), 1);
    signal(live.pid(), Signal::STOP);
    let before = neighbour.left();
    let stranger = PathBuf::from(format!("/dev/shm/g{:08x}_stranger", std::process::id()));
    std::fs::write(&stranger, b"mine").unwrap();
    assert!(site.program(&["clean"]).status().unwrap().success());
    assert_eq!(traces.left(), Vec::<PathBuf>::new());
    assert_eq!(neighbour.left(), before);
    assert_eq!(std::fs::read(&stranger).unwrap(), b"mine");
    std::fs::remove_file(&stranger).unwrap();
    signal(live.pid(), Signal::CONT);
    signal(live.pid(), Signal::INT);
    assert_eq!(live.end().status.code(), Some(130));
    assert!(!site.status().contains(&traces.run));
}

/// Workers that end before they can do anything, as with a full memory.
#[test]
fn a_run_whose_workers_cannot_live_ends_with_code_three() {
    let site = Site::new();
    let out = site.path("a");
    let words = ["run", "scenes/biaxial-small.toml", "--workers", "1", "--out", out.to_str().unwrap()];
    let sets = ["--set", "loading.increments=500", "--set", "pool.restarts=4", "--set", "pool.quarantine_after=100"];
    let mut run = site.start("a", &[&words[..], &sets].concat());
    run.await_rows(&site.path("a").join("history.csv"), 1);
    while run.runs() {
        std::thread::sleep(Duration::from_millis(2));
        for worker in run.workers() {
            signal(worker, Signal::KILL);
        }
    }
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(3), "{}", ended.stderr);
    assert!(ended.stderr.contains("4 consecutive replacements ended without a completed job"), "{}", ended.stderr);
    assert!(site.history("a").lines().count() >= 2, "accepted steps are kept");
    assert!(site.path("a").join("checkpoint.bin").exists(), "and can be continued from");
}

/// A worker that is stopped in the moment between its birth and its program holds the thread of the run in the kernel: it
/// is ended from another thread, and the run goes on.
#[test]
fn a_worker_stopped_at_its_birth_does_not_hold_the_run() {
    let site = Site::new();
    // The moment is short: tried until it is met.
    for attempt in 0..200 {
        let name = format!("attempt-{attempt}");
        let mut run = site.start_run(&name, "8", 2);
        if run.stop_a_newborn() {
            let ended = run.end();
            assert!(ended.status.success(), "{}", ended.stderr);
            let log = std::fs::read_to_string(site.path(&name).join("run.jsonl")).unwrap();
            assert!(log.contains("stopped while it started"), "{log}");
            assert!(site.summary(&name, "worker_restarts") >= 1);
            return;
        }
    }
    panic!("no worker was met at its birth");
}

/// Nobody is left to tell it, so it must find out by itself.
#[test]
fn a_stopped_worker_does_not_outlive_a_killed_run() {
    let site = Site::new();
    let mut run = site.start_run("a", "1", 500);
    let workers = run.await_workers(1);
    let traces = site.traces("a");
    run.await_rows(&site.path("a").join("history.csv"), 1);
    signal(workers[0], Signal::STOP);
    signal(run.pid(), Signal::KILL);
    drop(run);
    eventually("end of the worker", || (!lives(workers[0])).then_some(()));
    eventually("tidy memory", || traces.left().is_empty().then_some(()));
}

/// A point whose question takes seconds, and a worker that is killed over it three times. Before the third the question rests, and
/// the worker deals with the other point first.
#[test]
fn a_deadly_question_is_set_aside_and_can_be_asked_again() {
    let site = Site::new();
    let out = site.path("a");
    let words = ["run", "scenes/biaxial-small.toml", "--workers", "1", "--out", out.to_str().unwrap()];
    let sets = ["mesh.elements=[1, 1]", "mesh.element=t3", "rve.strain_per_step=1e-9"];
    let sets = sets.map(|set| ["--set", set]).concat();
    let mut run = site.start("a", &[&words[..], &sets].concat());
    run.await_rows(&out.join("history.csv"), 1);
    let (mut killed, mut deadly) = (Vec::new(), None);
    while killed.len() < 3 {
        let (fresh, point) = eventually("a worker at work", || {
            let text = site.status();
            let point_of = |pid: u32| {
                let line = text.lines().find(|line| line.contains(&format!("worker    {pid}")))?;
                let (_, rest) = line.split_once("Gauss point ")?;
                Some(rest.split(' ').next()?.to_owned())
            };
            let workers = run.workers().into_iter().filter(|pid| !killed.contains(pid));
            workers
                .filter_map(|pid| Some((pid, point_of(pid)?)))
                .find(|(_, point)| deadly.as_ref().is_none_or(|deadly| deadly == point))
        });
        std::thread::sleep(Duration::from_millis(600));
        signal(fresh, Signal::KILL);
        killed.push(fresh);
        deadly = Some(point);
    }
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(3), "{}", ended.stderr);
    let named = ended.stderr.contains("has ended 3 workers") && ended.stderr.contains("--replay");
    assert!(named, "{}", ended.stderr);
    let case = out.join("quarantine.replay");
    let output =
        site.program(&["element", "--replay", case.to_str().unwrap()]).stdout(Stdio::piped()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("Gauss point") && text.contains("ended a worker") && text.contains("stress"), "{text}");
    let damaged = site.path("damaged.replay");
    std::fs::write(&damaged, &std::fs::read(&case).unwrap()[..100]).unwrap();
    let ended = site.start("damaged", &["element", "--replay", damaged.to_str().unwrap()]).end();
    assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
}

#[test]
fn workers_may_come_and_go_from_one_to_eight_and_back() {
    let site = Site::new();
    let mut run = site.start_run("scaled", "1", 300);
    let name = site.traces("scaled").run;
    run.await_rows(&site.path("scaled").join("history.csv"), 2);
    let helpers: Vec<_> =
        (0..7).map(|number| site.start(&format!("helper-{number}"), &["rve-server", "--run", &name])).collect();
    let all = eventually("eight workers that have done something", || {
        let text = site.status_of(&name);
        assert!(run.runs(), "the run ended too soon: {text}");
        let jobs = text.matches(" jobs in ").count() - text.matches(", 0 jobs in ").count();
        (jobs == 8).then_some(text)
    });
    assert!(helpers.iter().all(|helper| all.contains(&format!("worker    {}", helper.pid()))), "{all}");
    for (number, helper) in helpers.iter().enumerate() {
        signal(helper.pid(), if number % 2 == 0 { Signal::TERM } else { Signal::KILL });
    }
    // The rest of the path would show nothing new.
    let rows = run.rows(&site.path("scaled").join("history.csv")) + 20;
    run.await_rows(&site.path("scaled").join("history.csv"), rows);
    let mut alone = site.start_run("alone", "1", 300);
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(130), "{}", ended.stderr);
    alone.await_rows(&site.path("alone").join("history.csv"), rows);
    signal(alone.pid(), Signal::INT);
    assert_eq!(alone.end().status.code(), Some(130));
    let (scaled, alone) = (site.history("scaled"), site.history("alone"));
    let common = scaled.lines().zip(alone.lines()).inspect(|(one, other)| assert_eq!(one, other)).count();
    assert!(common >= rows, "{common} of {rows} rows");
}
