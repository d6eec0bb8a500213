//! `grainspan element`: columns and bytes, sweeps, frames, pictures of contacts and of displacement fluctuations.

use crate::harness::commands::{grainspan, succeeded};
use crate::harness::table::Table;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use vtkio::Vtk;
use vtkio::model::{Attribute, DataSet};

/// Writes an element test that names the small packing of the repository.
fn element_test(folder: &Path) -> String {
    let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let text = format!(
        "packing = {packing:?}\n[contact]\nmodulus = 1.0e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
         [rve]\naccuracy = \"draft\"\n[[path]]\nincrements = 3\nstrain = {{ yy = -3.0e-4 }}\nstress = {{ xx = -1.0e5 }}\n"
    );
    let path = folder.join("test.toml");
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn an_element_test_has_the_promised_columns_and_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let first = succeeded(&["element", &test]).stdout;
    let file = folder.path().join("curve.csv");
    let quiet = succeeded(&["element", &test, "--quiet", "--out", file.to_str().unwrap()]);
    assert!(quiet.stdout.is_empty() && quiet.stderr.is_empty());
    assert_eq!(fs::read(&file).unwrap(), first, "file and standard output hold the same");
    let text = String::from_utf8(first).unwrap();
    assert_eq!(
        text.lines().next().unwrap(),
        "increment,F_xx,F_xy,F_yx,F_yy,sigma_xx,sigma_xy,sigma_yx,sigma_yy,void_ratio,coordination_number,\
         coordination_number_no_rattlers,fabric_anisotropy,sliding_fraction,unbalanced_force_ratio,\
         max_overlap_ratio,dem_steps,elastic_energy,frictional_dissipation,fabric_xx,fabric_xy,fabric_yy,a_c,a_n,a_t,work,damping_work"
    );
    assert_eq!(text.lines().count(), 1 + 4, "row 0 and one row per increment");
    let table = Table::of(&text);
    assert!((table.last("F_yy") - (1.0 - 3.0e-4)).abs() < 1e-12, "F_yy follows the path");
    assert!((table.last("sigma_xx") + 1.0e5).abs() < 200.0, "sigma_xx is held");
    assert!(table.last("sigma_yy") < -1.1e5, "sigma_yy grows in compression");
    assert!((table.last("fabric_xx") + table.last("fabric_yy") - 1.0).abs() < 1e-14, "the trace of the fabric");
}

/// A modulus a thousand times that of the packing: the stress of row 0 is, too, and the path begins with what the packing was made for.
#[test]
fn an_element_test_says_at_once_that_its_packing_and_its_path_do_not_match() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let said = |settings: &[&str]| {
        let output = grainspan(&[&["element", &test], settings].concat());
        String::from_utf8(output.stderr).unwrap()
    };
    let text = said(&["--set", "contact.modulus=1e11"]);
    let warning = "warning: the packing has sigma_xx = -";
    assert!(text.contains(warning) && text.contains("contact.modulus or normal_stiffness"), "{text}");
    let counted = "differ more than tenfold (units, thickness, modulus?): 1 row";
    assert!(text.contains(counted), "{text}");
    let text = said(&["--sweep", "contact.modulus=1e8,1e11"]);
    assert!(text.contains(counted), "{text}");
    let text = said(&["--sweep", "contact.stiffness_ratio=0.5,0"]);
    assert!(text.contains("contact.stiffness_ratio=0: of the packing's tangential forces, "), "{text}");
    let text = said(&[]);
    assert!(!text.contains("warning: ") && text.contains("; warnings: none"), "{text}");
}

