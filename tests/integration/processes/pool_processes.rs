//! Runs of the real program on real worker processes: the number of workers changes nothing, runs do not see each
//! other, and nothing is left behind.

use crate::harness::{Site, eventually, lives};

#[test]
fn one_two_and_four_workers_write_the_same_history() {
    let site = Site::new();
    for workers in ["1", "2", "4"] {
        let ended = site.start_run(workers, workers, 4).end();
        assert!(ended.status.success(), "{}", ended.stderr);
        assert_eq!(site.summary(workers, "worker_restarts"), 0);
    }
    let history = site.history("1");
    assert_eq!(history.lines().count(), 6, "{history}");
    assert_eq!(site.history("2"), history);
    assert_eq!(site.history("4"), history);
}

#[test]
fn two_runs_at_the_same_time_do_not_see_each_other() {
    let site = Site::new();
    let (first, second) = (site.start_run("a", "2", 6), site.start_run("b", "1", 4));
    let (first, second) = (first.end(), second.end());
    assert!(first.status.success() && second.status.success(), "{} {}", first.stderr, second.stderr);
    let alone = site.start_run("c", "1", 4).end();
    assert!(alone.status.success());
    assert_eq!(site.history("b"), site.history("c"));
    assert_ne!(site.history("a"), site.history("b"));
}

#[test]
fn a_live_run_is_shown_with_its_workers_and_gone_when_it_ends() {
    let site = Site::new();
    let mut run = site.start_run("a", "2", 100);
    let traces = site.traces("a");
    let workers = run.await_workers(2);
    let shown = eventually("workers in the status", || {
        Some(site.status()).filter(|text| workers.iter().all(|pid| text.contains(&format!("worker    {pid}"))))
    });
    assert!(shown.contains(&traces.run) && shown.contains("biaxial-small.toml"), "{shown}");
    assert!(!traces.left().is_empty(), "a live run has its channels somewhere");
    crate::harness::signal(run.pid(), rustix::process::Signal::INT);
    assert_eq!(run.end().status.code(), Some(130));
    assert!(!site.status().contains(&traces.run));
    assert_eq!(traces.left(), Vec::<std::path::PathBuf>::new());
    assert!(workers.into_iter().all(|pid| !lives(pid)));
}

/// Workers started by somebody else serve a run that started none.
#[test]
fn an_attached_run_is_served_by_workers_that_join() {
    let site = Site::new();
    let out = site.path("attached");
    let name = format!("t{}-attach", std::process::id());
    let increments = ["--set", "loading.increments=4"];
    let arguments = ["run", "scenes/biaxial-small.toml", "--attach", &name, "--out", out.to_str().unwrap()];
    // The order does not matter: the first worker is there before the run.
    let first = site.start("first", &["rve-server", "--run", &name, "--patience", "20"]);
    let run = site.start("attached", &[&arguments[..], &increments].concat());
    let second = site.start("second", &["rve-server", "--run", &name, "--patience", "20"]);
    let ended = run.end();
    assert!(ended.status.success(), "{}", ended.stderr);
    for worker in [first, second] {
        let ended = worker.end();
        // The second may have come after the end of so short a run.
        assert!(ended.status.success() || ended.stderr.contains(&name), "{}", ended.stderr);
    }
    assert!(site.start_run("own", "1", 4).end().status.success());
    assert_eq!(site.history("attached"), site.history("own"));
}

#[test]
fn a_worker_without_a_run_says_so() {
    let site = Site::new();
    let ended = site.start("worker", &["rve-server", "--run", "no-such-run"]).end();
    assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("no-such-run"), "{}", ended.stderr);
    let ended = site.start("worker", &["rve-server", "--run", "no-such-run", "--engine", "marbles"]).end();
    assert_eq!(ended.status.code(), Some(2));
    assert!(ended.stderr.contains("marbles") && ended.stderr.contains("grains"), "{}", ended.stderr);
}
