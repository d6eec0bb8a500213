//! Commands without workers of their own that a person stops: what is done so far is written, and can be gone on from.

use crate::harness::{Site, Watched, children_of, eventually, lives, signal};
use claims::Claim;
use rustix::process::Signal;
use std::fs;
use std::path::Path;

/// An input file about the small packing of discs.
fn input(site: &Site, name: &str, text: &str) -> String {
    let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let contact = "[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\n";
    let path = site.path(name);
    fs::write(&path, format!("packing = {packing:?}\n{}", text.replace("CONTACT\n", contact))).unwrap();
    path.to_str().unwrap().to_owned()
}

fn interrupted(run: Watched, parts: &[&str]) {
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(130), "{}", ended.stderr);
    for part in parts {
        assert!(ended.stderr.contains(part), "{part}: {}", ended.stderr);
    }
}

#[test]
fn rows_of_an_element_test_up_to_a_stop_are_written() {
    let site = Site::new();
    let test = input(
        &site,
        "test.toml",
        "CONTACT\n[[path]]\nincrements = 20000\nstrain = { yy = -0.02 }\nstress = { xx = -1e5 }\n",
    );
    let out = site.path("rows.csv");
    let set = ["--contacts-at", "3", "--contacts"];
    let pictures = site.path("pictures");
    let words = ["element", &test, "--out", out.to_str().unwrap()];
    let run = site.start("element", &[&words[..], &set, &[pictures.to_str().unwrap()]].concat());
    eventually("the third increment", || pictures.join("increment-0003-contacts.csv").exists().then_some(()));
    interrupted(run, &["a stop was requested", "interrupted after row", "are written"]);
    let rows = fs::read_to_string(&out).unwrap();
    assert!(rows.lines().count() > 4 && rows.lines().count() < 20_000 && rows.ends_with('\n'));
}

/// A-10 for a stop in good order: no checkpoint is due, yet the run goes on from where it was stopped, to the same bytes.
#[test]
fn a_specimen_that_was_stopped_goes_on_from_there() {
    let site = Site::new();
    let test = input(
        &site,
        "layer.toml",
        "tiles = [1, 2]\nperiodic = [\"x\"]\nCONTACT\n[walls]\nglue_depth = 1e-4\nservo_gain = 0.2\n\
         [[stage]]\nname = \"press\"\nsteps = 3000\nrows = 1\nstress = { yy = -1e5 }\n\
         [[stage]]\nname = \"shear\"\nsteps = 240000\nrows = 20\nglue = [\"y\"]\nshear = { xy = 0.02 }\nstress = { yy = -1e5 }\n",
    );
    let (whole, parts, kept) = (site.path("whole.csv"), site.path("parts.csv"), site.path("kept"));
    let begin = |name: &str, out: &Path, more: &[&str]| {
        let words = ["specimen", &test, "--threads", "1", "--out", out.to_str().unwrap()];
        site.start(name, &[&words[..], more].concat())
    };
    let ended = begin("whole", &whole, &[]).end();
    assert!(ended.status.success(), "{}", ended.stderr);
    let pictures = site.path("grains");
    let more = ["--checkpoint", kept.to_str().unwrap(), "--checkpoint-every", "1000000000"];
    let more = [&more[..], &["--pictures", pictures.to_str().unwrap()]].concat();
    let run = begin("parts", &parts, &more);
    eventually("a picture", || pictures.join("grains-0001.vtp").exists().then_some(()));
    interrupted(run, &["interrupted after step", "--resume goes on from here"]);
    let (all, some) = (fs::read_to_string(&whole).unwrap(), fs::read_to_string(&parts).unwrap());
    assert!(all.starts_with(&some) && some.lines().count() > 2 && some.len() < all.len(), "{some}");
    let ended = begin("parts", &parts, &[&more[..], &["--resume"]].concat()).end();
    assert!(ended.status.success() && !ended.stderr.contains("no checkpoint"), "{}", ended.stderr);
    Claim::of("A-10", "table of a specimen that is interrupted and resumed, against an undisturbed one")
        .holds(fs::read_to_string(&parts).unwrap() == all);
}

/// The run of a figure ends with the command that has started it, and the command goes on from there.
#[test]
fn a_figure_that_was_stopped_leaves_no_run_behind() {
    let site = Site::new();
    let out = site.path("figure");
    let words = ["reproduce", "liu2018-meshes", "--workers", "1", "--out", out.to_str().unwrap()];
    let run = site.start("figure", &words);
    let child = eventually("a run of the figure", || {
        let folders = fs::read_dir(out.join("runs")).ok()?.flatten().map(|entry| entry.path());
        folders.filter(|path| path.join("history.csv").exists()).max()?;
        children_of(run.pid()).first().copied()
    });
    interrupted(run, &["the same command goes on from there"]);
    eventually("the end of the run", || (!lives(child)).then_some(()));
    let mut again = site.start("figure", &words);
    eventually("a run again", || {
        assert!(again.runs(), "{}", again.said());
        // One that found its folder taken would be gone at once.
        let child = *children_of(again.pid()).first()?;
        std::thread::sleep(std::time::Duration::from_millis(300));
        lives(child).then_some(())
    });
    assert!(!again.said().contains("another run writes"), "{}", again.said());
    interrupted(again, &[]);
}
