//! `grainspan run` on shipped scenes, as a user starts it: stages, links, stabilisation, kinds of pressure, arc length, unloading.

use crate::harness::table::Table;
use claims::Claim;
use rve_server::programs::rve_test::ElementTest;
use rve_server::programs::specimen::SpecimenTest;
use scene_reader::{Document, Kind, read_study};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

pub(super) fn run(out: &Path, workers: &str, more: &[&str]) -> Output {
    run_scene("scenes/biaxial-small.toml", out, workers, more)
}

pub(super) fn run_scene(scene: &str, out: &Path, workers: &str, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", scene, "--workers", workers, "--out"])
        .arg(out)
        .args(more)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the binary starts")
}

pub(super) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("messages are text")
}

/// Values of a column of a history, by row.
pub(super) fn numbers(out: &Path, name: &str) -> Vec<f64> {
    Table::read(&out.join("history.csv")).column(name)
}

#[test]
fn the_number_of_workers_changes_no_bit_and_quiet_is_quiet() {
    let place = tempfile::tempdir().unwrap();
    let (two, three) = (place.path().join("two"), place.path().join("three"));
    let short = ["--quiet", "--set", "loading.increments=2", "--set", "boundary.2.displacement.y=-1e-4"];
    for (out, workers) in [(&two, "2"), (&three, "3")] {
        let output = run(out, workers, &short);
        assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    }
    for file in ["history.csv", "fields/step-0002.vtu", "grains/point-0000-step-0002.vtp"] {
        assert_eq!(fs::read(two.join(file)).unwrap(), fs::read(three.join(file)).unwrap(), "{file}");
    }
}

/// A column of eight elements that nothing snaps in, stabilised against all need: it ends where Newton's method brings it.
#[test]
fn stabilisation_without_an_instability_ends_where_newton_does() {
    let place = tempfile::tempdir().unwrap();
    let column_of = |name: &str, more: &[&str]| {
        let out = place.path().join(name);
        let size = [
            "mesh.elements=[1, 8]",
            "boundary.2.displacement.y=-1e-4",
            "loading.increments=1",
            "solver.force_tolerance=1e-3",
            "solver.displacement_tolerance=1e-2",
        ];
        let set: Vec<&str> = size.iter().chain(more).flat_map(|&set| ["--set", set]).collect();
        let output = run(&out, "2", &set);
        assert!(output.status.success(), "{}", text(&output.stderr));
        out
    };
    let newton = column_of("newton", &[]);
    let alone = ["loading.max_iterations=1", "loading.stabilise_after=1", "solver.stagnated_force_tolerance=0"];
    let stabilised = column_of("stabilised-run", &alone);
    let [wanted, found] = [&newton, &stabilised].map(|out| *numbers(out, "stress_ratio").last().unwrap());
    assert!((found / wanted - 1.0).abs() < 1e-3, "{found} instead of {wanted}");
    let lost = |out: &Path| {
        let summary: serde_json::Value =
            serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
        assert!(summary["energy"]["relative_residual"].as_f64().unwrap() < 0.1, "{summary}");
        summary["energy"]["frictional_dissipation"].as_f64().unwrap()
    };
    assert!((lost(&stabilised) / lost(&newton) - 1.0).abs() < 0.1, "{} {}", lost(&stabilised), lost(&newton));
    assert!(numbers(&stabilised, "stabilised")[1] > 0.0 && numbers(&newton, "stabilised")[1] == 0.0);
    // One step far into yielding: the trapezium rule no longer knows where the work went, and the run says so.
    let coarse = place.path().join("coarse");
    let set = ["mesh.elements=[1, 1]", "boundary.2.displacement.y=-5e-4", "loading.increments=1"];
    let output = run(&coarse, "1", &set.iter().flat_map(|&set| ["--set", set]).collect::<Vec<_>>());
    assert!(text(&output.stderr).contains("energy balance open by"), "{}", text(&output.stderr));
    // Without the energies of the grains there is no balance that could be open.
    let unobserved = place.path().join("unobserved");
    let set = [&set[..], &["output.observables=[]"]].concat();
    let output = run(&unobserved, "1", &set.iter().flat_map(|&set| ["--set", set]).collect::<Vec<_>>());
    assert!(output.status.success() && !text(&output.stderr).contains("energy balance"), "{}", text(&output.stderr));
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(unobserved.join("summary.json")).unwrap()).unwrap();
    assert!(summary["energy"]["external_work"].as_f64().unwrap() > 0.0);
    assert!(summary["energy"]["elastic"].is_null() && summary["energy"]["relative_residual"].is_null(), "{summary}");
}

