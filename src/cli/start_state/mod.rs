//! The initial state of a run: the stress of its packings, and whether the loads of the first step are in equilibrium with it.
//!
//! A packing has the stress it was prepared under. Initial loads that need another stress act on the grains at once, before the
//! first step; most often no equilibrium is found.

mod balance;
mod initial_loads;
mod packing_state;

pub(crate) use packing_state::PackingState;

use scene_reader::Scene;

/// Out-of-balance force over the loads above which packing and loads do not match. Regions of weakened or turned cells stay
/// below it; a load of half the packing pressure is far above.
pub(crate) const MISMATCH: f64 = 0.1;

/// The same share above which it is worth a note: step 0 strains the body by it.
pub(crate) const SLIGHT_MISMATCH: f64 = 1e-2;

/// What the initial loads are to the stress at the start.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum LoadComparison {
    /// They are in balance with it.
    Match,
    /// They nearly are: how far they are not, in words.
    Nearly(String),
    /// They are not: both in words.
    Differ(String),
    /// The two were not compared: why.
    NotCompared(String),
}

/// Compares the initial loads of a scene with the stress of its packings, or with that which its cells are brought to.
pub(crate) fn compare_loads(scene: &Scene, packings: &[PackingState]) -> LoadComparison {
    let stresses = stresses_at_points(scene, packings);
    let imbalance = match balance::imbalance(scene, &stresses) {
        Err(reason) => return LoadComparison::NotCompared(reason),
        Ok(imbalance) if imbalance <= SLIGHT_MISMATCH => return LoadComparison::Match,
        Ok(imbalance) => imbalance,
    };
    let residual = format!("initial residual {imbalance:.1e} (relative to applied loads)");
    if imbalance <= MISMATCH {
        return LoadComparison::Nearly(format!(
            "{residual}: step 0 strains the body until it is in balance; if that is not meant, compare unit weight, pressures and the stress of \
             the packing"
        ));
    }
    LoadComparison::Differ(match scene.preparation() {
        Some(_) => format!(
            "{residual}: the stress that [initial_stress] brings the cells to is not in balance with the initial loads; unit weight, body \
             force and pressures on the surface belong together"
        ),
        None => format!(
            "{residual}: the packing has the stress {}{}; {}",
            packings[0].stress_text(),
            other_pressures(&packings[0], &stresses),
            initial_loads::initial_loads(&scene.problem, &stresses)
        ),
    })
}

/// How many points have packings with another mean pressure, and which; empty if none has.
fn other_pressures(packing: &PackingState, stresses: &[protocol::Tensor2]) -> String {
    let mut others: Vec<f64> = stresses
        .iter()
        .map(|stress| packing_state::pressure_of(stress, packing.dimension))
        .filter(|pressure| (pressure - packing.pressure()).abs() > MISMATCH * packing.pressure().abs())
        .collect();
    others.sort_by(f64::total_cmp);
    match (others.first(), others.last()) {
        (Some(least), Some(most)) => format!(
            "; {} of {} Gauss points have packings of regions with mean pressures of {least:.3e} to {most:.3e} Pa",
            others.len(),
            stresses.len()
        ),
        _ => String::new(),
    }
}

/// The stress of the packing of every Gauss point, Pa.
fn stresses_at_points(scene: &Scene, packings: &[PackingState]) -> Vec<protocol::Tensor2> {
    scene.materials.made_of.iter().map(|&kind| packings[kind].stress).collect()
}

/// Warnings about all packings of a scene, one line each; those of regions say so.
pub(crate) fn remarks(packings: &[PackingState], of: impl Fn(&PackingState) -> Vec<String>) -> Vec<String> {
    let mut remarks: Vec<String> = Vec::new();
    for (number, packing) in packings.iter().enumerate() {
        for remark in of(packing) {
            let remark = if number == 0 { remark } else { format!("packing of a region: {remark}") };
            if !remarks.contains(&remark) {
                remarks.push(remark);
            }
        }
    }
    remarks
}