/// What is found only when the cell is made: a table of an earlier test was emptied.
#[test]
fn a_test_that_cannot_begin_leaves_an_earlier_table_alone() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let text = fs::read_to_string(&test)
        .unwrap()
        .replace("[rve]\naccuracy = \"draft\"", "[frame]\nconstraint = \"periodic\"");
    fs::write(&test, text).unwrap();
    let table = folder.path().join("curve.csv");
    fs::write(&table, "earlier\n").unwrap();
    let command = ["element", &test, "--tangent", "truss_like", "--out", table.to_str().unwrap()];
    for sweep in [&[][..], &["--sweep", "contact.friction=0.3,0.5"]] {
        let refused = grainspan(&[&command[..], sweep].concat());
        let said = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && said.contains("no tangent"), "{said}");
        assert_eq!(fs::read_to_string(&table).unwrap(), "earlier\n");
    }
}

/// A table of all combinations, in their order, with the rows of single tests; equal bytes for any number of jobs.
#[test]
fn a_sweep_is_one_table_of_single_tests() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let sweep =
        ["element", &test, "--sweep", "contact.friction=0.2,0.5", "--sweep", "path.0.increments=1:2:2", "--quiet"];
    let table = succeeded(&[&sweep[..], &["--jobs", "3"]].concat()).stdout;
    assert_eq!(table, succeeded(&[&sweep[..], &["--jobs", "1"]].concat()).stdout);
    let text = String::from_utf8(table).unwrap();
    assert!(text.starts_with("contact.friction,path.0.increments,increment,F_xx"), "{text}");
    assert_eq!(text.lines().count(), 1 + 2 * (2 + 3));
    let single =
        succeeded(&["element", &test, "--quiet", "--set", "contact.friction=0.2", "--set", "path.0.increments=2"]);
    let single = String::from_utf8(single.stdout).unwrap();
    let rows: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("0.2,2,")).collect();
    assert_eq!(rows, single.lines().skip(1).collect::<Vec<_>>());
    // Sound one by one and not together, last of all: found before any test runs.
    let together =
        ["element", &test, "--sweep", "contact.rolling_stiffness=0,0.5", "--sweep", "contact.rolling_friction=0"];
    let refused = grainspan(&together);
    assert_eq!((refused.status.code(), refused.stdout.len()), (Some(2), 0), "{refused:?}");
    assert!(String::from_utf8_lossy(&refused.stderr).contains("need each other"), "{refused:?}");
    let refused = grainspan(&["element", &test, "--sweep", "contact.frictoin=0.2,0.5"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("did you mean"), "{refused:?}");
    assert_eq!(grainspan(&["element", &test, "--sweep", "contact.friction=1:2:0"]).status.code(), Some(2));
}

/// Sums of force times branch over the contacts of a table, N m, row by row in the plane: by whole forces, and by normal forces the negative
/// trace.
fn sums_over_contacts(file: &Path) -> ([f64; 4], f64) {
    let table = Table::read(file);
    let ends = table.columns(["x_1", "y_1", "x_2", "y_2"]);
    let forces = table.columns(["force_x", "force_y", "normal_force"]);
    let (mut sums, mut pressure) = ([0.0; 4], 0.0);
    for ([x_1, y_1, x_2, y_2], [force_x, force_y, normal]) in ends.into_iter().zip(forces) {
        let (branch, force) = ([x_2 - x_1, y_2 - y_1], [force_x, force_y]);
        pressure -= normal * branch[0].hypot(branch[1]);
        sums.iter_mut().enumerate().for_each(|(place, sum)| *sum += force[place / 2] * branch[place % 2]);
    }
    (sums, pressure)
}

/// `(s1 - s2) / (s1 + s2) = (a_c + a_n + a_t) / (2 + a_c a_n)`; 0.7 % off at worst from increment 2 on, when this was written.
#[test]
fn the_stress_ratio_follows_from_the_anisotropies_of_the_contacts() {
    let text = String::from_utf8(succeeded(&["element", "scenes/rve-biaxial.toml", "--quiet"]).stdout).unwrap();
    let stresses = ["sigma_xx", "sigma_xy", "sigma_yy"];
    let table = Table::of(&text);
    let rows = table.columns(stresses).into_iter().zip(table.columns(["a_c", "a_n", "a_t"]));
    for ([xx, xy, yy], [a_c, a_n, a_t]) in rows.skip(2) {
        let ratio = (0.5 * (xx - yy)).hypot(xy) / (0.5 * (xx + yy)).abs();
        let from_contacts = (a_c + a_n + a_t) / (2.0 + a_c * a_n);
        assert!((from_contacts / ratio - 1.0).abs() < 0.02, "{from_contacts} {ratio}");
    }
}