/// Scenes that show stages, different cells and linked displacements run to their end, with the same bytes for one and
/// two workers.
#[test]
fn the_scenes_of_stages_regions_and_links_run() {
    let place = tempfile::tempdir().unwrap();
    for name in ["compression-shear", "biaxial-weak-element", "simple-shear"] {
        let scene = format!("scenes/{name}.toml");
        let [one, two] = ["1", "2"].map(|workers| {
            let out = place.path().join(format!("{name}-{workers}"));
            let output = run_scene(&scene, &out, workers, &["--quiet"]);
            assert!(output.status.success(), "{name}: {}", text(&output.stderr));
            out
        });
        let read = |out: &Path| fs::read(out.join("history.csv")).unwrap();
        assert_eq!(read(&one), read(&two), "{name}");
    }
    let sheared = place.path().join("compression-shear-1");
    let history = Table::read(&sheared.join("history.csv"));
    let stages = history.texts("stage");
    assert_eq!((stages[0], *stages.last().unwrap()), ("compression", "shear"));
    let end = stages.iter().filter(|stage| **stage == "compression").count() - 1;
    assert!((numbers(&sheared, "mean_pressure")[end] - 2.0e5).abs() < 500.0, "the pressures have doubled");
    assert!(numbers(&sheared, "top_force")[..=end].iter().all(|force| *force == 0.0), "no platen as yet");
    assert!((numbers(&sheared, "time").last().unwrap() - 660.0).abs() < 1e-9);
    let dragged = place.path().join("simple-shear-1");
    assert!((numbers(&dragged, "vertical_stress").last().unwrap() + 1.0e5).abs() < 3e3, "the pressure stays");
    assert!(*numbers(&dragged, "shear_stress").last().unwrap() > 1e4, "the head is held back");
}

/// I-11. A dead load on the initial side grows to p / (1 - 5 %) per current length; the ratio of the stresses hardly sees it.
#[test]
fn follower_and_dead_pressure_give_one_stress_ratio_to_five_percent() {
    let place = tempfile::tempdir().unwrap();
    let [follower, dead] = ["follower", "dead"].map(|kind| {
        let out = place.path().join(kind);
        let kinds = [0, 1].map(|side| format!("pressure.{side}.kind={kind}"));
        let more = [
            "--quiet",
            "--set",
            "mesh.elements=[1, 1]",
            "--set",
            "loading.increments=100",
            "--set",
            "boundary.2.displacement.y=-5e-3",
            "--set",
            "solver.force_tolerance=5e-3",
            "--set",
            "solver.displacement_tolerance=5e-2",
            "--set",
            "output.fields_every=0",
            "--set",
            kinds[0].as_str(),
            "--set",
            kinds[1].as_str(),
        ];
        let output = run(&out, "1", &more);
        assert!(output.status.success(), "{}", text(&output.stderr));
        ["stress_ratio", "top_force", "axial_compression"].map(|name| numbers(&out, name))
    });
    let quotients =
        |column: usize| dead[column].iter().zip(&follower[column]).map(|(dead, follower)| dead / follower);
    let mean = quotients(0).sum::<f64>() / dead[0].len() as f64 - 1.0;
    // Past the peak the two take different branches: single steps differ by up to 13 %.
    Claim::of("I-11", "mean difference of the stress ratio to 5 %, dead against follower pressure")
        .error(mean)
        .within(0.02);
    for ((force, ratio), strain) in quotients(1).zip(quotients(0)).zip(&follower[2]) {
        let by_pressure = force / ratio * (1.0 - strain.abs());
        Claim::of("I-11", "axial force by dead over that by follower pressure, less the growth of the pressure")
            .value(by_pressure, 1.0)
            .within(0.01);
    }
}

/// Every scene is sound in every size; element tests and specimens have commands of their own, their keys are read here.
#[test]
fn every_scene_passes_the_check_in_every_size() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scenes = Vec::new();
    let mut folders = vec![root.join("scenes")];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            match path.extension().and_then(|ending| ending.to_str()) {
                Some("toml") => scenes.push(path),
                _ if path.is_dir() => folders.push(path),
                _ => {}
            }
        }
    }
    let mut checked = 0;
    for path in scenes {
        let name = path.strip_prefix(root).unwrap().display().to_string();
        let sizes = Document::read(&path, &[]).unwrap().sizes();
        for size in std::iter::once(None).chain(sizes.iter().map(|size| Some(size.as_str()))) {
            let document = Document::read_in_size(&path, size, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
            if document.expect(Kind::ElementTest).is_ok() {
                document.deserialize::<ElementTest>().unwrap_or_else(|error| panic!("{name} {size:?}: {error}"));
            } else if document.expect(Kind::Study).is_ok() {
                read_study(&document).unwrap_or_else(|error| panic!("{name} {size:?}: {error}"));
            } else if document.expect(Kind::Specimen).is_ok() {
                document.deserialize::<SpecimenTest>().unwrap_or_else(|error| panic!("{name} {size:?}: {error}"));
            } else {
                let mut program = Command::new(env!("CARGO_BIN_EXE_grainspan"));
                program.arg("check").arg(&path).args(size.iter().flat_map(|size| ["--size", size]));
                let output = program.output().unwrap();
                assert!(output.status.success(), "{name} {size:?}: {}", text(&output.stderr));
            }
            checked += 1;
        }
    }
    assert!(checked > 40, "scenes and sizes were found: {checked}");
}

