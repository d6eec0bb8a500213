//! Whatever is wrong with an input ends in one error that names the place and the remedy, exit code 2, and nothing on
//! the disk that was not there before.

use crate::harness::commands::grainspan_in;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder with a sound scene, its packing, an element test and a recipe, to be spoiled one thing at a time.
pub(super) struct InputFolder {
    folder: tempfile::TempDir,
}

impl InputFolder {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let scene = fs::read_to_string(root.join("scenes/biaxial-small.toml")).unwrap();
        fs::write(folder.path().join("scene.toml"), scene.replace("../packings/", "")).unwrap();
        fs::copy(root.join("packings/discs-100.json"), folder.path().join("discs-100.json")).unwrap();
        fs::copy(root.join("packings/discs-100.toml"), folder.path().join("recipe.toml")).unwrap();
        let element = "packing = \"discs-100.json\"\n[contact]\nmodulus = 1.0e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
                       [rve]\naccuracy = \"draft\"\n[[path]]\nincrements = 1\nstrain = { yy = -1.0e-5 }\n";
        fs::write(folder.path().join("element.toml"), element).unwrap();
        Self { folder }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Replaces text in one of the files; the text has to be there.
    fn spoil(&self, file: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(file)).unwrap();
        assert!(text.contains(from), "{file} has '{from}'");
        fs::write(self.path(file), text.replacen(from, to, 1)).unwrap();
    }

    pub(super) fn grainspan(&self, arguments: &[&str]) -> Output {
        grainspan_in(self.folder.path(), arguments)
    }

    /// Runs a command that has to be refused: exit code 2, one error with all of `parts`, no new files.
    pub(super) fn refused(&self, arguments: &[&str], parts: &[&str]) {
        let before = listing(self.folder.path());
        let output = self.grainspan(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert_eq!(stderr.matches("error:").count(), 1, "{arguments:?}: {stderr}");
        for part in parts {
            assert!(stderr.contains(part), "{arguments:?}: '{part}' is missing in: {stderr}");
        }
        assert!(output.stdout.is_empty(), "{arguments:?}: data on stdout");
        assert_eq!(listing(self.folder.path()), before, "{arguments:?}: files were written");
    }
}

/// All files below a folder, by name.
fn listing(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(listing(&path));
        }
        found.push(path);
    }
    found.sort();
    found
}