/// Remedy if loads and packing do not match, and cells are not prepared.
const REMEDY: &str = "make the pressures those that the packing has, or start at the stress of the packing (pressures are constant from \
                      the first step on unless a history says otherwise) and apply the loads in a stage of its own (history = \"ramp\"), or prepare \
                      another packing with `grainspan pack`; where they differ by a factor of ten and more, units, thickness or modulus are seldom those \
                      that the packing was made with; `grainspan check` compares both";

/// Remedy if loads and stress at the start do not match.
pub(crate) fn remedy(scene: &Scene) -> &'static str {
    if scene.preparation().is_some() {
        "give the body force and the pressures that carry the stress of [initial_stress] with history = \"constant\" from the first \
         stage on, or correct `geostatic`; `grainspan check` compares both"
    } else {
        REMEDY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    pub(super) fn scene(file: &str, overrides: &[&str]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
        Scene::load(&path, &overrides.iter().map(|&given| given.to_owned()).collect::<Vec<_>>()).unwrap()
    }

    fn comparison(scene: &Scene) -> LoadComparison {
        compare_loads(scene, &PackingState::of_all(scene).unwrap())
    }

    fn difference(scene: &Scene) -> String {
        match comparison(scene) {
            LoadComparison::Differ(text) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn loads_that_do_not_match_the_packing_are_named_with_both_stresses() {
        assert_eq!(comparison(&scene("biaxial-small.toml", &[])), LoadComparison::Match);
        let text = difference(&scene("biaxial-small.toml", &["pressure.0.value=2e5", "pressure.1.value=2e5"]));
        for part in ["xx -1.000e5", "yy -1.000e5", "2.000e5 Pa on left (the packing has 1.000e5)"] {
            assert!(text.contains(part), "'{part}' is missing in: {text}");
        }
        let text = difference(&scene("biaxial-small.toml", &["pressure.1.value=-1e5"]));
        assert!(text.contains("-1.000e5 Pa on right"), "{text}");
    }

    /// A face without a condition has a pressure of 0.
    #[test]
    fn free_faces_are_named() {
        let text = difference(&scene("biaxial-small.toml", &["pressure=[]"]));
        assert!(text.contains("0.000e0 Pa on left (the packing has 1.000e5)"), "{text}");
        assert!(!text.contains("on bottom"), "a held face is not free: {text}");
    }

    /// A set whose sides are loaded by the names of others is not free, and loads that agree are not named among those that differ.
    #[test]
    fn sides_that_other_sets_load_are_not_called_free() {
        let text = difference(&scene("geotechnics/footing.toml", &["pressure.0.value=3e5"]));
        assert!(text.contains("3.000e5 Pa on surface") && !text.contains("on top"), "{text}");
        let text = difference(&scene("biaxial-small.toml", &["pressure.0.value=2e5"]));
        assert!(text.contains("do not agree with it are") && text.contains("2.000e5 Pa on left"), "{text}");
        assert!(!text.contains("on right"), "{text}");
        // Pressures that agree do not make the body force agree.
        let weight = "body_force=[{ set = 'all', value = { y = -1e7 }, history = 'constant' }]";
        let text = difference(&scene("biaxial-small.toml", &[weight]));
        assert!(text.contains("the initial loads are") && text.contains("a body force of"), "{text}");
    }

    #[test]
    fn shipped_scenes_match_their_packings() {
        for file in [
            "biaxial.toml",
            "single-hexahedron-biaxial.toml",
            "compression-shear.toml",
            "single-element.toml",
            "biaxial-weak-element.toml",
        ] {
            assert_eq!(comparison(&scene(file, &[])), LoadComparison::Match, "{file}");
        }
    }

    /// What was not compared is not said to agree.
    #[test]
    fn loads_that_may_set_off_a_motion_are_not_compared() {
        let scene = scene("liu2015/column.toml", &[]);
        assert!(matches!(comparison(&scene), LoadComparison::NotCompared(reason) if reason.contains("motion")));
    }
}
