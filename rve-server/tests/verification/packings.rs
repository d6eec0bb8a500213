//! The committed packings are what their descriptions say.

use crate::samples::assert_close;

use rve_server::preparation::{AnisotropyTarget, Grading, PackingRecipe, Removal, StateTarget, generate};
use rve_server::space::Discs;
use std::path::Path;

fn recipe(name: &str) -> PackingRecipe {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name);
    PackingRecipe::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Prepared twice from its description, a packing has the same bits, and its report holds what was asked for. (The committed
/// one comes from an earlier solver.)
#[test]
fn hundred_discs_are_made_again_to_the_same_bits() {
    let recipe = recipe("discs-100.toml");
    let mut stages = Vec::new();
    let (made, report) = generate::<Discs>(&recipe, &mut |progress| stages.push(progress.stage)).unwrap();
    let (again, _) = generate::<Discs>(&recipe, &mut |_| ()).unwrap();
    assert_eq!(made.to_json(), again.to_json());
    assert!(stages.starts_with(&["compression"]) && stages.ends_with(&["servo"]));
    assert!(report.stress_error < 1e-5, "stress error {:e}", report.stress_error);
    assert!(report.unbalanced_force_ratio < 1e-7, "unbalanced {:e}", report.unbalanced_force_ratio);
    assert!(report.void_ratio > 0.15 && report.void_ratio < 0.25);
    assert!(report.fabric_anisotropy < 0.1);
}

#[test]
fn recipes_with_defects_are_refused_by_key() {
    let sound = recipe("discs-100.toml");
    let refused = |change: &dyn Fn(&mut PackingRecipe)| {
        let mut recipe = sound.clone();
        change(&mut recipe);
        generate::<Discs>(&recipe, &mut |_| ()).unwrap_err().to_string()
    };
    assert!(refused(&|r| r.number = 3).contains("number = 3"));
    assert!(refused(&|r| r.number = 1_000_000_000_000).contains("at most 100000000 grains"));
    assert!(refused(&|r| r.number = 1_000_000_000_000).contains("at most 100000000 grains"));
    assert!(refused(&|r| r.pressure = Some(-1.0)).contains("pressure = -1"));
    assert!(refused(&|r| r.grading = Grading::List { radii: vec![] }).contains("grading.radii"));
    assert!(refused(&|r| r.contact.friction = f64::NAN).contains("contact.friction"));
    let unknown = PackingRecipe::from_toml("number = 100\nsead = 1\n").unwrap_err().to_string();
    assert!(unknown.contains("sead") && unknown.contains("line 2"));
    let both = refused(&|r| r.stress = Some(vec![vec![-1.0, 0.0], vec![0.0, -1.0]]));
    assert!(both.contains("not both"));
    assert!(refused(&|r| r.aspect = Some(vec![1.0])).contains("aspect"));
    assert!(refused(&|r| r.removal = Some(removal(80))).contains("removal.number"));
    let two = StateTarget { porosity: Some(0.2), ..void_ratio(0.2, 1e-3) };
    assert!(refused(&|r| r.target = Some(two)).contains("exactly one"));
}

fn removal(number: usize) -> Removal {
    Removal { number, seed: 4 }
}

fn void_ratio(value: f64, tolerance: f64) -> StateTarget {
    StateTarget {
        void_ratio: Some(value),
        porosity: None,
        coordination_number: None,
        coordination_number_no_rattlers: None,
        tolerance,
        friction: [0.1, 0.5],
    }
}

/// The small packing, less finely: what is checked here is not the last digit.
fn coarse() -> PackingRecipe {
    PackingRecipe { tolerance: 1e-6, stress_tolerance: 1e-4, ..recipe("discs-100.toml") }
}

/// All components are servoed, shear too, and the cell has the shape asked for.
#[test]
fn full_stress_tensor_is_reached_in_the_axes_of_the_file() {
    let stress = vec![vec![-1.0e5, 2.0e4], vec![2.0e4, -1.6e5]];
    let recipe = PackingRecipe {
        pressure: None,
        stress: Some(stress),
        aspect: Some(vec![2.0, 1.0]),
        contact: rve_server::contact::ContactTable { friction: 0.3, ..coarse().contact },
        ..coarse()
    };
    let (made, report) = generate::<Discs>(&recipe, &mut |_| ()).unwrap();
    assert_eq!(made.periodicity[0][1], 0.0, "Y1 is axis 1");
    assert_close(report.stress[0][0], -1.0e5, 20.0, "sigma_11");
    assert_close(report.stress[1][1], -1.6e5, 20.0, "sigma_22");
    assert_close(report.stress[0][1], 2.0e4, 20.0, "sigma_12");
    let sides = [made.periodicity[0][0], made.periodicity[1][1]];
    assert!((1.95..2.05).contains(&(sides[0] / sides[1])), "sides {sides:?}");
    assert!(report.requirements.iter().all(|requirement| requirement.is_met()));
}

#[test]
fn void_ratio_is_met_through_the_preparation_friction() {
    let number = 50;
    let recipe = PackingRecipe { number, target: Some(void_ratio(0.232, 4e-3)), ..coarse() };
    let (made, report) = generate::<Discs>(&recipe, &mut |_| ()).unwrap();
    assert_close(report.void_ratio, 0.232, 4e-3, "void ratio");
    let tried = &report.searches.friction;
    assert!(tried[0].value < tried[1].value, "friction makes loose: {tried:?}");
    let taken = tried.last().unwrap();
    assert_eq!((taken.friction, taken.value), (report.friction, report.void_ratio));
    assert_eq!(made.provenance["searches"]["friction"].as_array().unwrap().len(), tried.len());
    let beyond = PackingRecipe { number, target: Some(void_ratio(1.0, 4e-3)), ..coarse() };
    assert!(generate::<Discs>(&beyond, &mut |_| ()).unwrap_err().to_string().contains("out of reach"));
}

/// [Liu2018] compares packings of initial anisotropy 0.02, 0.05 and 0.08 under the same pressure.
#[test]
fn anisotropy_is_left_by_a_shear_while_the_stress_is_isotropic() {
    let target = AnisotropyTarget { value: 0.08, tolerance: 0.01, axis: 2, friction: 0.4 };
    let (_, report) =
        generate::<Discs>(&PackingRecipe { anisotropy: Some(target), ..coarse() }, &mut |_| ()).unwrap();
    assert_close(report.fabric_anisotropy, 0.08, 0.01, "anisotropy");
    assert!(report.fabric[1][1] > report.fabric[0][0]);
    assert!(report.stress_error < 1.1e-4);
    assert!(report.searches.shear.last().unwrap().shear > 0.0);
}

#[test]
fn removed_grains_are_gone_and_the_rest_bears_the_stress() {
    let (made, report) =
        generate::<Discs>(&PackingRecipe { removal: Some(removal(6)), ..coarse() }, &mut |_| ()).unwrap();
    assert_eq!(made.grains.len(), 94);
    assert!(report.stress_error < 1.1e-4);
}

#[test]
fn sieve_curves_that_few_grains_cannot_follow_are_refused() {
    let grading = Grading::Sieve { sizes: vec![2e-4, 4e-4, 8e-4], passing: vec![0.0, 0.3, 1.0], tolerance: 1e-4 };
    let reason = generate::<Discs>(&PackingRecipe { grading, ..coarse() }, &mut |_| ()).unwrap_err().to_string();
    assert!(reason.contains("sieve curve"), "{reason}");
}

/// Without friction tangential springs bear nothing: whatever their stiffness, cells are compressed to the stress. Some of these were
/// refused after 5000 steps of the servo where there were no springs, or very stiff ones.
#[test]
fn frictionless_cells_reach_their_stress_with_any_tangential_stiffness() {
    for stiffness_ratio in [0.0, 1.3] {
        for seed in 0..4 {
            let mut recipe = recipe("discs-100.toml");
            (recipe.seed, recipe.pressure) = (seed, Some(1e4));
            (recipe.tolerance, recipe.stress_tolerance) = (1e-6, 1e-4);
            recipe.grading = Grading::Uniform { smallest_radius: 1e-4, largest_radius: 2e-4 };
            (recipe.contact.modulus, recipe.contact.normal_stiffness) = (Some(3e7), None);
            (recipe.contact.friction, recipe.contact.stiffness_ratio) = (0.0, Some(stiffness_ratio));
            let (_, report) = generate::<Discs>(&recipe, &mut |_| ())
                .unwrap_or_else(|error| panic!("k_t/k_n {stiffness_ratio}, seed {seed}: {error}"));
            assert!(report.stress_error < 1e-4, "{:e}", report.stress_error);
        }
    }
}
