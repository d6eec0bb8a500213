//! Mistakes of those who use the program for the first time, and the remedies that it names.

use super::bad_input::InputFolder;
use std::fs;

/// Each sent a first reader the wrong way.
#[test]
fn remedies_of_beginners_mistakes_are_named() {
    let input = InputFolder::new();
    let as_packing = ["check", "scene.toml", "--set", "packing=\"recipe.toml\""];
    input.refused(&as_packing, &["this is a recipe", "grainspan pack recipe.toml --out"]);
    input.refused(&["check", "scene.toml", "--set", "mesh.element=Q8"], &["did you mean \"q8\"?"]);
    for command in ["report", "watch"] {
        input
            .refused(&[command, "nowhere"], &["nowhere: No such file", "give the folder that `grainspan run` names"]);
    }
    let lengths = ["check", "scene.toml", "--set", "mesh.generator=footing"];
    input.refused(&lengths, &["generator = \"footing\" with", "half width of the footing"]);
    input.refused(&["check", "discs-100.json"], &["discs-100.json: this is a JSON file", "packing = "]);
    // Nothing of a run: it would be in the way of the next one.
    fs::create_dir(input.path("run")).unwrap();
    fs::write(input.path("run/run.jsonl"), "").unwrap();
    input.refused(
        &["reproduce", "liu2018-cells", "--out", "run"],
        &["this is the folder of a run", "name another folder"],
    );
    fs::write(input.path("two.toml"), "[boundary]\nset = \"a\"\n[boundary]\nset = \"b\"\n").unwrap();
    input.refused(&["check", "two.toml"], &["two.toml:3: duplicate key", "as in [[boundary]]"]);
    fs::write(input.path("bare.toml"), "number = 30\n[grading]\ndistribution = \"power_law\"\n").unwrap();
    input.refused(&["pack", "bare.toml"], &["missing keys `contact`,"]);
    fs::write(input.path("latin.toml"), b"name = 1\nmesh = '\xe9'").unwrap();
    input.refused(&["check", "latin.toml"], &["latin.toml", "line 2 is not UTF-8", "save the file in UTF-8"]);
    let study = "seeds = 2\ngrains = [50]\n[[recipe]]\nname = \"a\"\nfile = \"recipe.toml\"\n[[test]]\nname = \"b\"\n\
                 file = \"nothing.toml\"\n[[quantity]]\nname = \"c\"\nmeasure = \"stress_ratio\"\ntake = \"largest\"\n";
    fs::write(input.path("study.toml"), study).unwrap();
    input.refused(&["study", "study.toml"], &["study.toml:8: there is no file nothing.toml", "folder of the study"]);
    let misspelt = study.replace("\"recipe.toml\"", "\"recipe.toml\"\nset = [\"numbr=3\"]");
    fs::write(input.path("study.toml"), misspelt).unwrap();
    input.refused(&["study", "study.toml"], &["study.toml:5: --set numbr=3", "did you mean `number`"]);
}

/// The same files with a byte order mark, which some editors write, and a friction that is an angle: taken, the latter with a note.
#[test]
fn marked_files_are_read_and_an_angle_of_friction_is_noted() {
    let input = InputFolder::new();
    for name in ["scene.toml", "discs-100.json"] {
        let text = fs::read_to_string(input.path(name)).unwrap();
        fs::write(input.path(name), format!("\u{feff}{text}")).unwrap();
    }
    let output = input.grainspan(&["check", "scene.toml", "--set", "contact.friction=30"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("the tangent of the angle, not the angle"), "{said}");
}

/// Walls and stages of a specimen have a coefficient of their own, and a sweep hands over values that stand in no file.
#[test]
fn an_angle_of_friction_is_noted_wherever_it_stands() {
    let input = InputFolder::new();
    let path = "packing = \"discs-100.json\"\n[contact]\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
                [[path]]\nincrements = 1\nstrain = { yy = -1e-4, xx = 0.0 }\n";
    fs::write(input.path("path.toml"), path).unwrap();
    let output =
        input.grainspan(&["element", "path.toml", "--sweep", "contact.friction=0.3,30", "--out", "sweep.csv"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        said.matches("--sweep contact.friction=30: contact.friction = 30 is the coefficient").count(),
        1,
        "{said}"
    );
    assert_eq!(said.matches("the tangent of the angle").count(), 1, "{said}");
}