#[test]
fn malformed_toml_is_named_with_its_line() {
    let input = InputFolder::new();
    input.spoil("scene.toml", "elements = [2, 4]", "elements = [2, 4");
    let text = fs::read_to_string(input.path("scene.toml")).unwrap();
    let line = 1 + text.lines().position(|line| line.starts_with("elements")).unwrap();
    // The parser notices the missing bracket on this line or where the next begins.
    let output = input.grainspan(&["run", "scene.toml"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    let named = (line..=line + 1).any(|line| stderr.contains(&format!("scene.toml:{line}: ")));
    assert!(output.status.code() == Some(2) && named, "{stderr}");
    input.refused(&["run", "scene.toml"], &["scene.toml:"]);
}

#[test]
fn an_unknown_key_is_named_with_its_line_and_the_likely_one() {
    let input = InputFolder::new();
    input.spoil("scene.toml", "friction", "frictoin");
    let text = fs::read_to_string(input.path("scene.toml")).unwrap();
    let line = 1 + text.lines().position(|line| line.starts_with("frictoin")).unwrap();
    let place = format!("scene.toml:{line}: unknown key `frictoin`");
    input.refused(&["run", "scene.toml"], &[&place, "hint: did you mean `friction`?"]);
}

#[test]
fn a_wrong_type_is_named_with_its_line() {
    let input = InputFolder::new();
    input.spoil("scene.toml", "increments = 5", "increments = \"five\"");
    input.refused(
        &["run", "scene.toml"],
        &[
            "scene.toml:",
            "loading.increments must be a whole number at least 1, not the text \"five\"",
            "increments = \"five\"",
            "hint:",
        ],
    );
}

#[test]
fn a_missing_scene_or_packing_is_named_with_the_remedy() {
    let input = InputFolder::new();
    input.refused(&["run", "nowhere.toml"], &["nowhere.toml: could not read it", "hint: check the path"]);
    fs::remove_file(input.path("discs-100.json")).unwrap();
    input.refused(&["run", "scene.toml"], &["scene.toml:", "discs-100.json", "hint: make one with `grainspan pack`"]);
    input.refused(&["element", "element.toml"], &["element.toml:1", "discs-100.json", "grainspan pack"]);
}

#[test]
fn an_inverted_element_is_refused() {
    let input = InputFolder::new();
    input.spoil("scene.toml", "size = [0.05, 0.10]", "size = [-0.05, 0.10]");
    input.refused(
        &["run", "scene.toml"],
        &["turns its elements inside out", "size = [-0.05, 0.10]", "positive lengths"],
    );
}

/// A mesh of Gmsh instead of a block: its defects are named by its own line, those of the scene by the scene's.
#[test]
fn a_mesh_file_is_read_and_its_defects_are_named() {
    let input = InputFolder::new();
    let good = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n4\n1 1 \"bottom\"\n1 2 \"right\"\n1 3 \"top\"\n\
                1 4 \"left\"\n$EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 2 0\n4 0 2 0\n$EndNodes\n\
                $Elements\n6\n1 15 2 5 1 1\n2 1 2 1 1 1 2\n3 1 2 2 1 2 3\n4 1 2 3 1 3 4\n5 1 2 4 1 4 1\n\
                6 3 2 6 1 1 2 3 4\n$EndElements\n";
    input.spoil("scene.toml", "size = [0.05, 0.10]", "file = \"square.msh\"");
    fs::write(input.path("square.msh"), good).unwrap();
    input.refused(&["check", "scene.toml"], &["`generator` belongs to a generated mesh", "remove `generator`"]);
    input.spoil("scene.toml", "generator = \"block\"", "");
    input.refused(&["check", "scene.toml"], &["`elements` belongs to a generated mesh", "remove `elements`"]);
    input.spoil("scene.toml", "elements = [2, 4]", "");
    input.refused(&["check", "scene.toml"], &["no node set 'bottom_left'", "group_5"]);
    let text = fs::read_to_string(input.path("scene.toml")).unwrap();
    fs::write(input.path("scene.toml"), text.replace("bottom_left", "bottom")).unwrap();
    let output = input.grainspan(&["check", "scene.toml"]);
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && stdout.contains("1 elements (q4), 4 nodes"), "{stdout}");
    fs::write(input.path("square.msh"), good.replace("6 3 2 6 1 1 2 3 4", "6 3 2 6 1 1 2 3 9")).unwrap();
    input.refused(&["check", "scene.toml"], &["square.msh:25: there is no node 9", "hint:"]);
    fs::write(input.path("square.msh"), good.replace("6 3 2 6 1 1 2 3 4", "6 3 2 6 1 4 3 2 1")).unwrap();
    input.refused(&["check", "scene.toml"], &["element 6 is inverted", "correct the mesh in Gmsh"]);
}

#[test]
fn a_condition_on_a_set_that_does_not_exist_lists_those_that_do() {
    let input = InputFolder::new();
    input.refused(
        &["run", "scene.toml", "--set", "pressure.1.set=north"],
        &[
            "--set pressure.1.set=north: the mesh has no side set 'north'",
            "hint: use one of: bottom, left, right, top",
        ],
    );
    input.spoil("scene.toml", "set = \"bottom_left\"", "set = \"corner\"");
    input.refused(&["run", "scene.toml"], &["scene.toml:", "no node set 'corner'", "bottom_left"]);
}

#[test]
fn numbers_that_are_not_finite_are_refused_in_every_file() {
    let input = InputFolder::new();
    input.spoil("scene.toml", "value = 1.0e5", "value = nan");
    input.refused(&["run", "scene.toml"], &["scene.toml:", "`value` is nan", "finite"]);
    input.refused(&["element", "element.toml", "--set", "path.0.strain.yy=inf"], &["`yy` is inf"]);
    input.refused(&["pack", "recipe.toml", "--set", "pressure=-inf"], &["`pressure` is -inf"]);
}

#[test]
fn zero_workers_are_refused() {
    let input = InputFolder::new();
    input.refused(&["run", "scene.toml", "--workers", "0"], &["--workers 0", "at least one worker"]);
}

/// Thousands of processes would leave no room even for the command that ends them.
#[test]
fn more_workers_than_any_machine_can_use_are_refused_before_anything_starts() {
    let input = InputFolder::new();
    input.refused(&["run", "scene.toml", "--workers", "100000"], &["--workers 100000", "pool.most_workers=100000"]);
    input.refused(&["run", "scene.toml", "--workers", "2", "--set", "pool.most_workers=1"], &["more than 1"]);
    input.refused(&["run", "scene.toml", "--set", "pool.most_workers=0"], &["must be at least 1, not 0"]);
}

/// The command that takes the file is named, in place of a list of keys.
#[test]
fn a_file_of_another_command_is_recognised() {
    let input = InputFolder::new();
    input.refused(
        &["check", "element.toml"],
        &["this is an element test, not a scene", "hint: grainspan element element.toml"],
    );
    input.refused(&["run", "recipe.toml"], &["this is a packing recipe", "grainspan pack recipe.toml"]);
    input.refused(&["pack", "scene.toml"], &["this is a scene, not a packing recipe", "grainspan run scene.toml"]);
    input.refused(&["element", "scene.toml"], &["this is a scene, not an element test"]);
    input.refused(
        &["pack", "recipe.toml", "--set", "presure=1"],
        &["unknown key `presure`", "did you mean `pressure`?"],
    );
}

/// Whoever types a zero too many waits for no mesh of billions.
#[test]
fn absurd_meshes_are_refused_before_they_are_built() {
    let input = InputFolder::new();
    let said = ["elements", "1.0e10 elements", "TB of memory"];
    input.refused(&["check", "scene.toml", "--set", "mesh.elements=[100000, 100000]"], &said);
    let slope =
        ["check", "scene.toml", "--set", "mesh={generator='slope',size=[1,1,1,1],elements=[9000,1,9000,1],run=0.5}"];
    input.refused(&slope, &["TB of memory"]);
}

#[test]
fn a_device_is_no_packing() {
    let input = InputFolder::new();
    input.refused(&["check", "scene.toml", "--set", "packing='/dev/zero'"], &["/dev/zero", "a device, not a file"]);
}

#[test]
fn keys_of_relaxation_and_dynamics_are_named_where_they_stand() {
    let input = InputFolder::new();
    for (setting, procedure) in [
        ("relaxation.max_iterations=0", "procedure=relaxation"),
        ("relaxation.safety=2", "procedure=relaxation"),
        ("dynamics.safety=2", "procedure=dynamic"),
    ] {
        if procedure == "procedure=dynamic" {
            // Keys of load steps say nothing there.
            input.spoil("scene.toml", "increments = 5", "duration = 1e-3");
        }
        let more = ["check", "scene.toml", "--set", procedure, "--set", setting];
        input.refused(&more, &[&format!("--set {setting}: "), "must be"]);
    }
}

#[test]
fn two_sets_that_share_a_node_are_named_with_its_place() {
    let input = InputFolder::new();
    let more = "boundary.1={ set = 'left', displacement = { y = 1e-3 } }";
    let said = [
        "--set boundary.1={",
        "(0.0000, 0.0000, 0.0000) m",
        "'left'",
        "hint: a node follows one condition along each axis",
    ];
    input.refused(&["check", "scene.toml", "--set", more], &said);
}

/// What only the solver finds wrong with a condition had no place.
#[test]
fn conditions_that_do_not_fit_are_named_where_they_stand() {
    let input = InputFolder::new();
    let text = fs::read_to_string(input.path("scene.toml")).unwrap();
    let first = text.lines().count() + 1;
    for (tables, line, words) in [
        (
            "[[friction]]\nset = \"all\"\nfactor = 0.9\n[[friction]]\nname = \"b\"\nset = \"all\"\nfactor = 0.5\n",
            5,
            "is given twice",
        ),
        ("[[periodic]]\nfrom = \"left\"\nto = \"top\"\n", 1, "has no partner"),
        ("[[traction]]\nset = \"top\"\nvalue = { z = 1.0 }\n", 1, "no direction z"),
        ("[[radial_displacement]]\nset = \"bottom_left\"\ndisplacement = 1e-3\n", 1, "has no direction along which"),
        (
            "[[stage]]\nname = \"a\"\n[[stage]]\nname = \"b\"\n[[stage.boundary]]\nset = \"left\"\ndisplacement = { y = 1e-3 }\n",
            5,
            "two different displacements",
        ),
    ] {
        fs::write(input.path("scene.toml"), format!("{text}{tables}")).unwrap();
        input.refused(&["check", "scene.toml"], &[&format!("scene.toml:{}: ", first + line), words]);
    }
    fs::write(input.path("scene.toml"), &text).unwrap();
    let arc = "loading.control={ arc_length = { first_load = 0.1, set = 'top', component = 'z' } }";
    input.refused(&["check", "scene.toml", "--set", arc], &["--set loading.control", "no direction z"]);
}

/// Its deadline was past the end of the clock, and the worker panicked.
#[test]
fn a_wait_without_end_is_refused() {
    let input = InputFolder::new();
    let most = u64::MAX.to_string();
    input.refused(&["rve-server", "--run", "nowhere", "--timeout", &most], &["--timeout", "2678400"]);
}

#[test]
fn a_binary_mesh_and_one_without_groups_are_told_what_they_lack() {
    let input = InputFolder::new();
    input.spoil("scene.toml", "size = [0.05, 0.10]", "file = \"square.msh\"");
    input.spoil("scene.toml", "generator = \"block\"", "");
    input.spoil("scene.toml", "elements = [2, 4]", "");
    fs::write(input.path("square.msh"), b"$MeshFormat\n2.2 1 8\n\x01\x00\x00\x00\xff\xfe\n$EndMeshFormat\n").unwrap();
    input.refused(&["check", "scene.toml"], &["square.msh:2: the file is binary", "-bin 0"]);
    let bare = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 2 0\n4 0 2 0\n$EndNodes\n\
                $Elements\n1\n6 3 2 0 1 1 2 3 4\n$EndElements\n";
    fs::write(input.path("square.msh"), bare).unwrap();
    input.refused(&["check", "scene.toml"], &["no ", " set '", "Physical Curve"]);
}

#[test]
fn names_that_break_line_tools_are_refused() {
    let input = InputFolder::new();
    input.refused(&["check", "scene.toml", "--set", "probe.0.name=\"a\\nb\""], &["control character", "hint:"]);
}

#[test]
fn grains_that_would_be_pressed_flat_are_refused_before_the_first_step() {
    let input = InputFolder::new();
    let said = ["would overlap by about 4.0", "thickness is 1.000e0 m for grains of 5.000e-4 m", "one mean diameter"];
    input.refused(&["pack", "recipe.toml", "--set", "thickness=1.0"], &said);
}

/// Spheres that are soft by Hertz's law were compacted for a while, and then told that their packing was out of balance.
#[test]
fn soft_spheres_are_refused_before_the_first_step() {
    let input = InputFolder::new();
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/spheres-100.toml");
    let words = ["pack", recipe.to_str().unwrap(), "--set", "contact.shear_modulus=29e3", "--set", "number=60"];
    input.refused(&words, &["would overlap by about 6.", "larger contact.shear_modulus"]);
}

#[test]
fn hints_name_what_can_stand_in_place_of_a_wrong_value() {
    let input = InputFolder::new();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/liu2018/grains-frame-biaxial.toml");
    input.refused(
        &["element", scene.to_str().unwrap(), "--set", "frame.control=\"servo\""],
        &["frame.control = \"servo\" is unknown", "one of \"direct\", or a table such as { servo = ... }"],
    );
    let shares = ["grading={distribution='bidisperse',small_radius=2e-4,large_radius=3e-4,large_share=1e-4}"];
    input.refused(&["pack", "recipe.toml", "--set", shares[0]], &["leaves no large grain among", "it is 0.0"]);
}

/// A seed may have all of its 64 bits, on the command line as in a file.
#[test]
fn seeds_may_be_large() {
    let input = InputFolder::new();
    let large = u64::MAX.to_string();
    let output = input.grainspan(&["pack", "recipe.toml", "--set", &format!("seed={large}")]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    input.refused(&["pack", "recipe.toml", "--set", "seed=18446744073709551616"], &["seed must be"]);
}

#[test]
fn a_grain_larger_than_its_cell_is_named() {
    let input = InputFolder::new();
    let mut packing: serde_json::Value =
        serde_json::from_slice(&fs::read(input.path("discs-100.json")).unwrap()).unwrap();
    packing["grains"][17][2] = serde_json::json!(1.0);
    fs::write(input.path("discs-100.json"), packing.to_string()).unwrap();
    input.refused(
        &["run", "scene.toml"],
        &["scene.toml:", "discs-100.json", "grain 17", "larger than the cell", "hint:"],
    );
    input.refused(&["check", "scene.toml"], &["grain 17"]);
}

#[test]
fn a_packing_that_is_not_one_is_named_with_line_and_column() {
    let input = InputFolder::new();
    fs::write(input.path("discs-100.json"), "{ \"format\": \"grainspan-packing\",\n oops").unwrap();
    input.refused(&["run", "scene.toml"], &["discs-100.json", "line 2", "hint:"]);
}

#[test]
fn values_out_of_range_are_named_by_their_key() {
    let input = InputFolder::new();
    for (setting, reason) in [
        ("contact.friction=-0.1", "contact.friction"),
        ("rve.tolerance=0.0", "rve.tolerance"),
        ("loading.increments=0", "increments must be at least 1"),
        ("loading.cut=1.5", "loading.cut must be above 0 and below 1, not 1.5"),
        ("loading.duration=-1", "duration"),
        ("output.grains=[32]", "no Gauss point 32"),
        ("probe.0.name=load", "cannot be named 'load'"),
        ("probe.0.name='q [top]'", "cannot be named 'q [top]'"),
        ("probe.0.component=z", "'z' is not a component"),
        ("probe.1.set=top", "has no meaning for a probe of kind \"stress_ratio\""),
        ("solver.tangent=none", "solver.tangent = \"none\" is unknown"),
        ("name=../escape", "cannot name a folder"),
        (
            "name=a23456789012345678901234567890123456789012345678901234567890123456789012345678901234567890123456789012",
            "too long",
        ),
        ("contact.cohesion=1e-2", "contact.cohesion"),
        ("boundary.0.displacement={x=1.0,y=0.0}", "a platen moves along its normal only"),
    ] {
        let place = format!("--set {setting}: ");
        input.refused(&["run", "scene.toml", "--set", setting], &[&place, reason, "hint:"]);
    }
    input.refused(&["run", "scene.toml", "--set", "boundary.9.set=top"], &["boundary.9.set=top", "hint:"]);
    input.refused(&["run", "scene.toml", "--set", "loading.increments"], &["there is no '='", "key.path=VALUE"]);
}

#[test]
fn a_body_that_can_fly_away_is_refused() {
    let input = InputFolder::new();
    input.refused(&["run", "scene.toml", "--set", "boundary.1.displacement={y=0.0}"], &["scene.toml: ", "hint:"]);
}

#[test]
fn defects_of_an_element_path_are_named_by_segment() {
    let input = InputFolder::new();
    input.refused(
        &["element", "element.toml", "--set", "path.0.stress={yy=-1e5}"],
        &["path segment 1", "yy is in both strain and stress", "hint:"],
    );
    input.refused(&["element", "element.toml", "--tangent", "magic"], &["--tangent", "truss_like_slip"]);
    // The line of the second segment, not that of the first one.
    let text = fs::read_to_string(input.path("element.toml")).unwrap();
    let second = text.lines().count() + 1;
    fs::write(input.path("two.toml"), text + "[[path]]\nincrements = 2\nstrain = { yy = -2.0 }\n").unwrap();
    let place = (second..second + 3).map(|line| format!("two.toml:{line}: path segment 2")).collect::<Vec<_>>();
    let output = input.grainspan(&["element", "two.toml"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(place.iter().any(|place| stderr.contains(place)), "{stderr}");
}

#[test]
fn places_that_cannot_be_written_are_refused_before_anything_runs() {
    let input = InputFolder::new();
    input.refused(
        &["run", "scene.toml", "--out", "discs-100.json"],
        &["--out discs-100.json", "not a folder", "hint:"],
    );
    input.refused(&["run", "scene.toml", "--out", "discs-100.json/out"], &["could not write", "hint:"]);
    fs::create_dir(input.path("mine")).unwrap();
    fs::write(input.path("mine/thesis.txt"), "precious").unwrap();
    input.refused(&["run", "scene.toml", "--out", "mine"], &["thesis.txt", "hint: name an empty or new folder"]);
    input.refused(&["run", "scene.toml", "--out", "/proc/grainspan"], &["could not write /proc/grainspan"]);
    // A result never takes the place of what a command reads.
    for (words, file) in [
        (&["element", "element.toml"][..], "element.toml"),
        (&["element", "element.toml"], "./discs-100.json"),
        (&["element", "element.toml", "--sweep", "contact.friction=0.1,0.2"], "discs-100.json"),
    ] {
        let before = fs::read(input.path(file)).unwrap();
        input.refused(&[words, &["--out", file]].concat(), &["would take the place of", "hint: name another place"]);
        assert_eq!(fs::read(input.path(file)).unwrap(), before);
    }
}

#[test]
fn a_key_that_is_swept_twice_is_refused() {
    let input = InputFolder::new();
    let twice = ["--sweep", "contact.friction=0.1,0.2", "--sweep", "contact.friction=0.3,0.4"];
    input
        .refused(&[&["element", "element.toml"][..], &twice].concat(), &["contact.friction", "swept twice", "hint:"]);
    // The error names the option that was written.
    input.refused(
        &["element", "element.toml", "--sweep", "contact.fricton=0.1,0.2"],
        &["--sweep contact.fricton=0.1", "friction"],
    );
}

#[test]
fn a_full_disk_is_named_with_the_remedy() {
    let input = InputFolder::new();
    let remedy = "hint: free some space";
    input.refused(
        &["element", "element.toml", "--quiet", "--out", "/dev/full"],
        &["could not write /dev/full", remedy],
    );
    input.refused(&["pack", "recipe.toml", "--quiet", "--out", "/dev/full"], &["could not write /dev/full", remedy]);
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["check", "scene.toml"])
        .current_dir(input.folder.path())
        .stdout(full)
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && stderr.contains("standard output"), "{stderr}");
}
