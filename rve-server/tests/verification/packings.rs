//! The committed packings are what their descriptions say.

use crate::samples::packing;
use rve_server::packing::{Grading, PackingRecipe, generate};
use std::path::Path;

fn recipe(name: &str) -> PackingRecipe {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name);
    PackingRecipe::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Prepared again from its description, the small packing has the same bits, and its report holds what was asked for.
#[test]
fn hundred_discs_are_made_again_to_the_same_bits() {
    let recipe = recipe("discs-100.toml");
    let mut stages = Vec::new();
    let (made, report) = generate(&recipe, &mut |progress| stages.push(progress.stage)).unwrap();
    assert_eq!(made.to_json(), packing("discs-100.json").to_json());
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
        generate(&recipe, &mut |_| ()).unwrap_err().to_string()
    };
    assert!(refused(&|r| r.number = 3).contains("number = 3"));
    assert!(refused(&|r| r.pressure = -1.0).contains("pressure = -1"));
    assert!(refused(&|r| r.grading = Grading::List { radii: vec![] }).contains("grading.radii"));
    assert!(refused(&|r| r.contact.friction = f64::NAN).contains("contact.friction"));
    let unknown = PackingRecipe::from_toml("number = 100\nsead = 1\n").unwrap_err().to_string();
    assert!(unknown.contains("sead") && unknown.contains("line 2"));
}