/// Stress ratio at a compression, between the rows of a run.
fn ratio_at(out: &Path, compression: f64) -> f64 {
    let (along, up) = (numbers(out, "axial_compression"), numbers(out, "stress_ratio"));
    let after = along.iter().position(|value| *value > compression).unwrap();
    let share = (compression - along[after - 1]) / (along[after] - along[after - 1]);
    up[after - 1] + share * (up[after] - up[after - 1])
}

/// Past the peak the load of a force-driven test has to fall: arc length and indirect control find it, and agree with a head that is
/// moved; raising the load ends at the peak.
#[test]
fn arc_length_follows_grains_past_their_peak() {
    let place = tempfile::tempdir().unwrap();
    let indirect = "loading.control={indirect={set=\"top\",relative_to=\"bottom\",component=\"y\",growth=-2e-3}}";
    let moved = ["--set", "loading.control=load", "--set", "tilting_platen.0.displacement=-2e-3"];
    let ways =
        [("arc", &[][..]), ("indirect", &["--set", indirect][..]), ("moved", &moved[..]), ("raised", &moved[..2])];
    let [arc, indirect, moved, raised] = ways.map(|(name, changes)| {
        let out = place.path().join(name);
        // Two ways along one path are compared, so each keeps close to it.
        let closely =
            ["--quiet", "--set", "solver.force_tolerance=1e-3", "--set", "solver.displacement_tolerance=1e-2"];
        let output = run_scene("scenes/biaxial-arc-length.toml", &out, "1", &[&closely, changes].concat());
        assert_eq!(output.status.code(), Some(i32::from(name == "raised")), "{name}: {}", text(&output.stderr));
        out
    });
    let highest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let peak = highest(&numbers(&moved, "stress_ratio"));
    let at_peak = highest(&numbers(&raised, "axial_compression"));
    assert!((highest(&numbers(&raised, "stress_ratio")) / peak - 1.0).abs() < 5e-3, "the load ends at the peak");
    for (out, up_to_peak, beyond) in [(&arc, 4e-3, 3e-2), (&indirect, 1e-3, 2e-3)] {
        let (ratio, load) = (numbers(out, "stress_ratio"), numbers(out, "load"));
        assert!((highest(&ratio) / peak - 1.0).abs() < 5e-3, "{}", highest(&ratio));
        assert!(load.last().unwrap() < &(0.8 * highest(&load)) && ratio.last().unwrap() < &(0.9 * peak));
        for step in 1..=19 {
            let compression = f64::from(step) * 1e-3;
            let allowed = if compression < at_peak { up_to_peak } else { beyond };
            let (ours, theirs) = (ratio_at(out, compression), ratio_at(&moved, compression));
            assert!((ours / theirs - 1.0).abs() < allowed, "at {compression}: {ours} {theirs}");
        }
    }
}

/// A body is unloaded until nothing is left of its pressure, and loaded again: its cells say that they carry nothing, none of them burns
/// its step cap, and the loads that are left are not what balance is measured by.
#[test]
fn a_body_is_unloaded_to_zero_and_loaded_again() {
    let place = tempfile::tempdir().unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shipped = fs::read_to_string(folder.join("scenes/compression-shear.toml")).unwrap();
    let first = shipped.split("# A platen replaces the pressure").next().unwrap();
    let unloading = first
        .replace("value = 2.0e5", "value = 0.0")
        .replace("../packings", folder.join("packings").to_str().unwrap());
    let ramp = |name: &str, set: &str| {
        format!("[[stage.pressure]]\n{name}set = \"{set}\"\nvalue = 1.0e5\nhistory = \"ramp\"\n")
    };
    let again = ["left", "right"].map(|set| ramp("", set)).concat() + &ramp("name = \"lid\"\n", "top");
    let probe = "[[probe]]\nname = \"vertical\"\nkind = \"mean_stress\"\ncomponent = \"yy\"\n";
    let stage = "[[stage]]\nname = \"reload\"\nloading = { increments = 5, duration = 60.0 }\n";
    let scene = place.path().join("unload.toml");
    fs::write(&scene, format!("{unloading}\n{stage}{again}{probe}")).unwrap();
    let out = place.path().join("out");
    let output = run_scene(scene.to_str().unwrap(), &out, "1", &[]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!((summary["steps"].as_u64(), summary["cutbacks"].as_u64()), (Some(9), Some(0)));
    assert_eq!(summary["fallbacks"]["not_equilibrated"], 0);
    assert!(summary["fallbacks"]["no_load_bearing_contacts"].as_u64().unwrap() > 0);
    assert!(summary["rve_evaluations"].as_u64().unwrap() < 600, "{}", summary["rve_evaluations"]);
    let vertical = numbers(&out, "vertical");
    assert!(vertical[4].abs() < 300.0 && (vertical[9] / -1e5 - 1.0).abs() < 5e-3, "{vertical:?}");
}
