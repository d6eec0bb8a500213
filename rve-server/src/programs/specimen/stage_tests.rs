//! Ends of stages: balance is balance of forces that are borne.

use super::{SpecimenEvent, SpecimenRow, SpecimenTest, run_specimen};
use crate::definition::PackingFile;
use crate::space::Discs;

/// A stage that strains would end before it has strained.
#[test]
fn balance_is_not_waited_for_while_a_stage_strains() {
    let text = "packing = \"\"\ntiles = [1, 1]\n[contact]\nlaw = \"linear\"\nnormal_stiffness = 1e9\nstiffness_ratio = 0.5\n\
                friction = 0.5\ndensity = 2000.0\n[[stage]]\nname = \"strain\"\nsteps = 10\nstrain = { yy = -0.1 }\nuntil_balance = 1e-3\n";
    let test: SpecimenTest = toml::from_str(text).unwrap();
    let packing = PackingFile::<Discs>::new([[0.05, 0.0], [0.0, 0.05]], vec![[0.02, 0.02, 0.01]]);
    let refusal = run_specimen(&test, &packing, &mut |_| {}).unwrap_err().to_string();
    assert!(refusal.contains("until_balance") && refusal.contains("in the next one"), "{refusal}");
}

/// The last row of a test all stages of which end in balance.
fn balanced(text: &str, packing: &PackingFile<Discs>) -> SpecimenRow {
    let test: SpecimenTest = toml::from_str(text).unwrap();
    let mut last = None;
    let summary = run_specimen(&test, packing, &mut |event| {
        if let SpecimenEvent::Row(row, _) = event {
            last = Some((*row).clone());
        }
    });
    assert_eq!(summary.unwrap().unbalanced_stages, 0);
    last.unwrap()
}

/// The floor is drawn away under a disc, which falls: the stage that waits for balance ends where it rests on the floor, not on the way.
#[test]
fn a_disc_in_free_fall_is_not_balanced() {
    let (side, radius, density, gravity) = (0.05, 0.01, 2000.0, 9.81);
    let packing = PackingFile::<Discs>::new([[side, 0.0], [0.0, side]], vec![[0.02, 0.02, radius]]);
    let text = format!(
        "packing = \"\"\ntiles = [1, 1]\nperiodic = [\"x\"]\n[contact]\nlaw = \"linear\"\nnormal_stiffness = 1e9\nstiffness_ratio = 0.5\n\
         friction = 0.5\ndensity = {density}\n[motion]\ngravity = [0.0, -{gravity}]\nscaled_masses = false\n\
         [[stage]]\nname = \"open\"\nsteps = 10\nstrain = {{ yy = 0.2 }}\n\
         [[stage]]\nname = \"fall\"\nsteps = 100000\nuntil_balance = 1e-2\n"
    );
    let row = balanced(&text, &packing);
    // Floor and lid share what the floor alone bears, over the width of the cell.
    let weight = std::f64::consts::PI * radius * radius * density * gravity;
    let expected = -0.5 * weight / side;
    let stress = row.wall_stress[1];
    assert!((stress / expected - 1.0).abs() < 2e-2, "{stress} Pa, {expected} Pa of the weight");
    // The columns of a row close the balance of energy.
    let lost = row.friction_work + row.viscous_work + row.damping_work;
    let missing = row.wall_work + row.gravity_work - (row.kinetic_energy + row.elastic_energy + lost);
    assert!(row.gravity_work > 0.0 && (missing - row.missing_energy).abs() < 1e-9 * row.gravity_work, "{row:?}");
}

/// A plate on grains with weight: the floor stands still and bears both. It was moved like the plate, and grains with plate and floor fell for
/// ever, in balance.
#[test]
fn a_floor_bears_the_weight_of_the_grains_and_the_plate_on_them() {
    let (side, radius, density, gravity) = (0.05, 0.0126, 2000.0, 981.0);
    let quarter = 0.25 * side;
    let grains = [[1.0, 1.0], [3.0, 1.0], [1.0, 3.0], [3.0, 3.0]].map(|[x, y]| [x * quarter, y * quarter, radius]);
    let packing = PackingFile::<Discs>::new([[side, 0.0], [0.0, side]], grains.to_vec());
    let text = format!(
        "packing = \"\"\ntiles = [1, 1]\n[contact]\nlaw = \"linear\"\nnormal_stiffness = 1e7\nstiffness_ratio = 0.5\n\
         friction = 0.5\ndensity = {density}\n[motion]\ngravity = [0.0, -{gravity}]\nscaled_masses = false\n\
         [[stage]]\nname = \"load\"\nsteps = 200000\nstress = {{ yy = -1e5 }}\nuntil_balance = 1e-3\n"
    );
    let row = balanced(&text, &packing);
    // The mean of both walls has half of the weight above the plate's stress.
    let width = side * (1.0 + row.strain[0]);
    let expected = -1e5 - 0.5 * 4.0 * std::f64::consts::PI * radius * radius * density * gravity / width;
    assert!((row.wall_stress[1] / expected - 1.0).abs() < 2e-3, "{} for {expected} Pa", row.wall_stress[1]);
}
