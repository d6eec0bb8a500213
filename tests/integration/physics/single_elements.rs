//! One element of real grains: against the same grains driven alone as [Liu2015] section 3.2 does (check J-3), and how fast
//! Newton's method finds the balance of an elastic step (T-9).

use crate::harness::table::Table;
use claims::Claim;
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::observer::{IterationReport, Observer, Outcome};
use macro_solver::problem::{
    Amplitude, Applied, Axis, Condition, Criteria, NamedStrategy, PressureKind, Problem, Strategy,
};
use protocol::{Definition, TangentKind};
use rve_server::contact::ContactTable;
use rve_server::definition::{Accuracy, GrainDefinition, PackingFile, RveOptions};
use rve_server::programs::rve_test::{ElementTest, run_element};
use std::path::Path;
use std::process::Command;

use crate::in_process::solved_in_process;

/// Contact law of `scenes/single-hexahedron-biaxial.toml` and `scenes/single-hexahedron-shear.toml`, without finite elements.
const BRICK: &str = r#"
packing = "spheres-1000.json"
stress_tolerance = 1e-5
[contact]
law = "hertz_mindlin"
shear_modulus = 29.0e9
poisson_ratio = 0.15
friction = 0.5
density = 2492.0
[[path]]
increments = 10
"#;

/// A column of the history of a scene that is run with one worker.
fn scene_column(scene: &str, name: &str) -> Vec<f64> {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let mut program = Command::new(env!("CARGO_BIN_EXE_grainspan"));
    // Cells take another branch for little: the elements are solved as accurately as the cell alone, and brought as near to
    // balance as that to its stress.
    let settings = [
        "--set",
        "packing=../packings/spheres-1000.json",
        "--set",
        "rve.accuracy=default",
        "--set",
        "solver.force_tolerance=1e-4",
    ];
    program.args(["run", scene, "--workers", "1", "--quiet"]).args(settings);
    program.arg("--out").arg(&out);
    let output = program.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Table::read(&out.join("history.csv")).column(name)
}

/// The strategy that scenes of spheres get by default takes a step of 1e-3 in a few evaluations, whatever the number of grains. On 4096
/// spheres it once had every tangent fall back, and took 12 times as long as Newton's method.
#[test]
fn the_default_strategy_takes_a_step_of_1000_and_of_4096_spheres() {
    for grains in [1000, 4096] {
        let place = tempfile::tempdir().unwrap();
        let packing = format!("packing=../packings/spheres-{grains}.json");
        let settings = [
            &packing,
            "rve.accuracy=draft",
            "loading.increments=1",
            "boundary.3.displacement.y=-1e-5",
            "error_estimate.enabled=false",
        ];
        let mut program = Command::new(env!("CARGO_BIN_EXE_grainspan"));
        program.args(["run", "scenes/single-hexahedron-biaxial.toml", "--workers", "1", "--quiet"]);
        program
            .args(settings.iter().flat_map(|setting| ["--set", setting]))
            .arg("--out")
            .arg(place.path().join("out"));
        let output = program.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let summary = std::fs::read(place.path().join("out/summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap();
        let count = |path: &str| summary.pointer(path).and_then(serde_json::Value::as_u64).expect("it is counted");
        assert_eq!((count("/steps"), count("/cutbacks"), count("/fallbacks/tangent_fallback")), (1, 0, 0));
        assert!(count("/rve_evaluations") <= 6, "{grains} spheres: {} evaluations", count("/rve_evaluations"));
    }
}

/// Check J-3, on 1000 spheres: biaxial compression and simple shear under a constant pressure, within 1 % up to the peak of the
/// compression at 0.6 % strain. Past it a single cell has branches, up to 7 % apart at 1 % strain, and tolerances of the balance that differ
/// by a factor of ten already choose between them.
#[test]
fn a_brick_of_spheres_repeats_the_spheres_alone() {
    for (quantity, scene, path, probe, [row, column]) in [
        (
            "axial stress of one brick against its grains alone, compression to 0.6 %, Pa",
            "scenes/single-hexahedron-biaxial.toml",
            "strain = { yy = -0.01 }\nstress = { xx = -4.16e5 }",
            "axial_stress",
            [1, 1],
        ),
        (
            "shear stress of one brick against its grains alone, simple shear to 0.6 %, Pa",
            "scenes/single-hexahedron-shear.toml",
            "strain = { xy = 0.01 }\nstress = { yy = -4.16e5 }",
            "shear_stress",
            [0, 1],
        ),
    ] {
        let elements = scene_column(scene, probe);
        let mut alone = Vec::new();
        let test = ElementTest::from_toml(&format!("{BRICK}{path}")).unwrap();
        run_element(&test, Path::new("packings"), TangentKind::None, &mut |answer| {
            alone.push(answer.stress[row][column]);
        })
        .unwrap();
        assert_eq!((elements.len(), alone.len()), (11, 11), "{scene}: ten steps and the start");
        assert!(alone[10].abs() > 2e5, "{scene}: the grains resist: {alone:?}");
        for (ours, theirs) in elements.iter().zip(&alone).take(7).skip(1) {
            Claim::of("J-3", quantity).value(*ours, *theirs).within(1e-2);
        }
    }
}

/// The default strategy on a thousand spheres: ten steps to 1 % strain take two evaluations each and ask nothing of the
/// safeguards.
#[test]
fn the_default_strategy_takes_two_evaluations_a_step_on_a_thousand_spheres() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let output = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(["run", "scenes/single-hexahedron-biaxial.toml", "--set", "packing=../packings/spheres-1000.json"])
        .args(["--workers", "1", "--quiet", "--out"])
        .arg(&out)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    let count = |value: &serde_json::Value| value.as_u64().unwrap();
    assert_eq!((count(&summary["steps"]), count(&summary["gauss_points"])), (10, 1));
    // Measured: 20, the start included.
    assert!(count(&summary["rve_evaluations"]) <= 22, "{} evaluations", summary["rve_evaluations"]);
    assert_eq!(count(&summary["cutbacks"]), 0);
    for shortcut in ["tangent_fallback", "not_equilibrated", "rejected_iterates", "steps_stabilised"] {
        assert_eq!(count(&summary["fallbacks"][shortcut]), 0, "{shortcut}");
    }
}

/// Strain of one increment of a ramp.
const RAMP: f64 = 1e-5;

/// 100 discs that do not slide, answered to the last digits.
fn sticking_discs() -> Definition {
    let packing: PackingFile = PackingFile::read(Path::new("packings/discs-100.json")).unwrap();
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 1e9) };
    let options = RveOptions {
        accuracy: Accuracy::Tight,
        tolerance: Some(1e-11),
        strain_per_step: Some(RAMP),
        ..RveOptions::default()
    };
    GrainDefinition { packing, contact, options }.validate().unwrap().to_protocol()
}

