//! Packings, and frames cut out of them, that are not at rest under the contact law of their test.

use super::*;
use protocol::TangentKind;
use std::path::Path;

/// A packing made with more friction than it is tested with falls. How far it is strained meanwhile does not matter: it comes to rest first,
/// and the pressure after the first increment is that of finer steps within 0.06 %. Where it is strained while it falls, it is 1.3 % off.
#[test]
fn a_packing_that_is_not_at_rest_settles_before_it_is_strained() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rows = |strain_per_step: f64| {
        let text = format!(
            "packing = \"packings/discs-400-loose.json\"\n[contact]\nlaw = \"linear\"\nmodulus = 6.0e7\nstiffness_ratio = 0.5\n\
             friction = 0.45\n[rve]\nstrain_per_step = {strain_per_step:e}\ntolerance = 1e-2\n\
             [[path]]\nincrements = 4\nstrain = {{ xy = 4e-3 }}\n"
        );
        let test = ElementTest::from_toml(&text).unwrap();
        let mut rows = Vec::new();
        let summary = run_element(&test, &root, TangentKind::None, &mut |row| rows.push(row.clone())).unwrap();
        assert_eq!(summary.settled, 1);
        assert!(summary.warnings().iter().any(|(what, _)| what.contains("not at rest under this contact law")));
        rows
    };
    let (coarse, fine) = (rows(2e-5), rows(1e-6));
    assert_eq!(coarse[0], fine[0], "row 0 is the packing as given");
    assert!(coarse[0].unbalanced_force_ratio > 0.05);
    let pressure = |row: &ElementRow| -0.5 * (row.stress[0][0] + row.stress[1][1]);
    assert!((pressure(&coarse[1]) / pressure(&fine[1]) - 1.0).abs() < 2e-3);
}

/// Before anything moves there is no kinetic energy: the criterion of energies finds a packing out of balance by its forces.
#[test]
fn a_packing_that_is_not_at_rest_settles_by_energies_too() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = "packing = \"packings/discs-400-loose.json\"\n[contact]\nlaw = \"linear\"\nmodulus = 6.0e7\nstiffness_ratio = 0.5\n\
                friction = 0.45\n[rve]\naccuracy = \"draft\"\ncriterion = \"energy\"\n[[path]]\nincrements = 1\n\
                strain = { xy = 1e-4 }\n";
    let test = ElementTest::from_toml(text).unwrap();
    let mut ratios = Vec::new();
    let summary = run_element(&test, &root, TangentKind::None, &mut |row| ratios.push(row.unbalanced_force_ratio));
    assert_eq!(summary.unwrap().settled, 1);
    assert!(ratios[0] > 0.05, "{ratios:?}");
}

/// The first segment of a packing that another law holds together ends without stress: what it bore at rest on the way is what the rest is
/// measured by.
#[test]
fn a_packing_far_from_rest_is_unloaded_to_no_stress_in_its_first_segment() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = "packing = \"packings/discs-100.json\"\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\n\
                friction = 0.5\ncohesion = 1e-6\n[rve]\naccuracy = \"draft\"\n[[path]]\nincrements = 10\nstress = { xx = 0.0, yy = 0.0 }";
    let test = ElementTest::from_toml(text).unwrap();
    let mut last = None;
    let summary = run_element(&test, &root, TangentKind::None, &mut |row| last = Some(row.clone())).unwrap();
    assert_eq!((summary.begins_with_motion, summary.rows), (1, 11));
    let stress = last.unwrap().stress;
    assert!(stress[0][0].abs().max(stress[1][1].abs()) < 100.0, "{stress:?} of 1e5 Pa");
}

/// A packing that is not at rest and goes to a stress falls in its first increment: that is told. A stress that the grains cannot carry is
/// not told as a deformation that is too large.
#[test]
fn stress_control_tells_of_unrest_and_of_stresses_out_of_reach() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let ended = |packing: &str, law: &str, path: &str| {
        let text = format!(
            "packing = \"packings/{packing}.json\"\n[contact]\nlaw = \"linear\"\nstiffness_ratio = 0.5\n{law}\n[rve]\naccuracy = \"draft\"\n{path}"
        );
        let test = ElementTest::from_toml(&text).unwrap();
        run_element(&test, &root, TangentKind::None, &mut |_| ())
    };
    let falling = ended(
        "discs-400-loose",
        "modulus = 6.0e7\nfriction = 0.45",
        "[[path]]\nincrements = 2\nstrain = { yy = -1e-3 }\nstress = { xx = -1e5 }",
    );
    let told = falling.unwrap().warnings();
    assert!(told.iter().any(|(what, _)| what.contains("begins with its motion")), "{told:?}");
    let path = "[[path]]\nincrements = 2\nstress = { yy = -1e6, xx = -1e5 }";
    let error = ended("discs-100", "modulus = 1.0e8\nfriction = 0.5", path).unwrap_err().to_string();
    assert!(error.contains("prescribe the strain") && !error.contains("exceeds the limit"), "{error}");
}

/// Stiffer contacts make of the packing's stress a thousand and ten thousand times what is wanted, which no cell has borne: the stress of a row is
/// measured by its own targets, and a cell that carries none of it is no answer.
#[test]
fn stresses_of_packings_far_from_rest_are_measured_by_what_is_wanted() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for frame in ["", "[frame]\nconstraint = \"periodic\"\nshared_sides = true\n"] {
        for wanted in [-1e4, -1e5] {
            let text = format!(
                "packing = \"packings/discs-100.json\"\n[contact]\nmodulus = 1e11\nstiffness_ratio = 0.5\nfriction = 0.5\n{frame}\
                 [[path]]\nincrements = 1\nstress = {{ xx = {wanted}, yy = {wanted} }}\n"
            );
            let test = ElementTest::from_toml(&text).unwrap();
            let mut last = None;
            let ended = run_element(&test, &root, TangentKind::None, &mut |row| last = Some(row.clone()));
            let row = last.expect("row 0 is always there");
            match ended {
                Ok(summary) => {
                    assert_eq!(summary.begins_with_motion, 1);
                    let share = if summary.stress_jumps > 0 { 0.05 } else { 1e-3 };
                    let pressure = -0.5 * (row.stress[0][0] + row.stress[1][1]);
                    let scale = pressure.max(-wanted);
                    for stress in [row.stress[0][0], row.stress[1][1]] {
                        assert!((stress - wanted).abs() <= share * scale, "{stress} for {wanted} Pa, {summary:?}");
                    }
                }
                Err(error) => assert!(row.increment == 0 && error.to_string().contains("did not reach"), "{error}"),
            }
        }
    }
}