#[test]
fn operator_columns_come_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let output = succeeded(&["element", &test, "--tangent", "truss_like", "--set", "path.0.increments=1"]);
    let table = Table::of(&String::from_utf8(output.stdout).unwrap());
    let header = table.names();
    assert_eq!(header.len(), 17 + 16 + 10);
    assert_eq!((header[17].as_str(), header[32].as_str()), ("C_1111", "C_2222"));
}

/// All grains of [Liu2018] bounded as in the paper, for a few increments: the contacts of a frame carry the stress of its rows, its
/// outline is that of the boundary grains.
#[test]
fn frames_side_by_side_show_their_grains_and_contacts() {
    let folder = tempfile::tempdir().unwrap();
    let test = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/liu2018/grains-frame-biaxial.toml");
    for constraint in ["periodic", "platens"] {
        let out = folder.path().join(constraint);
        let chosen = format!("frame.constraint='{constraint}'");
        let short = ["--set", "path.1.increments=2", "--set", "path.1.strain.yy=-1e-3", "--set", &chosen];
        let pictures = ["--contacts", out.to_str().unwrap(), "--fluctuations-from", "1"];
        let arguments = ["element", test.to_str().unwrap(), "--size", "small", "--quiet"];
        let ran = succeeded(&[&arguments[..], &short, &pictures].concat());
        let rows = Table::of(&String::from_utf8(ran.stdout).unwrap());
        let value = |column: &str| rows.column(column)[3];
        let (sums, _) = sums_over_contacts(&out.join("increment-0003-contacts.csv"));
        let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-liu2018.json");
        let packing: serde_json::Value = serde_json::from_str(&fs::read_to_string(packing).unwrap()).unwrap();
        let side = |row: usize, column: usize| packing["periodicity"][row][column].as_f64().unwrap();
        let two = 2.0 * (side(0, 0) * side(1, 1) - side(0, 1) * side(1, 0));
        let area = two * (value("F_xx") * value("F_yy") - value("F_xy") * value("F_yx"));
        let pressure = -0.5 * (value("sigma_xx") + value("sigma_yy"));
        for (sum, column) in sums.iter().zip(["sigma_xx", "sigma_xy", "sigma_yx", "sigma_yy"]) {
            let apart = (sum / area - value(column)).abs() / pressure;
            assert!(apart < 2e-2, "{constraint}, {column}: {} and {}", sum / area, value(column));
        }
        assert!(value("sigma_yy") < 1.02 * value("sigma_xx") && value("a_n").is_finite(), "{rows:?}");
        for ending in ["force-chains.svg", "rotations.svg", "normals.svg", "fluctuations.svg", "grains.vtp"] {
            assert!(out.join(format!("increment-0003-{ending}")).is_file(), "{ending}");
        }
        let picture = fs::read_to_string(out.join("increment-0003-force-chains.svg")).unwrap();
        let outline = picture.lines().find(|line| line.contains("stroke-dasharray")).unwrap();
        assert!(outline.matches(',').count() > 60, "the boundary grains of two frames: {outline}");
    }
}

