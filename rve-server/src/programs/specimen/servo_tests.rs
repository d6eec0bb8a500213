//! Walls that a servo moves, layers that they carry, and how fast a stage may be: what runs of a whole packing say of them.

use super::{SpecimenError, SpecimenEvent, SpecimenRow, SpecimenSummary, SpecimenTest, run_specimen};
use crate::definition::PackingFile;
use crate::space::Discs;
use std::path::Path;

/// A hundred discs between walls: keys of `[contact]`, other tables, and the stages.
fn discs(contact: &str, stages: &str) -> (Result<SpecimenSummary, SpecimenError>, Vec<SpecimenRow>) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
    let packing = PackingFile::<Discs>::read(&file).unwrap();
    let text = format!(
        "packing = \"\"\ntiles = [1, 1]\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
         {contact}\n{stages}"
    );
    let test: SpecimenTest = toml::from_str(&text).unwrap();
    let mut rows = Vec::new();
    let summary = run_specimen(&test, &packing, &mut |event| {
        if let SpecimenEvent::Row(row, _) = event {
            rows.push((*row).clone());
        }
    });
    (summary, rows)
}

const PRESSED: &str = "[[stage]]\nname = \"isotropic\"\nsteps = 60000\nuntil_balance = 1e-3\nrows = 1\nstress = { xx = -1e5, yy = -1e5 }\n";

/// Dashpots twice as strong as critical: walls that followed their own dashpots chattered until the energy did not add up any more.
#[test]
fn servo_walls_do_not_chatter_against_strong_dashpots() {
    let biaxial =
        "[[stage]]\nname = \"biaxial\"\nsteps = 20000\nrows = 10\nstrain = { yy = -0.01 }\nstress = { xx = -1e5 }\n";
    for damping in [0.0, 0.5, 2.0] {
        let (summary, rows) = discs(&format!("damping = {damping}"), &format!("{PRESSED}{biaxial}"));
        let summary = summary.unwrap_or_else(|error| panic!("damping {damping}: {error}"));
        assert_eq!(summary.unbalanced_stages, 0, "damping {damping}");
        assert!(summary.largest_energy_error < 0.01, "damping {damping}: {}", summary.largest_energy_error);
        let end = &rows[rows.len() - 1];
        let lateral = end.wall_stress[0];
        assert!((lateral / -1e5 - 1.0).abs() < 0.03, "damping {damping}: {lateral} Pa");
    }
}

/// The same with layers that are glued to the walls: their dashpots against the free grains are those of the wall.
#[test]
fn servo_walls_do_not_chatter_with_a_glued_layer_either() {
    let stages = format!("[walls]\nglue_depth = 1e-4\n{}", PRESSED.replace("rows", "glue = [\"y\"]\nrows"));
    let (summary, rows) = discs("damping = 2.0", &stages);
    assert_eq!(summary.unwrap().unbalanced_stages, 0);
    let stress = rows[0].wall_stress;
    assert!((stress[1] / -1e5 - 1.0).abs() < 2e-3, "{stress:?}");
}

/// A specimen that is compressed too fast tells of it whatever its walls do; one of physical masses may be meant to move.
#[test]
fn rows_that_are_not_quasi_static_are_counted() {
    let compressed = |steps: u64, tables: &str| {
        let stage = format!(
            "{tables}\n{PRESSED}[[stage]]\nname = \"compressed\"\nsteps = {steps}\nrows = 10\nstrain = {{ xx = -0.01, yy = -0.01 }}\n"
        );
        discs("", &stage).0.unwrap()
    };
    let (slow, fast) = (compressed(20_000, ""), compressed(100, ""));
    assert_eq!((slow.unbalanced_rows, fast.servo_misses), (0, 0), "{}", slow.largest_unbalanced);
    assert!(fast.unbalanced_rows >= 8 && fast.largest_unbalanced > 0.1, "{fast:?}");
    assert_eq!(compressed(100, "[motion]\nscaled_masses = false").unbalanced_rows, 0);
}

#[test]
fn a_layer_as_thick_as_the_specimen_is_refused() {
    let glued = |depth: f64| {
        let stages = format!("[walls]\nglue_depth = {depth}\n{}", PRESSED.replace("rows", "glue = [\"y\"]\nrows"));
        discs("", &stages).0
    };
    let refusal = glued(0.4).unwrap_err();
    assert!(matches!(refusal, SpecimenError::Test(_)));
    let text = refusal.to_string();
    assert!(text.starts_with("walls.glue_depth = 0.4 m glues every grain: the specimen measures "), "{text}");
    assert!(text.contains(" m along y;"), "{text}");
    glued(1e-4).unwrap();
}
