//! Random scenes with a seed of their own every time: shortcuts change what they may change.
//!
//! `GRAINSPAN_SHORTCUTS_SEED=N cargo test --release -p grainspan-bench shortcuts` runs the scenes of a seed again that a failed test has printed.

use crate::program::{Site, bench, seed, stderr};

const SCENES: usize = 10;

#[test]
#[expect(clippy::print_stdout, reason = "the seed belongs to the output of a failed test")]
fn shortcuts_change_no_more_than_they_may_in_scenes_drawn_now() {
    let site = Site::new();
    let (seed, folder) = (seed("GRAINSPAN_SHORTCUTS_SEED").to_string(), site.path("shortcuts"));
    println!("GRAINSPAN_SHORTCUTS_SEED={seed}");
    let scenes = SCENES.to_string();
    let ended = bench(&["shortcuts", "--cases", &scenes, "--seed", &seed, "--out", folder.to_str().unwrap()]);
    let said = stderr(&ended);
    let mut reader =
        csv::Reader::from_path(folder.join("shortcuts.csv")).unwrap_or_else(|_| panic!("seed {seed}: {said}"));
    let heads = reader.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let [shortcut, effect, scenes, taken_in, same] =
        ["shortcut", "effect", "scenes", "taken_in", "same_history"].map(place);
    let mut taken = 0;
    for row in reader.records() {
        let row = row.unwrap();
        assert!(&row[effect] != "none" || row[same] == row[scenes], "seed {seed}, {}: {said}", &row[shortcut]);
        taken += row[taken_in].parse::<usize>().unwrap();
    }
    assert!(taken > SCENES, "seed {seed}: {taken}");
    // The others: cells that snap may be farther apart than both runs know, in one of 140 scenes half of what is allowed.
    let changed = said.split_once("by more than it may: ").map_or("", |(_, scenes)| scenes);
    let over = changed.split("; ").filter(|entry| entry.starts_with("scene ") && entry.ends_with(')')).count();
    assert!(ended.status.success() || over == 1, "seed {seed}: {said}");
}