/// Past its peak a body with soft sides snaps, where no strain meets the stress of the sides: the test goes on to its end all the same.
#[test]
fn frames_under_controlled_stress_go_on_where_they_snap() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("rows.csv");
    let test = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/liu2018/grains-frame-biaxial.toml");
    let soft = ["--size", "small", "--set", "frame.constraint='platens'", "--out", out.to_str().unwrap()];
    let ran = succeeded(&[&["element", test.to_str().unwrap()][..], &soft].concat());
    let rows = Table::read(&out);
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    let stresses = rows.columns(["sigma_xx", "sigma_yy"]);
    let off = stresses.iter().skip(1).filter(|[xx, yy]| {
        // Within the tolerance of a target that lies between the end of the first segment, itself within it, and the stress asked for.
        (xx + 1.5e5).abs() > 2.0 * 5e-3 * 0.5 * (xx + yy).abs().max(3e5)
    });
    assert_eq!(rows.count(), 202, "{said}");
    let off = off.count();
    assert_eq!(off > 0, said.contains("controlled stress missed"), "{off} rows are off: {said}");
    // One increment of 10 %, which is taken in parts.
    let coarse = ["--set", "path.1.increments=1"];
    let ran = succeeded(&[&["element", test.to_str().unwrap()][..], &soft, &coarse].concat());
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    let rows = Table::read(&out);
    let missed = (rows.column("sigma_xx")[2] + 1.5e5).abs() > 1e-2 * 1.5e5;
    assert_eq!(missed, said.contains("controlled stress missed"), "{said}");
    // The way through the committed steps counts: work is about what was stored and lost, to the error of trapezoids over the parts.
    let [stored, lost, work] = ["elastic_energy", "frictional_dissipation", "work"].map(|name| rows.column(name));
    let taken = (stored[2] - stored[1]) + (lost[2] - lost[1]);
    let ratio = (work[2] - work[1]) / taken;
    assert!((0.7..1.6).contains(&ratio), "{ratio} of {taken} J/m3");
}

#[test]
fn contacts_of_chosen_increments_come_with_their_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let out = folder.path().join("contacts");
    let out_name = out.to_str().unwrap();
    succeeded(&["element", &test, "--quiet", "--contacts", out_name, "--contacts-at", "2"]);
    let mut names: Vec<String> =
        fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let endings = [
        "contacts.csv",
        "contacts.vtp",
        "force-chains.svg",
        "force-distribution.csv",
        "force-distribution.svg",
        "grains.vtp",
        "normal-forces.svg",
        "normals.svg",
        "rotations.svg",
    ];
    assert_eq!(names, endings.map(|ending| format!("increment-0002-{ending}")));
    // The Love-Weber sum over the table is the stress of the row, by normal forces its trace, by whole forces all of it.
    let (sums, pressure) = sums_over_contacts(&out.join("increment-0002-contacts.csv"));
    let rows = String::from_utf8(succeeded(&["element", &test, "--quiet"]).stdout).unwrap();
    let row = &Table::of(&rows).rows()[2];
    let packing = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json")).unwrap();
    let packing: serde_json::Value = serde_json::from_str(&packing).unwrap();
    let side = |row: usize, column: usize| packing["periodicity"][row][column].as_f64().unwrap();
    let area = side(0, 0) * side(1, 1) - side(0, 1) * side(1, 0);
    let volume = area * packing["thickness"].as_f64().unwrap() * (row[1] * row[4] - row[2] * row[3]);
    assert!((pressure / volume / -(row[5] + row[8]) - 1.0).abs() < 1e-9, "{} {row:?}", pressure / volume);
    for (place, sum) in sums.iter().enumerate() {
        let reached = row[5 + place];
        assert!(
            (sum / volume - reached).abs() < 1e-9 * row[8].abs(),
            "component {place}: {} {reached}",
            sum / volume
        );
    }
    for (arguments, part) in [
        (["--contacts-at", "9"], "increments 0 to 3"),
        (["--fluctuations-from", "3"], "no picture comes after increment 3"),
    ] {
        let output = grainspan(&[&["element", &test, "--contacts", out_name][..], &arguments].concat());
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && message.contains(part), "{message}");
    }
}

/// Vectors of a field on the grains of a `.vtp`.
fn grain_vectors(file: &Path, name: &str) -> Vec<f64> {
    let DataSet::PolyData { pieces, .. } = Vtk::import(file).unwrap().data else { panic!("not poly data") };
    let piece = pieces[0].load_piece_data(None).unwrap();
    let found = piece.data.point.iter().find(|attribute| attribute.name() == name);
    let Some(Attribute::DataArray(array)) = found else { panic!("there is no {name}") };
    array.data.cast_into::<f64>().unwrap()
}

