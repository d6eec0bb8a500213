//! Runs that stop and are continued: what is refused, what is told, and that a full disk costs no checkpoint.

use crate::harness::short_scenes::{SHORT_SCENES, ShortScene};
use crate::harness::{Ended, Site, eventually, signal};
use rustix::process::Signal;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs the small scene into the folder `name`, to its end.
fn run(site: &Site, name: &str, more: &[&str]) -> Ended {
    let out = site.path(name);
    let words = ["run", "scenes/biaxial-small.toml", "--workers", "2", "--out", out.to_str().unwrap()];
    let size = ["--set", "mesh.elements=[1, 2]", "--set", "loading.increments=40"];
    site.start(name, &[&words[..], &size, more].concat()).end()
}

/// The same, interrupted after a few steps.
fn interrupted(site: &Site, name: &str, more: &[&str]) -> Ended {
    let out = site.path(name);
    let words = ["run", "scenes/biaxial-small.toml", "--workers", "2", "--out", out.to_str().unwrap()];
    let size = ["--set", "mesh.elements=[1, 2]", "--set", "loading.increments=40"];
    let mut run = site.start(name, &[&words[..], &size, more].concat());
    run.await_rows(&out.join("history.csv"), 4);
    signal(run.pid(), Signal::INT);
    run.end()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn an_interrupted_run_continues_to_the_same_bytes_and_says_what_it_cost() {
    let site = Site::new();
    assert!(run(&site, "whole", &[]).status.success());
    assert_eq!(interrupted(&site, "parts", &[]).status.code(), Some(130));
    let rows = site.history("parts").lines().count();
    let ended = run(&site, "parts", &["--resume"]);
    assert!(ended.status.success(), "{}", ended.stderr);
    assert!(ended.stderr.contains(&format!("continuing after step {}", rows - 2)), "{}", ended.stderr);
    assert_eq!(site.history("parts"), site.history("whole"));
    for file in ["fields.pvd", "fields/step-0040.vtu", "grains/point-0000.pvd", "history.svg"] {
        let read = |name: &str| fs::read(site.path(name).join(file)).unwrap();
        assert_eq!(read("parts"), read("whole"), "{file}");
    }
    let (parts, whole) = (json(&site.path("parts/summary.json")), json(&site.path("whole/summary.json")));
    for key in ["steps", "newton_iterations", "rve_evaluations", "skipped", "energy", "cutbacks", "fallbacks"] {
        assert_eq!(parts[key], whole[key], "{key}");
    }
    assert_eq!(
        (parts["checkpoint"]["resumed"].as_u64(), whole["checkpoint"]["resumed"].as_u64()),
        (Some(1), Some(0))
    );
    assert!(parts["checkpoint"]["bytes"].as_u64().unwrap() > 1000);
    assert!(!site.path("parts/checkpoint.bin").exists(), "a complete run needs none");
    let again = run(&site, "parts", &["--resume"]);
    assert!(again.status.success() && again.stderr.contains("is complete"), "{}", again.stderr);
    // Whether a run with a damaged summary is complete is not known: a run from the beginning would remove its results.
    fs::write(site.path("parts/summary.json"), "{\"status\":").unwrap();
    let refused = run(&site, "parts", &["--resume"]);
    assert_eq!(refused.status.code(), Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("summary.json cannot be read"), "{}", refused.stderr);
    assert_eq!(site.history("parts"), site.history("whole"), "nothing is touched");
}

/// Every procedure, every link, several stages: a run that is killed once it has kept its first step, and again later, ends in the
/// same bytes.
#[test]
fn every_kind_of_scene_goes_on_to_the_same_bytes() {
    // A run this short mostly waits for its worker to start.
    std::thread::scope(|scope| {
        for scenes in SHORT_SCENES.chunks(SHORT_SCENES.len().div_ceil(4)) {
            scope.spawn(move || scenes.iter().for_each(|&scene| assert_goes_on(scene)));
        }
    });
}

fn assert_goes_on(scene: ShortScene) {
    let site = Site::new();
    let file = format!("scenes/{}.toml", scene.file);
    let start = |out: &str, more: &[&str]| {
        let folder = site.path(out);
        let words = ["run", &file, "--workers", "1", "--out", folder.to_str().unwrap()];
        let set: Vec<&str> = scene.set.iter().flat_map(|&set| ["--set", set]).collect();
        site.start(out, &[&words[..], &set, more].concat())
    };
    let whole = start("whole", &[]).end();
    assert!(whole.status.success(), "{}: {}", scene.name, whole.stderr);
    let rows = site.history("whole").lines().count();
    let mut parts = start("parts", &["--set", "checkpoint.steps=1"]);
    eventually("first checkpoint", || site.path("parts/checkpoint.bin").exists().then_some(()));
    signal(parts.pid(), Signal::KILL);
    let killed = parts.end();
    assert!(!killed.status.success(), "{}: the run is too short to be killed", scene.name);
    for wanted in [rows / 2, rows - 2] {
        parts = start("parts", &["--resume", "--set", "checkpoint.steps=1"]);
        let history = site.path("parts/history.csv");
        eventually("rows", || {
            // On a busy machine the run before may have come that far already.
            let there = fs::read_to_string(&history).map_or(0, |text| text.lines().count());
            let goes_on = there > wanted && parts.said().contains("continuing after step");
            (goes_on || !parts.runs()).then_some(())
        });
        signal(parts.pid(), Signal::KILL);
        let ended = parts.end();
        assert!(
            ended.stderr.contains("continuing after step") || ended.stderr.contains("is complete"),
            "{}",
            ended.stderr
        );
    }
    let ended = start("parts", &["--resume"]).end();
    assert!(ended.status.success(), "{}: {}", scene.name, ended.stderr);
    assert!(site.history("parts") == site.history("whole"), "{}: the histories differ", scene.name);
    for table in ["profiles/rows.csv", "points/point-0002.csv"] {
        let read = |name: &str| fs::read(site.path(name).join(table)).ok();
        assert!(read("parts") == read("whole"), "{}: {table} differs", scene.name);
        assert_eq!(read("whole").is_some(), scene.name == "two-stages", "{}: {table}", scene.name);
    }
}

#[test]
fn a_changed_scene_is_refused_with_the_keys_that_changed() {
    let site = Site::new();
    interrupted(&site, "a", &[]);
    let more = ["--resume", "--set", "solver.force_tolerance=5e-4", "--set", "contact.friction=0.4"];
    let ended = run(&site, "a", &more);
    assert_eq!(ended.status.code(), Some(2));
    assert!(ended.stderr.contains("solver.force_tolerance"), "{}", ended.stderr);
    assert!(ended.stderr.contains("contact.friction was 0.5 and is 0.4"), "{}", ended.stderr);
    assert!(!ended.stderr.contains("loading"), "{}", ended.stderr);
    let harmless =
        ["--resume", "--set", "checkpoint.steps=3", "--set", "pool.worker_timeout=50", "--set", "output.plot=false"];
    assert!(run(&site, "a", &harmless).status.success());
}

#[test]
fn a_damaged_checkpoint_gives_way_to_the_one_before_and_two_are_refused() {
    let site = Site::new();
    assert!(run(&site, "whole", &[]).status.success());
    interrupted(&site, "a", &["--set", "checkpoint.steps=1"]);
    let current = site.path("a/checkpoint.bin");
    let mut bytes = fs::read(&current).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&current, &bytes).unwrap();
    // A history that a power cut has spoilt is written anew.
    fs::write(site.path("a/history.csv"), b"step,ti").unwrap();
    let ended = run(&site, "a", &["--resume"]);
    assert!(ended.status.success(), "{}", ended.stderr);
    assert!(ended.stderr.contains("checksum") && ended.stderr.contains("before it"), "{}", ended.stderr);
    assert_eq!(site.history("a"), site.history("whole"));

    interrupted(&site, "b", &["--set", "checkpoint.steps=1"]);
    for name in ["checkpoint.bin", "checkpoint.previous.bin"] {
        fs::write(site.path("b").join(name), b"nothing").unwrap();
    }
    let before = site.history("b");
    let ended = run(&site, "b", &["--resume"]);
    assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
    assert_eq!(site.history("b"), before, "nothing is touched");
}

