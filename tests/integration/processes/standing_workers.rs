//! Workers that outlive their runs.

use crate::harness::{Site, eventually, signal};
use rustix::process::Signal;
use std::fs;
use std::time::{Duration, Instant};

const SCENE: &str = "scenes/biaxial-small.toml";

fn attach(site: &Site, out: &str, run: &str) -> crate::harness::Watched {
    let folder = site.path(out);
    let arguments = [
        "run",
        SCENE,
        "--attach",
        run,
        "--workers",
        "2",
        "--out",
        folder.to_str().unwrap(),
        "--set",
        "loading.increments=3",
    ];
    site.start(out, &arguments)
}

/// Processor time that a process has used, s.
fn processor_time(pid: u32) -> f64 {
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).unwrap().flatten();
    let used = |task: fs::DirEntry| -> f64 {
        let statistics = fs::read_to_string(task.path().join("schedstat")).unwrap_or_default();
        statistics.split_whitespace().next().map_or(0.0, |text| text.parse::<f64>().unwrap() * 1e-9)
    };
    tasks.map(used).sum()
}

#[test]
fn one_pool_serves_two_runs_byte_equal_to_own_workers_and_idles_cheaply() {
    let site = Site::new();
    let own = site.start_run("own", "2", 3).end();
    assert!(own.status.success(), "{}", own.stderr);
    let run = format!("standing{}", std::process::id());
    let start = |name: &str| site.start(name, &["rve-server", "--run", &run, "--standing"]);
    let mut workers = [start("worker-0"), start("worker-1")];
    for out in ["first", "second"] {
        let ended = attach(&site, out, &run).end();
        assert!(ended.status.success(), "{}", ended.stderr);
        assert_eq!(site.history(out), site.history("own"));
    }
    // A run that is killed is survived as well, and the next is served.
    let mut killed = attach(&site, "killed", &run);
    killed.await_rows(&site.path("killed").join("history.csv"), 1);
    signal(killed.pid(), Signal::KILL);
    killed.end();
    let ended = attach(&site, "third", &run).end();
    assert!(ended.status.success(), "{}", ended.stderr);
    assert_eq!(site.history("third"), site.history("own"));

    let (used, begun) = (processor_time(workers[0].pid()), Instant::now());
    std::thread::sleep(Duration::from_millis(1500));
    let share = (processor_time(workers[0].pid()) - used) / begun.elapsed().as_secs_f64();
    assert!(share < 0.01, "an idle worker uses {:.2} % of a core", 100.0 * share);
    for worker in &mut workers {
        assert!(worker.runs(), "{}", worker.said());
        signal(worker.pid(), Signal::TERM);
    }
    for worker in &mut workers {
        eventually("end of a worker that got SIGTERM", || (!worker.runs()).then_some(()));
    }
    eventually("end of what the runs had in memory", || {
        (!fs::exists(format!("/dev/shm/grainspan-{}/{run}", rustix::process::getuid().as_raw())).unwrap())
            .then_some(())
    });
}
