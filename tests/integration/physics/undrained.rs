//! `[pore_fluid]`: the grains of a sealed specimen follow the stress path of one cell whose volume is kept and that carries no shear stress.

use crate::harness::table::Table;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Pressure of the packing, Pa.
const PRESSURE: f64 = 1e5;

/// Axial shortening in all, and its steps. At 1.2 % the two differ by 2.1 % of the pressure, as runs of two accuracies do there.
const SHORTENING: f64 = 0.005;
const STEPS: usize = 20;

fn program(words: &[&str]) {
    let ran = Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(words)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
}

/// What the cell of both and its law are.
const CELL: &str = "[contact]\nlaw = \"linear\"\nmodulus = 1.0e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
                    [rve]\nerror = 1e-3\n";

/// Four-node elements with four points cannot shear at constant volume, which is said before the run.
#[test]
fn elements_that_lock_are_named() {
    let scene = "scenes/geotechnics/undrained-biaxial.toml";
    let check = |element: &str| {
        let set = format!("mesh.element={element}");
        let checked = Command::new(env!("CARGO_BIN_EXE_grainspan"))
            .args(["check", scene, "--set", &set])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        String::from_utf8_lossy(&checked.stdout).into_owned()
    };
    assert!(check("q4").contains("elements `q4` lock"));
    assert!(!check("q8").contains("lock:") && !check("q4_single").contains("lock:"));
}

/// Both mean pressure and deviator of the grains agree within 2 % of the pressure, and the sides see total pressure.
#[test]
fn a_sealed_specimen_follows_a_cell_of_constant_volume() {
    let folder = tempfile::tempdir().unwrap();
    let packing: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let (scene, run) = (folder.path().join("scene.toml"), folder.path().join("run"));
    let text = format!(
        "packing = '{}'\n{CELL}\
         [mesh]\ngenerator = \"block\"\nsize = [0.1, 0.1]\nelements = [1, 1]\nelement = \"q8\"\n\
         [pore_fluid]\nbulk_modulus = 1e10\n\
         [[boundary]]\nset = \"bottom\"\nplaten = \"smooth\"\ndisplacement = {{ y = 0.0 }}\n\
         [[boundary]]\nset = \"bottom_left\"\ndisplacement = {{ x = 0.0 }}\n\
         [[boundary]]\nset = \"top\"\nplaten = \"smooth\"\ndisplacement = {{ y = {} }}\n\
         [[pressure]]\nset = \"left\"\nvalue = {PRESSURE}\n[[pressure]]\nset = \"right\"\nvalue = {PRESSURE}\n\
         [loading]\nincrements = {STEPS}\n\
         [[probe]]\nname = \"xx\"\nkind = \"mean_stress\"\ncomponent = \"xx\"\n\
         [[probe]]\nname = \"yy\"\nkind = \"mean_stress\"\ncomponent = \"yy\"\n\
         [[probe]]\nname = \"fluid\"\nkind = \"pore_pressure\"\n\
         [[probe]]\nname = \"force\"\nkind = \"reaction\"\nset = \"top\"\ncomponent = \"y\"\n",
        packing.display(),
        -0.1 * SHORTENING
    );
    fs::write(&scene, text).unwrap();
    program(&["run", scene.to_str().unwrap(), "--quiet", "--workers", "1", "--out", run.to_str().unwrap()]);
    let specimen = Table::read(&run.join("history.csv"));

    // Steps of constant volume that end at the same shortening.
    let axial = (1.0 - SHORTENING).powf(1.0 / STEPS as f64);
    let (test, curve) = (folder.path().join("test.toml"), folder.path().join("curve.csv"));
    let path = format!(
        "[[path]]\nincrements = 1\nrepeat = {STEPS}\nstrain = {{ xx = {:?}, yy = {:?} }}\nstress = {{ xy = 0.0 }}\n",
        1.0 / axial - 1.0,
        axial - 1.0
    );
    fs::write(
        &test,
        format!(
            "packing = '{}'\n{}{path}",
            packing.display(),
            CELL.replace("error = 1e-3", "accuracy = \"default\"")
        ),
    )
    .unwrap();
    program(&["element", test.to_str().unwrap(), "--quiet", "--out", curve.to_str().unwrap()]);
    let cell = Table::read(&curve);

    for (ours, theirs) in [("xx", "sigma_xx"), ("yy", "sigma_yy")] {
        let (found, expected) = (specimen.last(ours), cell.last(theirs));
        assert!((found - expected).abs() < 0.02 * PRESSURE, "{ours}: {found} for {expected}");
    }
    // Most of the work went into the fluid, and the balance knows it.
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(run.join("summary.json")).unwrap()).unwrap();
    let energy = |name: &str| summary["energy"][name].as_f64().unwrap();
    let pressure = specimen.last("fluid");
    assert!((energy("pore_fluid") / (0.01 * 0.5 * pressure * pressure / 1e10) - 1.0).abs() < 1e-2, "{summary}");
    assert!(energy("relative_residual") < 0.02, "{summary}");
    // The path is not that of a drained test, whose lateral stress stays.
    assert!((specimen.last("xx") + PRESSURE).abs() > 0.1 * PRESSURE);
    let lateral = specimen.last("xx") - specimen.last("fluid");
    assert!((lateral + PRESSURE).abs() < 0.01 * PRESSURE, "total stress at the sides: {lateral}");
    let width = 0.1 / (1.0 - SHORTENING);
    let head = (specimen.last("yy") - specimen.last("fluid")) * width;
    assert!((specimen.last("force") / head - 1.0).abs() < 0.01, "the platen carries the total stress");
}
