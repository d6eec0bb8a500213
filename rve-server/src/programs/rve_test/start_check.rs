//! The packing as given against the path: units, modulus or thickness that are not those of the packing show in its first row, long before
//! anything fails.

use super::path::Matrix;
use super::row::ElementRow;
use super::test_file::{COMPONENT_KEYS, ElementTest};

/// Largest factor between the stress of the packing and the first targets that is taken to be meant.
const FARTHEST: f64 = 10.0;

/// Places of the direct components in a row-major tensor.
const DIRECT: [usize; 3] = [0, 4, 8];

/// Remedy of a packing that is not what its path expects.
const REMEDY: &str = "check units and thickness of the packing (m), contact.modulus or normal_stiffness, and the stresses of the path (Pa)";

/// Whether `stress`, Pa, of the packing and the direct stresses that the first segment prescribes differ by a large factor. Targets of zero
/// unload on purpose, and a packing without any stress is told of otherwise.
pub(super) fn is_far_from_targets(test: &ElementTest, stress: &Matrix) -> bool {
    scales(test, stress).is_some_and(|scales| scales.are_far_apart())
}

/// Warnings about the packing as given, row 0 of `test`, one line each.
pub fn start_warnings(test: &ElementTest, row: &ElementRow) -> Vec<String> {
    let targets = scales(test, &row.stress).filter(Scales::are_far_apart).map(|scales| {
        format!(
            "the packing has {0} = {1:.3e} Pa and the path begins with {0} = {2:.3e} Pa, {3}; if this is not meant, {REMEDY}",
            scales.name(),
            scales.found,
            scales.wanted,
            scales.factor_text()
        )
    });
    let dense = (row.void_ratio < 0.0).then(|| {
        format!(
            "the void ratio of the packing is {:.3}: the grains have more volume than their cell; radii and cell are in different units, or \
             they overlap far too much",
            row.void_ratio
        )
    });
    targets.into_iter().chain(dense).collect()
}

/// The direct stress with the largest target of the first segment, Pa, tension positive.
struct Scales {
    place: usize,
    found: f64,
    wanted: f64,
}

impl Scales {
    fn are_far_apart(&self) -> bool {
        let (found, wanted) = (self.found.abs(), self.wanted.abs());
        found > FARTHEST * wanted || wanted > FARTHEST * found
    }

    fn name(&self) -> String {
        format!("sigma_{}", COMPONENT_KEYS[self.place])
    }

    fn factor_text(&self) -> String {
        let (found, wanted) = (self.found.abs(), self.wanted.abs());
        if wanted > found {
            format!("{:.1e} times as much", wanted / found)
        } else {
            format!("{:.1e} times less", found / wanted)
        }
    }
}

fn scales(test: &ElementTest, stress: &Matrix) -> Option<Scales> {
    let targets = test.path.first()?.stress.values();
    let wanted = DIRECT.into_iter().filter_map(|place| Some((place, targets[place]?)));
    let (place, wanted) = wanted.max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()))?;
    let found = stress[place / 3][place % 3];
    (wanted != 0.0 && found != 0.0).then_some(Scales { place, found, wanted })
}

#[cfg(test)]
mod tests {
    use super::super::run_element_on;
    use super::*;
    use crate::definition::Packing;
    use protocol::TangentKind;
    use std::ops::ControlFlow;
    use std::path::Path;

    /// A modulus of other units, or radii that are too large for their cell, are told of in row 0; a packing that is compressed to five times its
    /// pressure, or unloaded, is not.
    #[test]
    fn a_packing_that_is_not_what_the_path_expects_is_told_of_at_once() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let begun = |modulus: f64, swelling: f64, path: &str| {
            let text = format!(
                "packing = \"packings/discs-100.json\"\n[contact]\nlaw = \"linear\"\nmodulus = {modulus:e}\nstiffness_ratio = 0.5\n\
                 friction = 0.5\n[rve]\naccuracy = \"draft\"\n[[path]]\nincrements = 20\n{path}"
            );
            let test = ElementTest::from_toml(&text).unwrap();
            let mut packing = Packing::read(&root.join(&test.packing)).unwrap();
            if let Packing::Discs(discs) = &mut packing {
                discs.grains.iter_mut().for_each(|grain| grain[2] *= swelling);
            }
            let mut told = Vec::new();
            let end = run_element_on(&test, packing, TangentKind::None, &mut |row| {
                told = start_warnings(&test, row);
                ControlFlow::Break(())
            });
            (told, end.summary)
        };
        let biaxial = "strain = { yy = -0.01 }\nstress = { xx = -1e5 }";
        let (told, summary) = begun(1e11, 1.0, biaxial);
        let expected = [
            "sigma_xx = -1.00",
            "Pa and the path begins with sigma_xx = -1.000e5 Pa",
            "times less",
            "contact.modulus",
        ];
        assert!(told.len() == 1 && expected.iter().all(|part| told[0].contains(part)), "{told:?}");
        assert_eq!(summary.far_from_targets, 1);
        assert!(summary.fallbacks().iter().any(|(what, rows)| what.contains("more than tenfold") && *rows == 1));
        let (told, summary) = begun(1e8, 1.3, "strain = { yy = -0.01 }");
        assert!(told.len() == 1 && told[0].contains("void ratio of the packing is -0."), "{told:?}");
        assert_eq!((summary.far_from_targets, summary.negative_void_ratio), (0, 1));
        for path in [biaxial, "stress = { xx = -5e5, yy = -5e5 }", "stress = { xx = 0.0, yy = 0.0 }"] {
            let (told, summary) = begun(1e8, 1.0, path);
            assert!(told.is_empty() && summary.far_from_targets == 0, "{path}: {told:?}");
        }
    }
}
