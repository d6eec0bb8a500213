//! `grainspan study`: tables and pictures of an ensemble of tiny packings, the same bytes for any number of jobs; failed samples.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Twelve packings of 20 to 40 discs to 0.2 %.
const TINY: [&str; 6] = [
    "seeds=4",
    "grains=[20, 40, 80]",
    "test.0.set=[\"rve.accuracy=draft\", \"path=[{ increments = 4, strain = { xx = 0.0, yy = -2e-3 } }]\"]",
    "quantity.1.from=0.001",
    "expected.0.grains=80",
    "expected=[{ entry = \"X-1\", quantity = \"void_ratio\", statistic = \"power\", value = -0.5 }]",
];

fn study(out: &Path, more: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_grainspan"));
    program
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["study", "scenes/studies/cell-size.toml", "--out"])
        .arg(out);
    program.args(TINY.iter().flat_map(|setting| ["--set", setting])).args(more);
    program.output().expect("the binary starts")
}

/// Tables and pictures by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .filter(|path| path.extension().is_some_and(|ending| ending == "csv" || ending == "svg"))
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap()))
        .collect()
}

#[test]
fn a_study_writes_the_same_tables_and_pictures_for_any_number_of_jobs() {
    let place = tempfile::tempdir().unwrap();
    let (one, two) = (place.path().join("one"), place.path().join("two"));
    let first = study(&one, &["--jobs", "1"]);
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let second = study(&two, &["--jobs", "3", "--quiet"]);
    assert_eq!(first.stdout, second.stdout);
    assert!(second.stderr.is_empty());
    let written = files(&one);
    assert_eq!(written, files(&two));
    let names: Vec<&str> = written.keys().map(String::as_str).collect();
    for name in [
        "cell-size.csv",
        "cell-size-powers.csv",
        "cell-size-samples.csv",
        "cell-size-statistics.csv",
        "cell-size-curves.csv",
        "cell-size-scatter.svg",
    ] {
        assert!(names.contains(&name), "{name} is missing in {names:?}");
    }
    let text = |name: &str| String::from_utf8(written[name].clone()).unwrap();
    assert_eq!(text("cell-size-samples.csv").lines().count(), 1 + 12);
    assert!(text("cell-size.csv").starts_with("quantity,unit,theirs,source,ours,difference,tolerance,met\n"));
    let json = fs::read_to_string(one.join("cell-size.json")).unwrap();
    assert!(json.contains("\"X-1\"") && json.contains("\"failed_samples\": 0"), "{json}");
}

/// What the study before has written and this one does not goes; another study whose name begins alike stays, and so do other files.
#[test]
fn a_study_takes_away_what_the_one_before_has_left_and_nothing_else() {
    let place = tempfile::tempdir().unwrap();
    assert!(study(place.path(), &["--quiet", "--set", "seeds=2"]).status.success());
    let others = ["cell-size-of-others-scatter.svg", "cell-size-notes.svg", "cell-size-2-powers.csv"];
    others.iter().for_each(|name| fs::write(place.path().join(name), "mine").unwrap());
    assert!(
        place.path().join("cell-size-powers.csv").exists() && place.path().join("cell-size-scatter.svg").exists()
    );
    let one_size = ["--quiet", "--set", "seeds=2", "--set", "grains=[40]", "--set", "expected=[]"];
    let output = study(place.path(), &one_size);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(
        !place.path().join("cell-size-powers.csv").exists() && !place.path().join("cell-size-scatter.svg").exists()
    );
    assert!(others.iter().all(|name| fs::read_to_string(place.path().join(name)).unwrap() == "mine"));
}

#[test]
fn failed_samples_end_a_study_with_exit_code_1_and_all_tables() {
    let place = tempfile::tempdir().unwrap();
    // Between two rows.
    let window = ["--set", "quantity.1.from=0.0011", "--set", "quantity.1.to=0.0012"];
    let output = study(place.path(), &[&["--quiet", "--set", "seeds=1"][..], &window].concat());
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("3 of 3 samples") && said.contains("dense, 20 grains, seed 1, biaxial"), "{said}");
    assert!(said.contains("no value of late_stress_ratio"), "{said}");
    let json = fs::read_to_string(place.path().join("cell-size.json")).unwrap();
    assert!(json.contains("\"failed_samples\": 3"), "{json}");
}

#[test]
fn a_study_that_is_not_sound_is_refused_before_anything_is_made() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    for (setting, remedy) in [
        ("grains=[40, 20]", "do not ascend"),
        ("recipe.0.file=no-such-recipe.toml", "no-such-recipe.toml"),
        ("quantity.0.measure=strength", "stress_ratio"),
        ("quantity.1.from=0.5", "beyond the path of test 'biaxial', whose strains are 0.0000 to 0.0020"),
        ("quantity.1.name=seed", "a column of NAME-samples.csv"),
    ] {
        let output = study(&out, &["--set", setting]);
        assert_eq!(output.status.code(), Some(2), "{setting}");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains(remedy), "{setting}: {said}");
        assert!(!out.exists(), "{setting}");
    }
}