/// Out-of-balance ratios of the iterates of step 2.
#[derive(Default)]
struct Ratios(Vec<f64>);

impl Observer for Ratios {
    fn iterated(&mut self, report: &IterationReport) {
        if report.step == 2 {
            self.0.push(report.force_ratio);
        }
    }
}

/// Stress over strain of the cell, about, Pa.
const STIFFNESS: f64 = 6e7;

/// Two elements are pressed by half of what shortens them by about `strain` in one step, and the load stays in the next. A larger load on
/// the fixed side, which strains nothing, goes on, so the next step begins with the first one again, far from balance. Returns the
/// out-of-balance ratios from there.
fn way_to_balance(tangent: TangentKind, strain: f64) -> Vec<f64> {
    let mesh = Block::plane([1.0, 1.0], [1, 2], ElementKind::Q4).mesh().unwrap();
    let pressure =
        |sides: &str| Condition::Pressure { sides: sides.into(), value: 1e5, kind: PressureKind::Follower };
    let pressed = Condition::Traction { sides: "top".into(), value: [0.0, -STIFFNESS * strain, 0.0] };
    let mut problem = Problem::new(
        mesh,
        vec![
            Condition::fixed("bottom", Axis::X),
            Condition::fixed("bottom", Axis::Y),
            Condition::fixed("top", Axis::X),
            pressure("left"),
            pressure("right"),
            pressure("top"),
        ],
    );
    problem.strain_per_step = RAMP;
    let stage = &mut problem.stages[0];
    let halt = Amplitude::Table(vec![[0.0, 0.0], [0.5, 0.5], [1.0, 0.5]]);
    stage.conditions.push(Applied::new(pressed, halt));
    let idle = Condition::Traction { sides: "bottom".into(), value: [0.0, -4.0 * STIFFNESS * strain, 0.0] };
    stage.conditions.push(Applied::new(idle, Amplitude::RAMP));
    stage.control.increments = 2;
    stage.control.max_iterations = 40;
    stage.tolerances.force = 1e-9;
    stage.tolerances.criteria = Criteria { displacement: None, ..Criteria::default() };
    stage.strategy = Strategy { tangent, tangent_floor: None, ..NamedStrategy::Newton.preset() };
    let mut ratios = Ratios::default();
    let run = solved_in_process(&problem, sticking_discs(), &mut ratios);
    assert!(matches!(run.outcome, Outcome::Completed) && run.statistics.cut_backs == 0, "{:?}", run.outcome);
    ratios.0
}

/// Orders from iterate to iterate, `log(r3 / r2) / log(r2 / r1)`, as far as the round-off of the grains' own balance.
fn orders(ratios: &[f64]) -> Vec<f64> {
    let above = |triple: &&[f64]| triple[2] > 1e-10;
    ratios
        .windows(3)
        .filter(above)
        .map(|triple| (triple[2] / triple[1]).ln() / (triple[1] / triple[0]).ln())
        .collect()
}

/// Check T-9 on grains that do not slide. The frozen network is their exact tangent, the uncalibrated operator of Kruyt a
/// constant factor off.
#[test]
fn an_elastic_step_of_grains_converges_quadratically_or_linearly() {
    for strain in [1e-3, 1.4e-3, 2e-3] {
        let way = way_to_balance(TangentKind::TrussLike, strain);
        let fast = orders(&way);
        assert!(!fast.is_empty(), "{strain}: {way:?}");
        for order in fast {
            Claim::of("T-9", "order of an elastic step of 100 discs, frozen network").number(order).at_least(1.8);
        }
    }
    let way = way_to_balance(TangentKind::Kruyt, 1e-3);
    let slow = orders(&way);
    assert!(slow.len() > 5, "{way:?} {slow:?}");
    for order in slow {
        Claim::of("T-9", "order of an elastic step of 100 discs, operator of Kruyt")
            .value(order, 1.0)
            .within_absolute(0.2);
    }
}