/// Discs and spheres: fluctuations have no mean, are none at the increment that they are counted from, and turn with the cell, which a
/// rotation of 40 degrees in the strain path shows; spheres have their pictures too.
#[test]
fn displacement_fluctuations_turn_with_the_cell() {
    let folder = tempfile::tempdir().unwrap();
    let packings = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings");
    let written = |packing: &str, law: &str, gradient: &str, name: &str| {
        let test = folder.path().join(format!("{name}.toml"));
        let packing = packings.join(packing);
        let text = format!(
            "packing = {packing:?}\n[contact]\n{law}\n[rve]\naccuracy = \"tight\"\n[[path]]\nincrements = 1\n\
             [path.strain]\n{gradient}\n"
        );
        fs::write(&test, text).unwrap();
        let out = folder.path().join(name);
        let arguments =
            ["--contacts", out.to_str().unwrap(), "--contacts-at", "0,1", "--fluctuations-from", "0", "--quiet"];
        succeeded(&[&["element", test.to_str().unwrap()][..], &arguments].concat());
        out
    };
    let field = |out: &Path, increment: u32| {
        grain_vectors(&out.join(format!("increment-{increment:04}-grains.vtp")), "displacement_fluctuation")
    };
    let discs = "law = \"linear\"\nmodulus = 1.0e8\nstiffness_ratio = 0.5\nfriction = 0.5";
    let straight = written("discs-100.json", discs, "xx = 0.0\nxy = 0.0\nyx = 0.0\nyy = -2.01e-3", "straight");
    // R F - I with the rotation R by 40 degrees.
    let (sin, cos) = 40_f64.to_radians().sin_cos();
    let (xx, xy, yx, yy) = (cos - 1.0, -sin * 0.99799, sin, cos * 0.99799 - 1.0);
    let turned = written("discs-100.json", discs, &format!("xx = {xx}\nxy = {xy}\nyx = {yx}\nyy = {yy}"), "turned");
    assert!(field(&straight, 0).iter().all(|value| *value == 0.0));
    let (straight_field, turned_field) = (field(&straight, 1), field(&turned, 1));
    let largest = straight_field.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    assert!(largest > 1e-7, "{largest}");
    for axis in 0..3 {
        let sum: f64 = straight_field.iter().skip(axis).step_by(3).sum();
        assert!(sum.abs() < 1e-9 * largest * 100.0, "{sum}");
    }
    for (one, other) in straight_field.chunks(3).zip(turned_field.chunks(3)) {
        let rotated = [cos * one[0] - sin * one[1], sin * one[0] + cos * one[1]];
        // Other last digits end the relaxation some steps sooner or later.
        assert!((rotated[0] - other[0]).hypot(rotated[1] - other[1]) < 1e-3 * largest, "{one:?} {other:?}");
    }
    assert!(straight.join("increment-0001-fluctuations.svg").is_file());
    let hertz = "law = \"hertz_mindlin\"\nshear_modulus = 29.0e9\npoisson_ratio = 0.15\nfriction = 0.5";
    let spheres = written("spheres-100.json", hertz, "xx = 0.0\nxy = 0.1\nyy = -1.0e-3\nzz = 0.0", "spheres");
    assert!(field(&spheres, 1).iter().any(|value| *value != 0.0));
    for ending in ["force-chains.svg", "force-distribution.svg", "normals.svg", "normal-forces.svg"] {
        let text = fs::read_to_string(spheres.join(format!("increment-0001-{ending}"))).unwrap();
        assert!(!text.contains("NaN") && text.contains("increment-0001"), "{ending}");
    }
    assert!(!spheres.join("increment-0001-fluctuations.svg").exists());
}

#[test]
fn a_reader_that_stops_early_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    let test = element_test(folder.path());
    let mut child = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["element", &test, "--quiet"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