#[test]
fn no_checkpoint_means_from_the_start_and_none_are_written_when_switched_off() {
    let site = Site::new();
    assert!(run(&site, "whole", &[]).status.success());
    let stopped = interrupted(&site, "a", &["--set", "checkpoint.enabled=false"]);
    assert!(!stopped.stderr.contains("--resume"), "{}", stopped.stderr);
    assert!(!site.path("a/checkpoint.bin").exists());
    let ended = run(&site, "a", &["--resume"]);
    assert!(ended.status.success() && ended.stderr.contains("starting from the beginning"), "{}", ended.stderr);
    assert_eq!(site.history("a"), site.history("whole"));
}

/// A disk that is full from some moment on: the run ends with one clear error, and what it has can be continued.
#[test]
fn a_full_disk_ends_the_run_and_keeps_the_last_checkpoint() {
    let site = Site::new();
    let script = "mount -t tmpfs -o size=600k none \"$1\" && cd \"$2\" && shift 2 && \"$@\"; code=$?; \
                  cp -r \"$PLACE\" \"$KEPT\"; exit $code";
    let (place, kept) = (site.path("disk"), site.path("kept"));
    fs::create_dir(&place).unwrap();
    let mut mount = Command::new("unshare");
    mount.args(["-rm", "mount", "-t", "tmpfs", "none"]).arg(&place).stderr(Stdio::null());
    let allowed = mount.status().is_ok_and(|status| status.success());
    let out = place.join("out");
    if allowed {
        let output = Command::new("unshare")
            .args(["-rm", "sh", "-c", script, "sh"])
            .args([&place, Path::new(env!("CARGO_MANIFEST_DIR"))])
            .arg(env!("CARGO_BIN_EXE_grainspan"))
            .args(["run", "scenes/biaxial-small.toml", "--workers", "2", "--quiet", "--set", "checkpoint.steps=1"])
            .args(["--set", "mesh.elements=[1, 2]", "--set", "loading.increments=40", "--out"])
            .arg(&out)
            .env("PLACE", &out)
            .env("KEPT", &kept)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains("hint: free some space"), "{text}");
        assert_eq!(text.matches("error:").count(), 1, "{text}");
    } else {
        // Without the right to mount there is no full disk here; that a refused write leaves the last checkpoint alone is
        // then shown by the unit tests of the checkpoint file only.
        interrupted(&site, "kept", &["--set", "checkpoint.steps=1"]);
    }
    assert!(run(&site, "whole", &[]).status.success());
    let ended = run(&site, "kept", &["--resume"]);
    assert!(ended.status.success(), "{}", ended.stderr);
    assert!(ended.stderr.contains("continuing after step"), "{}", ended.stderr);
    assert_eq!(site.history("kept"), site.history("whole"));
}
