//! Random scenes with a seed of their own every time: shortcuts change what they may change.
//!
//! `GRAINSPAN_SHORTCUTS_SEED=N cargo test --release -p grainspan-bench shortcuts` runs the scenes of a seed again that a failed test has printed.

use crate::program::{Site, bench, stderr};
use std::time::{SystemTime, UNIX_EPOCH};

fn seed() -> u64 {
    match std::env::var("GRAINSPAN_SHORTCUTS_SEED") {
        Ok(given) => given.parse().expect("GRAINSPAN_SHORTCUTS_SEED is a whole number"),
        Err(_) => SystemTime::now().duration_since(UNIX_EPOCH).map_or(1, |since| since.as_secs()),
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "the seed belongs to the output of a failed test")]
fn shortcuts_change_no_more_than_they_may_in_scenes_drawn_now() {
    let site = Site::new();
    let (seed, folder) = (seed().to_string(), site.path("shortcuts"));
    println!("GRAINSPAN_SHORTCUTS_SEED={seed}");
    let ended = bench(&["shortcuts", "--cases", "10", "--seed", &seed, "--out", folder.to_str().unwrap()]);
    assert!(ended.status.success(), "seed {seed}: {}", stderr(&ended));
    let mut reader = csv::Reader::from_path(folder.join("scenes.csv")).unwrap();
    let heads = reader.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let [shortcut, taken] = ["shortcut", "taken"].map(place);
    let mut scenes = 0;
    let mut taken_in = 0;
    for row in reader.records() {
        let row = row.unwrap();
        if &row[shortcut] == "zero_increments" {
            scenes += 1;
            taken_in += usize::from(&row[taken] != "0");
        }
    }
    assert_eq!(scenes, 10);
    assert!(taken_in > 0, "seed {seed}: no scene begins with an increment of zero");
}
